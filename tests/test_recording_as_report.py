"""The recording and the report of a run say the same."""

import re

import numpy as np
import pytest
from recordings import read

from inspector import colors
from inspector.analysis import analyse_file
from inspector.library import demo_run, load_library, model_files
from inspector.recording.run import write
from inspector.report import html
from inspector.report.findings import LOCALISATION, finding_of


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


def table(analysis, title):
    """Rows of a table of the page, as dictionaries."""
    (found,) = (one for one in html.found(analysis) if one.title == title)
    return [dict(zip(found.head, row, strict=True)) for row in found.rows]


def test_class_time_and_localisation_of_findings_are_the_same(analysis, recording):
    rows = table(analysis, "Findings")
    assert len(rows) == len(analysis.findings) == 1
    for row in rows:
        lines = text(recording).splitlines()
        line = next(one for one in lines if one.startswith(f"- {row['class']}"))
        assert f"{row['from [s]']} s to {row['to [s]']} s, score {row['score']}" in line
        for column in LOCALISATION:
            assert row[column]
            assert row[column] in line


def test_an_annotated_failure_that_was_found_is_localised_as_it_was_found(analysis, recording):
    annotated = [row for row in table(analysis, "Annotated") if row["class"] != "ok"]
    found = table(analysis, "Findings")
    assert len(annotated) == 1
    for column in LOCALISATION:
        assert annotated[0][column] == found[0][column]
    assert text(recording).count(" Hz; ") == 1  # one band
    assert f"found, {annotated[0]['found']}" in text(recording)


def test_lanes_and_shades_end_where_the_text_says(analysis, recording):
    found = table(analysis, "Findings")
    for event, row in zip(analysis.findings, found, strict=True):
        block = next(block for block in analysis.run.blocks if finding_of(analysis, block) == event)
        panels = [f"/{panel}/finding/{event.label}" for panel in ("noise", "level", "probability")]
        for path in [*panels, f"/class/found/{event.label}"]:
            edges, _ = read(recording, path, "Measurements:values")
            assert [f"{edge:.2f}" for edge in edges[:2]] == [row["from [s]"], row["to [s]"]]
        edges, _ = read(recording, f"/class/annotated/{event.label}", "Measurements:values")
        np.testing.assert_allclose(edges[:2], [block.start, block.stop], atol=1e-9)


@pytest.fixture(scope="module")
def page(analysis):
    """The page, and what its picture was drawn with: spans, bars, names of rows."""
    axes = pytest.importorskip("matplotlib.axes").Axes
    drawn = {"axvspan": [], "broken_barh": [], "set_yticks": []}

    def noted(name):
        plain = getattr(axes, name)

        def call(self, *values, **style):
            drawn[name].append((values, style))
            return plain(self, *values, **style)

        return call

    with pytest.MonkeyPatch.context() as patched:
        for name in drawn:
            patched.setattr(axes, name, noted(name))
        return html.page(analysis), drawn


def test_the_picture_of_the_page_shades_the_same_stretches_in_the_same_colours(
    analysis, recording, page
):
    _, drawn = page
    (event,) = analysis.findings
    ends, shade = (event.start, event.stop), colors.CLASSES[event.label]
    painted = tuple(channel / 255 for channel in shade)
    assert drawn["axvspan"]
    for span, style in drawn["axvspan"]:
        assert (span, style["facecolor"]) == (ends, painted)
    bars = [(bar[0], style["facecolor"]) for bar, style in drawn["broken_barh"]]
    assert ([(event.start, event.stop - event.start)], painted) in bars
    _, (rgba,) = read(recording, f"/noise/finding/{event.label}", "Measurements:colors")
    assert rgba[0] >> 8 == int.from_bytes(bytes(shade), "big")


def test_rows_of_classes_joints_and_links_are_the_same(recording, page):
    names = [values[1] for values, _ in page[1]["set_yticks"] if len(values) == 2]
    for panel, shown in zip(("class", "joints", "links"), names, strict=True):
        _, (labels,) = read(recording, f"/axis/{panel}/left", "Points2D:labels")
        assert labels == shown


def test_classes_are_written_as_words_in_both(recording, page):
    shown = re.sub(r"base64,[^\"]*", "", page[0])
    assert "high accelerations" in shown  # in a remark
    assert "highaccelerations" not in shown
    assert "highaccelerations" not in text(recording)
    _, (labels,) = read(recording, "/axis/class/left", "Points2D:labels")
    assert "high accelerations" in labels
