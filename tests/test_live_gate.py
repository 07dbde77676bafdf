"""`inspector live` as a gate: findings as they come, exit statuses."""

import io
import json
import re
import sys

import numpy as np
import pytest
from commandline import call
from recordings import read

from inspector.library import demo_run
from inspector.reference.judging import Kind
from inspector.reference.levels import LevelStream, levels
from inspector.reference.store import Reference
from noisemodel import Run


def streamed(run):
    names = [f"{name}.velocity" for name in run.joint_names]
    names += [f"{name}_desired" for name in names]
    text = io.StringIO()
    columns = np.hstack([run.time[:, None], run.velocity, run.velocity_desired])
    np.savetxt(text, columns, "%.8g", ",", header=",".join(["time", *names]), comments="")
    return text.getvalue()


@pytest.fixture(scope="module")
def rows():
    """The demo run, which has an impact at 1.78 s, as CSV."""
    run = Run.load(demo_run())
    return streamed(run), run.rate


@pytest.fixture
def live(rows, tmp_path, monkeypatch):
    """Pipes the demo run, or other rows, into the command."""

    def run(*options, text=rows[0], rate=rows[1]):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
        saved = tmp_path / "live.rrd"
        return call("live", "--rate", rate, "--save", saved, "--overwrite", *options)

    return run


def drawn(folder, path="/verdict/words", component="Points2D:labels"):
    return [words for (words,) in read(folder / "live.rrd", path, component)[1]]


def test_a_stream_with_a_finding_prints_it_and_ends_with_1(live):
    status, out, _ = live()
    assert status == 1
    lines = out.splitlines()
    assert lines[0].startswith("impact from 1.")
    assert any(line.startswith("findings: 1 impact") for line in lines)


def test_single_samples_that_are_lost_or_late_hide_no_finding(live, rows):
    header, *lines = rows[0].splitlines()
    lossy = [line for place, line in enumerate(lines) if place % 3000 or not place]
    early = rows[0].replace("\n2,", "\n2.00004,").replace("\n1.5,", "\n1.50004,")
    for text in ("\n".join([header, *lossy, ""]), early):
        status, out, _ = live(text=text)
        assert (status, "findings: 1 impact" in out) == (1, True)


def test_a_stream_of_which_little_can_be_judged_is_not_ok(live, rows, tmp_path):
    header, *lines = rows[0].splitlines()
    holes = [line for place, line in enumerate(lines) if place % 4200 > 30]
    status, out, _ = live(text="\n".join([header, *holes[:15_000], ""]))
    assert (status, "cannot-tell: gaps leave labels to" in out) == (4, True)
    status, out, _ = live(text="\n".join([header, *lines[:5900], ""]))
    assert (status, "it takes 0.6 s to tell what lasts" in out) == (4, True)
    assert drawn(tmp_path) == ["PASS so far", "CANNOT TELL"]
    assert live(text="\n".join([header, *lines[:900], ""]))[0] == 4
    assert drawn(tmp_path) == ["CANNOT TELL"]
    status, out, _ = live(text="\n".join([header, *lines[:15_000:2], ""]))
    assert (status, "is the rate right?" in out) == (4, True)


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


@pytest.fixture(scope="module")
def accepted(simulate, tmp_path_factory):
    """A store of accepted runs."""
    folder = tmp_path_factory.mktemp("accepted")
    simulate.write(folder / "runs")
    assert call("accept", folder / "runs", "--reason", "first release")[0] == 0
    return folder / "reference"


def test_a_stream_louder_than_its_reference_fails_by_joint_and_level(live, accepted, simulate):
    text = streamed(simulate.run("pick", 5, "chatter"))
    status, out, err = live("--reference", accepted, text=text, rate=1000)
    assert status == 1, out + err
    assert re.search(r"\d\d\.\d dB over repetitions at .*\(elbow, ", out)
    status, out, _ = live("--reference", accepted, "--format", "json", text=text, rate=1000)
    begin, summary = map(json.loads, out.splitlines())  # it lasts, and is told once
    assert (begin["start"] < 0.2, begin["evidence"]["joint"]) == (True, "elbow")
    assert (status, summary["status"]) == (1, "findings")
    assert summary["reference"]["scenarios"] == ["pick"]
    assert summary["findings"][0]["evidence"]["joint"] == "elbow"


def test_a_finding_of_a_stream_is_named_as_in_a_file_and_drawn(live, accepted, simulate, tmp_path):
    run = simulate.run("pick", 5)
    run.velocity[2001:2100, 2] += 0.1 * np.sin(2 * np.pi * 40 * run.time[2001:2100])
    (tmp_path / "x.csv").write_text(streamed(run))
    options = ("--reference", accepted, "--format", "json")
    (file,) = json.loads(call("classify", tmp_path / "x.csv", *options)[1])["runs"]
    _, out, _ = live(*options, text=streamed(run), rate=1000)
    found, expected = json.loads(out.splitlines()[-1])["findings"], file["events"]
    (one,), (other,) = ([each for each in events if each["fails"]] for events in (found, expected))
    assert one["label"] == other["label"] != "louder"
    assert drawn(tmp_path) == ["PASS so far", f"FAIL   1 {one['label']}"]
    told = f"found: {one['label']} from {one['start']:.2f} s"
    assert drawn(tmp_path, "/events", "TextLog:text") == [told]


