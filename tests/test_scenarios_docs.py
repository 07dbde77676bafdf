"""The page about the scenarios has what the table of the code has."""

from pathlib import Path

from noiseclassifier import scenarios
from noiseclassifier.scenarios.labels import RULE

PAGE = Path(__file__).parents[1] / "docs" / "scenarios.md"


def row(line: scenarios.Scenario) -> str:
    """A line of the page's table."""
    cells = [
        line.cases[family].description or line.description if family in line.cases else "none"
        for family in ("humanoid", "quadruped", "arm")
    ]
    return f"| {line.number} | `{line.name}` | {' | '.join(cells)} |"


def test_the_page_has_every_line_of_the_table():
    page = PAGE.read_text(encoding="utf-8")
    lacking = [row(line) for line in scenarios.SCENARIOS.values() if row(line) not in page]
    assert not lacking, "\n".join(lacking)


def test_the_page_has_every_robot():
    page = PAGE.read_text(encoding="utf-8")
    assert all(f"`{robot}`" in page for robot in scenarios.ROBOTS)


def test_the_page_states_the_thresholds_of_the_rule():
    page = PAGE.read_text(encoding="utf-8")
    for words in (
        f"above {RULE.lowest:g} Hz",
        f"over {RULE.smoothing * 1e3:g} ms",
        f"above {RULE.felt:g} rad/s",
        f"{RULE.contrast:g} times louder than the {RULE.before:g} s before",
        f"reaches {RULE.blow:g} rad/s",
        f"more than {RULE.acceleration:g} rad/s²",
    ):
        assert words in page, words
