"""`inspector live` as a gate: findings as they come, exit statuses."""

import io
import json
import sys

import numpy as np
import pytest
from commandline import call

from inspector.assets import demo_run
from noisemodel import Run


@pytest.fixture(scope="module")
def rows():
    """The demo run, which has an impact at 1.78 s, as CSV."""
    run = Run.load(demo_run())
    names = [f"{name}.velocity" for name in run.joint_names]
    columns = [run.time[:, None], run.velocity]
    if run.velocity_desired is not None:
        names += [f"{name}_desired" for name in names]
        columns.append(run.velocity_desired)
    text = io.StringIO()
    np.savetxt(
        text, np.hstack(columns), "%.8g", ",", header=",".join(["time", *names]), comments=""
    )
    return text.getvalue(), run.rate


@pytest.fixture
def live(rows, tmp_path, monkeypatch):
    """Pipes the demo run, or other rows, into the command."""

    def run(*options, text=rows[0], rate=rows[1]):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
        saved = tmp_path / "live.rrd"
        return call("live", "--rate", rate, "--save", saved, "--overwrite", *options)

    return run


def test_a_stream_with_a_finding_prints_it_and_ends_with_1(live):
    status, out, _ = live()
    assert status == 1
    lines = out.splitlines()
    assert lines[0].startswith("impact from 1.")
    assert any(line.startswith("findings: 1 impact") for line in lines)


def test_json_lines_tell_of_a_finding_when_it_is_there_and_when_it_is_over(live):
    status, out, _ = live("--format", "json")
    begin, end, summary = map(json.loads, out.splitlines())
    assert {each["format"] for each in (begin, end, summary)} == {"noise-live/1"}
    assert [begin["event"], end["event"], summary["event"]] == ["begin", "end", "summary"]
    assert begin["stop"] is None
    assert end["label"] == "impact"
    assert end["start"] < 1.8 < end["stop"]
    assert (summary["status"], summary["exit_status"], status) == ("findings", 1, 1)
    assert summary["counts"]["failing"] == 1


def test_fail_fast_ends_at_the_first_finding_that_counts(live, rows):
    status, out, _ = live("--fail-fast", "--format", "json")
    (*_, summary) = map(json.loads, out.splitlines())
    assert status == 1
    assert 1.8 < summary["duration"] < len(rows[0].splitlines()) / rows[1]


def test_a_rate_without_a_model_ends_with_4(live):
    text = "time,a.velocity\n" + "".join(f"{i / 30},0.1\n" for i in range(90))
    status, out, _ = live("--format", "json", text=text, rate=30)
    summary = json.loads(out)
    assert status == 4
    assert summary["status"] == "cannot-tell"
    assert "30 Hz" in summary["reason"]
