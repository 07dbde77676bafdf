"""The page of `classify --report`: many runs at a glance."""

import re
from dataclasses import replace
from pathlib import Path

import browser
import pytest
from test_inspector_formats import ALL, BLOW, BROKEN, LACKING, LOUD, QUIET, RATTLE, SLOW

from inspector.report.html import index_page as page
from inspector.verdict import Ruling

LONG = [replace(each, duration=10.0, begin=0.0) for each in (LOUD, LACKING, QUIET)]


def rows(html):
    """The rows of the table, and the parts with the pictures."""
    table, _, parts = html.partition("<h2>Pictures</h2>")
    return table.split("<tr>")[2:], parts.split("<section")[1:]


def test_the_page_has_a_row_and_a_part_for_each_run_the_worst_first():
    table, parts = rows(page(ALL))
    order = [re.search(r"[\w,]+\.npz", row)[0] for row in table]
    assert order == [
        "odd.npz", "broken,1.npz", "loud.npz", "lacking.npz", "slow.npz", "quiet.npz",
        "expected.npz",
    ]  # fmt: skip
    assert [re.search(r"<h2>([^<]+)", part)[1] for part in parts] == order
    for number, (row, part) in enumerate(zip(table, parts, strict=True), 1):
        assert f'href="#run-{number}"' in row
        assert f'id="run-{number}"' in part


def test_the_status_of_each_run_is_in_words():
    table, parts = rows(page([QUIET, LOUD, SLOW, replace(BROKEN, ignored=True)]))
    words = ["bad input (ignored)", "with findings", "cannot tell", "ok"]
    for shown in (table, parts):
        for row, word in zip(shown, words, strict=True):
            assert f">{word}</span>" in row


def test_what_is_missing_and_what_does_not_count_are_told_apart():
    excused = replace(
        LONG[0], events=(replace(BLOW, ruling=Ruling.ALLOWED, reason="the pick"), RATTLE)
    )
    table, parts = rows(page([LONG[1], excused]))
    both = "".join(table)
    assert both.count("missing: impact") == 1
    assert both.count("oscillations, 1 that do not count") == 1
    assert "(allowed: the pick)" in "".join(parts)


def test_what_is_so_of_all_runs_is_said_once():
    found = page([replace(each, message="Nothing above 440 Hz.") for each in LONG])
    assert found.count("Nothing above 440 Hz.") == 1
    assert found.count("model general") == 1
    assert "0 runs: none" in page([])


@pytest.mark.slow
def test_a_browser_shows_the_page_in_both_schemes(tmp_path):
    (tmp_path / "pictures").mkdir()
    drawing = Path(__file__).parents[1] / "assets" / "pictures" / "inspector.png"
    picture = tmp_path / "pictures" / "loud.png"
    picture.write_bytes(drawing.read_bytes())
    (tmp_path / "index.html").write_text(page([replace(LONG[0], picture=picture), *LONG[1:]]))
    with browser.page(1440, 900) as window:
        said = []
        window.on("console", lambda message: said.append(message.text))
        window.goto((tmp_path / "index.html").as_uri())
        window.locator("img").scroll_into_view_if_needed()  # pictures are loaded when seen
        window.evaluate("() => document.images[0].decode()")
        assert window.evaluate("document.images[0].naturalWidth") > 0
        for scheme in ("light", "dark"):
            window.emulate_media(color_scheme=scheme)
            style = "getComputedStyle(document.body)"
            ink, back = (
                sum(map(int, re.findall(r"\d+", window.evaluate(f"{style}.{kind}"))))
                for kind in ("color", "backgroundColor")
            )
            assert (ink < back) == (scheme == "light")
        assert window.evaluate("document.documentElement.scrollWidth") <= 1440
        assert not said  # nothing that the policy of the page refuses