def test_a_touch_that_was_accepted_is_excused_at_the_end(live, simulate, tmp_path):
    good = tmp_path / "good"
    good.mkdir()
    for number in (1, 2, 3):
        simulate.run("place", number, "impact").save(good / f"place-{number}.npz")
    text = streamed(simulate.run("place", 5, "impact"))
    assert live(text=text, rate=1000)[0] == 1
    status, out, err = live("--reference", good, text=text, rate=1000)
    assert status == 0, out + err
    assert "does not count: as reference: as loud as 3 of place" in out
    assert out.startswith("6000 samples, ")  # nothing before the end
    assert drawn(tmp_path) == ["PASS so far"]


@pytest.mark.parametrize("scenario", ["pick", "place", "wave"])
def test_a_stream_like_its_reference_ends_with_0(live, accepted, simulate, scenario):
    text = streamed(simulate.run(scenario, 6, "harmless"))
    status, out, err = live("--reference", accepted, text=text, rate=1000)
    assert status == 0, out + err
    assert re.match(r"\d+ samples, ", out)  # nothing before the end
    assert f"compared with {accepted}" in out
    assert f"3 repetitions of {scenario}" in out


def test_what_is_louder_than_its_reference_is_told_while_the_stream_runs(live, accepted, simulate):
    text = streamed(simulate.run("place", 5, "impact"))
    options = ("--reference", accepted, "--format", "json", "--fail-fast")
    status, out, _ = live(*options, text=text, rate=1000)
    begin, summary = map(json.loads, out.splitlines())
    assert (status, begin["event"], begin["label"]) == (1, "begin", "impact")
    assert begin["start"] == pytest.approx(2.5, abs=0.15)
    assert begin["evidence"]["joint"] == "upperarm"
    assert summary["duration"] < begin["start"] + 4.3


def test_a_stream_too_long_to_keep_is_compared_as_it_runs(live, accepted, simulate, monkeypatch):
    monkeypatch.setattr("inspector.reference.levels.LONGEST", 5.0)
    options = ("--reference", accepted)
    status, out, err = live(*options, text=streamed(simulate.run("pick", 5, "chatter")), rate=1000)
    assert status == 1
    assert "elbow" in out.splitlines()[0]
    assert "minutes are not compared as a whole" in err
    assert live(*options, text=streamed(simulate.run("pick", 5)), rate=1000)[0] == 0
    # The last second, after which there are no 3 s more.
    late = simulate.run("pick", 5)
    now = late.time > late.time[-1] - 1.0
    late.velocity[now, 2] += 0.1 * np.sin(2 * np.pi * 62 * late.time[now])
    status, out, _ = live(*options, text=streamed(late), rate=1000)
    assert (status, "elbow" in out.splitlines()[0]) == (1, True)


def test_each_stretch_of_a_stream_is_compared_with_the_same_motion(accepted, simulate):
    run, latest = simulate.run("wave", 7), []
    stream = LevelStream(run.joint_names, run.rate, tell=latest.append)
    time = np.tile(run.velocity, (3, 1))  # the motion is made three times
    signals = {"velocity": time, "velocity_desired": np.tile(run.velocity_desired, (3, 1))}
    count = len(time)
    stream.push(np.arange(count) / run.rate, signals, np.ones(count, dtype=bool), np.zeros(count))
    reference = Reference.load(accepted)
    found = [reference.compare(each) for each in latest]
    assert [each.run.start for each in found[:3]] == pytest.approx([0.0, 0.0, 3.0])
    assert len(found) == 5
    for each in found[:2]:  # the arm does not return to where it began
        assert each.share(Kind.REPETITIONS) > 0.9
        assert each.scenarios == ("wave",)
        assert not each.exceedances


def test_levels_that_come_in_pieces_are_those_of_the_whole(simulate):
    run = simulate.run("wave", 1)
    long = {n: np.tile(getattr(run, n), (3, 1)) for n in ("velocity", "velocity_desired")}
    count = len(long["velocity"])
    valid, lost = np.ones(count, dtype=bool), np.zeros(count)
    stream, time = LevelStream(run.joint_names, run.rate), np.arange(count) / run.rate
    for first in range(0, count, 50):
        part = slice(first, first + 50)
        signals = {name: values[part] for name, values in long.items()}
        stream.push(time[part], signals, valid[part], lost[part])
    found = stream.finish()
    whole = levels(Run(time=time, joint_names=run.joint_names, **long))
    assert found.level.shape == whole.level.shape
    assert np.nanmax(np.abs(found.level - whole.level)[:, :, :, 1:]) < 0.5
    np.testing.assert_allclose(found.guide, whole.guide, atol=1e-3)
