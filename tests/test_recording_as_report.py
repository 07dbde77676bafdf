"""The recording and the report of a run say the same."""

import re
from unittest.mock import patch

import pytest
from recordings import read

from inspector import colors
from inspector.analysis import analyse_file
from inspector.library import demo_run, load_library, model_files
from inspector.recording.run import write
from inspector.report import html


@pytest.fixture(scope="module")
def analysis():
    return analyse_file(demo_run(), load_library(model_files()))


@pytest.fixture(scope="module")
def recording(analysis, tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "demo.rrd"
    write(analysis, path)
    return path


def text(recording):
    """The report of a recording, without the marks of Markdown."""
    _, (document,) = read(recording, "/report", "TextDocument:text")
    return re.sub(r"[*`]", "", document[0])


def listed(page, title):
    """Lines of a list of the page."""
    (items,) = re.findall(f"<h2>{title}</h2><ul>(.*?)</ul>", page[0], re.DOTALL)
    return re.findall("<li>(.*?)</li>", items)


def test_class_time_and_localisation_of_findings_are_the_same(page, recording):
    ((line,), lines) = listed(page, "Findings"), text(recording).splitlines()
    assert f"- {line}" in lines
    told = f"; {line}".replace(": joints", "; joints")
    parts = ("impact, ", " score ", "; joints panda_", "; loudest links panda_", " Hz; first in")
    assert all(part in told for part in parts), told


def test_an_annotated_failure_that_was_found_is_localised_as_it_was_found(page, recording):
    (annotated,) = listed(page, "Annotated")
    assert f"- {annotated}" in text(recording).splitlines()
    assert re.search(r": found, \d\.\d\d s to \d\.\d\d s$", annotated)
    assert text(recording).count(" Hz; ") == 1  # one band


@pytest.fixture(scope="module")
def page(analysis):
    """The page, and what its picture was drawn with: spans and bars."""
    axes = pytest.importorskip("matplotlib.axes").Axes
    with (
        patch.object(axes, "axvspan", autospec=True, side_effect=axes.axvspan) as spans,
        patch.object(axes, "broken_barh", autospec=True, side_effect=axes.broken_barh) as bars,
    ):
        return html.page(analysis), spans.call_args_list, bars.call_args_list


def test_the_picture_of_the_page_shades_the_same_stretches_in_the_same_colours(
    analysis, recording, page
):
    _, spans, bars = page
    (event,) = analysis.findings
    ends, shade = (event.start, event.stop), colors.CLASSES[event.label]
    painted = tuple(channel / 255 for channel in shade)
    assert spans
    for call in spans:
        assert (call.args[1:], call.kwargs["facecolor"]) == (ends, painted)
    drawn = [(call.args[1], call.kwargs["facecolor"]) for call in bars]
    assert ([(event.start, event.stop - event.start)], painted) in drawn
    _, (rgba,) = read(recording, f"/noise/finding/{event.label}", "Measurements:colors")
    assert rgba[0] >> 8 == int.from_bytes(bytes(shade), "big")
