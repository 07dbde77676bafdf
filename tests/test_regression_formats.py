"""What `diff` writes for machines."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from commandline import call
from test_regression_difference import folder

from inspector.report.cases import ANNOTATIONS, DIFF_MARKER
from noisemodel import Run

SCHEMA = Path(__file__).parents[1] / "docs" / "noise-diff-1.schema.json"
FORMATS = ("text", "json", "junit", "github", "markdown")


@pytest.fixture(scope="module")
def sides(tmp_path_factory):
    """A scenario with a tone, one without a change, and a candidate that is no run."""
    root = tmp_path_factory.mktemp("sides")
    for name, tone, seed in (("before", 0.0, 0), ("after", 0.03, 10)):
        folder(root / name, range(seed, seed + 5), tone=tone)
        folder(root / name, range(5), name="reach-{}")
    (root / "after" / "broken.npz").write_bytes(b"nothing")
    return root


@pytest.fixture(scope="module")
def outputs(sides):
    """All formats of one comparison, the exit status, and what was said on standard error."""
    files = {name: sides / f"out.{name}" for name in FORMATS}
    options = [part for name, path in files.items() for part in ("--write", f"{name}={path}")]
    status, out, err = call(
        "diff", sides / "before", sides / "after", *options, "--report", sides / "report",
        "--report-url", "https://ci.example/9/", "--format", "github",
    )  # fmt: skip
    written = {name: path.read_text() for name, path in files.items()}
    assert written["github"] == out
    return written, status, err


def test_one_bad_file_hides_no_verdict_and_is_the_exit_status(outputs, sides):
    written, status, err = outputs
    assert status == 3
    assert f"inspector: {sides / 'after' / 'broken.npz'}: not a run file" in err
    assert all("worse" in text for text in written.values())


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_of_a_difference_has_the_counts(outputs, name):
    text = outputs[0][name]
    if name == "json":
        counts = json.loads(text)["counts"]
    elif name == "junit":
        counts = {}
        for each in ET.fromstring(text).iter("property"):
            kind, _, key = each.get("name").partition(".")
            counts.setdefault(kind, {})[key] = int(each.get("value"))
    else:
        assert "worse: 2 scenarios (1 worse, 1 same), paired by file name" in text
        assert "files: 1 bad input" in text
        return
    assert counts["scenarios"] == {"worse": 1, "inconclusive": 0, "same": 1, "better": 0}
    assert counts["files"]["compared"] == 20
    assert counts["files"]["bad-input"] == 1


def test_json_of_a_difference_fits_its_published_schema(outputs):
    jsonschema = pytest.importorskip("jsonschema", reason="needs jsonschema")
    schema = json.loads(SCHEMA.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    written = json.loads(outputs[0]["json"])
    jsonschema.Draft202012Validator(schema).validate(written)
    assert set(schema["required"]) == set(written)
    (walk, _) = written["scenarios"]
    assert set(schema["$defs"]["scenario"]["required"]) == set(walk)
    assert set(schema["$defs"]["change"]["required"]) == set(walk["changes"][0])
    assert written["exit_status"] == 3
    walk["verdict"] = "awful"
    with pytest.raises(jsonschema.ValidationError, match="'awful' is not one of"):
        jsonschema.Draft202012Validator(schema).validate(written)


def test_junit_has_a_case_for_each_scenario_and_bad_file(outputs, sides):
    suite = ET.fromstring(outputs[0]["junit"]).find("testsuite")
    cases = {case.get("name"): case for case in suite.iter("testcase")}
    assert list(cases) == ["walk", "reach", str(sides / "after" / "broken.npz")]
    failure = cases["walk"].find("failure")
    assert failure.get("type") == "worse"
    assert re.search(r"wrist, 45 to 91 Hz \+2\d\.\d dB", failure.get("message"))
    picture = re.fullmatch(r"\[\[ATTACHMENT\|(.*)\]\]", cases["walk"].find("system-out").text)[1]
    assert Path(picture).read_bytes().startswith(b"\x89PNG")
    assert cases["reach"].find("failure") is None
    assert suite.find("testcase/error").get("type") == "bad-input"
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("3", "1", "1")


def test_annotations_name_the_scenario_and_a_run_of_the_candidate(outputs, sides):
    lines = outputs[0]["github"].splitlines()
    (worse,) = [line for line in lines if "title=walk::worse: " in line]
    assert worse.startswith(f"::error file={sides / 'after'}/walk-")
    assert lines[-1].startswith("::notice title=noise-inspector::worse: 2 scenarios")
    assert len(lines) <= ANNOTATIONS


def test_markdown_of_a_difference_has_one_picture_and_a_marker_of_its_own(outputs):
    lines = outputs[0]["markdown"].splitlines()
    assert lines[0] == DIFF_MARKER
    assert [line for line in lines if line.startswith("![")] == [
        "![walk over time](https://ci.example/9/worst.png)"
    ]
    assert sum(line.startswith("| `walk` | worse |") for line in lines) == 1
    assert not any("`reach`" in line for line in lines if line.startswith("|"))


@pytest.fixture(scope="module")
def unpaired(tmp_path_factory):
    """A run of each side that the other lacks, the one of the candidate with a finding."""
    root = tmp_path_factory.mktemp("unpaired")
    before, after = (folder(root / name, [1]) for name in ("before", "after"))
    folder(before, [2], name="lost")
    folder(after, [3], name="climb", tone=0.5)
    return before, after


@pytest.mark.parametrize("fail_on", ["any", "worse"])
def test_every_format_names_the_runs_of_one_side(unpaired, fail_on):
    lost, climb = unpaired[0] / "lost.npz", unpaired[1] / "climb.npz"
    out = {}
    for name in FORMATS:
        given = "diff", *unpaired, "--fail-on", fail_on, "--format", name
        status, out[name], _ = call(*given)
        assert status == (fail_on == "any")
    fails = fail_on == "any"
    suite = ET.fromstring(out["junit"]).find("testsuite")
    told = suite.findall("testcase/failure" if fails else "testcase/skipped")
    assert told[0].get("message") == "only in the reference"
    assert told[1].get("message").startswith("only in the candidate" + "; new: " * fails)
    kind = "error" if fails else "warning"
    assert f"::{kind} file={lost}::not-paired: only in the reference" in out["github"].splitlines()
    assert f"::{kind} file={climb}::not-paired: " in out["github"]
    assert f"| `{lost}` | not paired | only in the reference |" in out["markdown"]
    assert f"| `{climb}` | not paired | only in the candidate" in out["markdown"]
    found = json.loads(out["json"])
    schema = json.loads(SCHEMA.read_text())
    jsonschema = pytest.importorskip("jsonschema", reason="needs jsonschema")
    jsonschema.Draft202012Validator(schema).validate(found)
    assert found["not_paired"] == [str(lost), str(climb)]
    assert [each["side"] for each in found["unpaired"]] == ["reference", "candidate"]
    assert found["unpaired"][0]["findings"] == []
    news = found["unpaired"][1]["findings"]
    assert "oscillations" in [each["label"] for each in news]
    assert found["counts"]["findings"] == {"new": len(news), "louder": 0, "resolved": 0}


def test_annotations_of_a_difference_without_a_change_are_its_counts(tmp_path):
    before = folder(tmp_path / "before", [1])
    status, out, _ = call("diff", before, before, "--format", "github")
    assert (status, out) == (
        0,
        "::notice title=noise-inspector::same: 1 scenario (1 same), paired by file name\n",
    )


def test_bad_input_of_a_difference_is_ignored_on_request(sides):
    given = "diff", sides / "before", sides / "after", "--on-bad-input", "ignore"
    status, out, err = call(*given, "--format", "junit")
    assert status == 1
    assert ET.fromstring(out).find(".//skipped").get("message").startswith("not a run file")
    assert "broken.npz: not a run file" in err
    bad = sides / "bad"
    bad.mkdir()
    (bad / "walk-0.npz").write_bytes(b"nothing")
    status, out, _ = call("diff", sides / "before", bad, "--on-bad-input", "ignore")
    assert status == 3  # nothing was compared
    assert out == "nothing is compared; files: 1 bad input\n"


def test_too_few_repetitions_are_skipped_and_a_warning(tmp_path):
    folder(tmp_path / "before", range(2))
    folder(tmp_path / "after", range(5, 7))
    status, out, _ = call("diff", tmp_path / "before", tmp_path / "after", "--format", "github")
    assert status == 4
    (warning,) = out.splitlines()
    assert "2 and 2 runs are too few for the verdict worse: it takes 5 runs of" in warning
    assert warning.startswith("::warning file=")


def test_new_findings_fail_a_scenario_if_they_are_to(tmp_path):
    folder(tmp_path / "before", [1])
    folder(tmp_path / "after", [1], tone=3.0)
    given = "diff", tmp_path / "before", tmp_path / "after", "--format", "junit"
    status, out, _ = call(*given, "--fail-on", "new")
    assert status == 1
    failure = ET.fromstring(out).find(".//failure")
    assert failure.get("type") == "new finding"
    assert failure.get("message").startswith("new: ")
    status, out, _ = call(*given)
    assert status == 4
    assert "new: " in ET.fromstring(out).find(".//system-out").text


def test_a_bug_that_one_run_shows_hides_no_change(sides, monkeypatch):
    from inspector.regression import measure

    opened = measure.open_run

    def wrong(path, *more):
        if path.name == "broken.npz":
            raise KeyError(7)
        return opened(path, *more)

    monkeypatch.setattr(measure, "open_run", wrong)
    given = "diff", sides / "before", sides / "after", "--on-bad-input", "ignore"
    status, out, err = call(*given, "--format", "json")
    assert status == 70
    assert json.loads(out)["counts"]["files"]["internal-error"] == 1
    assert json.loads(out)["verdict"] == "worse"
    assert "Traceback" in err
    assert "broken.npz: KeyError: 7" in err


def test_an_output_of_a_difference_that_is_lost_has_exit_status_5(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("inspector.regression.report.write", full)
    folder(tmp_path / "before", [1])
    given = tmp_path / "before", tmp_path / "before", "--report", tmp_path / "report"
    status, out, err = call("diff", *given)
    assert status == 5
    assert out.startswith("same: 1 scenario")
    reason = f"{tmp_path / 'report'}: cannot be written (No space left on device)"
    assert err == f"inspector: output lost: {reason}\n"


def test_a_format_that_does_not_exist_is_wrong_usage(tmp_path):
    folder(tmp_path / "before", [1])
    status, _, err = call("diff", tmp_path / "before", tmp_path / "before", "--write", "sarif=x")
    assert status == 2
    assert "expected FORMAT=FILE, with one of text, json, junit, github, markdown" in " ".join(
        err.replace("│", " ").split()
    )


def test_joints_with_odd_names_stay_in_their_cells(tmp_path):
    time = np.arange(2000) / 1000
    for side, tone in (("before", 0.0), ("after", 0.1)):
        (tmp_path / side).mkdir()
        for number in range(5):
            random = np.random.default_rng([number, int(tone > 0)])
            velocity = np.cos(time)[:, None] + 0.001 * random.normal(size=(2000, 1))
            velocity += tone * np.sin(500 * time)[:, None]
            run = Run(time=time, velocity=velocity, joint_names=("a|b`c",))
            run.save(tmp_path / side / f"walk-{number}.npz")
    options = "--format", "markdown", "--no-robot"
    status, out, _ = call("diff", tmp_path / "before", tmp_path / "after", *options)
    assert status == 1
    (row,) = [line for line in out.splitlines() if line.startswith("| `")]
    assert "a\\|b'c" in row
