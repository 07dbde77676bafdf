"""The page of `classify --report`: many runs at a glance."""

import re
from dataclasses import replace
from pathlib import Path

import browser
import pytest
from test_inspector_formats import ALL, BLOW, BROKEN, LACKING, LOUD, QUIET, RATTLE, SLOW

from inspector.report.html import WIDTH
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


def test_the_counts_lead_to_the_first_run_of_each_status():
    found = page([QUIET, LOUD, LACKING, SLOW])
    links = re.findall(
        r'<a href="#run-(\d)"><span class="status [a-z-]+"><strong>(\d)</strong>', found
    )
    assert links == [("1", "2"), ("3", "1"), ("4", "1")]


def test_findings_lie_where_they_are_in_the_time_of_the_run():
    late = replace(LONG[0], begin=100.0)
    late = replace(
        late, events=tuple(replace(e, start=e.start + 100, stop=e.stop + 100) for e in late.events)
    )
    for verdict in (LONG[0], late):
        (row,), _ = rows(page([verdict]))
        found = re.findall(r'<rect x="([\d.]+)" width="([\d.]+)"', row)
        expected = [(each.start, each.stop - each.start) for each in (BLOW, RATTLE)]
        assert [(float(x), float(width)) for x, width in found] == [
            (start * WIDTH / 10, width * WIDTH / 10) for start, width in expected
        ]


def test_what_is_missing_and_what_does_not_count_look_different():
    excused = replace(
        LONG[0], events=(replace(BLOW, ruling=Ruling.ALLOWED, reason="the pick"), RATTLE)
    )
    table, parts = rows(page([LONG[1], excused]))
    both = "".join(table)
    assert len(re.findall(r'<rect [^>]*class="missing"', both)) == 1
    assert len(re.findall(r'<rect [^>]*class="excused"', both)) == 1
    assert "1 that do not count" in both
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
        assert window.evaluate("document.querySelectorAll('svg rect').length") == 3
        assert not said  # nothing that the policy of the page refuses
