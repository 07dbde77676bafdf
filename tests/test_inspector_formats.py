import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from inspector.analysis.status import Status, Unknown
from inspector.analysis.verdict import Verdict, exit_status
from inspector.localisation.localise import Localisation
from inspector.report.formats import ANNOTATIONS, FORMATS, as_json, github, junit, text
from models import Event

BLOW, RATTLE = Event("impact", 1.0, 1.5, 0.9), Event("oscillations", 2.0, 3.0, 0.8, novel=True)
QUIET = Verdict(Path("quiet.npz"), Status.OK, "general")
LOUD = Verdict(
    Path("loud.npz"),
    Status.FINDINGS,
    "general",
    (BLOW, RATTLE),
    model_sha256="1f2e",
)
SLOW = Verdict(Path("slow.npz"), Status.CANNOT_TELL, message="30 Hz is below every model")
BROKEN = Verdict(Path("broken,1.npz"), Status.BAD_INPUT, message="not a run file: 100%\nbad")


@pytest.mark.parametrize(
    ("verdicts", "status"),
    [
        ([], 0),
        ([QUIET], 0),
        ([QUIET, SLOW], 4),
        ([QUIET, SLOW, LOUD], 1),
        ([QUIET, SLOW, LOUD, BROKEN], 3),
    ],
)
def test_the_exit_status_is_that_of_the_worst_run(verdicts, status):
    assert exit_status(verdicts) == status


def test_text_states_what_was_found_and_when():
    lines = text([QUIET, LOUD]).splitlines()
    assert lines[0] == "quiet.npz: ok [general]"
    assert lines[2] == "  impact from 1.00 s to 1.50 s"
    assert lines[3] == "  oscillations from 2.00 s to 3.00 s, out of distribution"


def test_json_is_noise_verdict_2():
    verdicts = json.loads(as_json([LOUD, SLOW]))
    assert verdicts["format"] == "noise-verdict/2"
    loud, slow = verdicts["runs"]
    assert loud["events"][1] == {
        "label": "oscillations", "start": 2.0, "stop": 3.0, "score": 0.8, "novel": True,
        "order": None,
    }  # fmt: skip
    assert loud["events"][0]["novel"] is False
    assert (loud["run"], loud["status"], loud["unknown"]) == ("loud.npz", "findings", "finding")
    assert (loud["model"], loud["model_sha256"]) == ("general", "1f2e")
    assert (slow["status"], slow["events"]) == ("cannot-tell", [])
    assert slow["message"] == "30 Hz is below every model"


def test_json_has_the_localisation_of_findings_that_were_localised():
    joints = (("knee", 0.75), ("hip", 0.25))
    blow = Localisation("desired", "measured", 0.002, joints=joints, band=(85.0, 130.0))
    known = {LOUD.events[0]: blow, LOUD.events[1]: Localisation()}
    localised = replace(LOUD, localisations=known)
    quiet, loud = json.loads(as_json([QUIET, localised]))["runs"]
    assert quiet["events"] == []
    assert loud["events"][0]["localisation"] == {
        "stage": "desired",
        "following": "measured",
        "lag": 0.002,
        "joints": {"knee": 0.75, "hip": 0.25},
        "band": [85.0, 130.0],
    }
    unknown = {"stage": None, "following": None, "lag": None, "joints": {}, "band": None}
    assert loud["events"][1]["localisation"] == unknown


def test_junit_counts_runs_and_states_reasons():
    suite = ET.fromstring(junit([QUIET, LOUD, SLOW, BROKEN])).find("testsuite")
    assert {key: suite.get(key) for key in ("tests", "failures", "errors", "skipped")} == {
        "tests": "4",
        "failures": "1",
        "errors": "1",
        "skipped": "1",
    }
    failure = suite.find("testcase[@name='loud.npz']/failure")
    assert failure.get("message") == "impact from 1.00 s to 1.50 s"
    assert "oscillations from 2.00 s to 3.00 s, out of distribution" in failure.text


WRITERS = pytest.mark.parametrize("write", FORMATS.values(), ids=FORMATS)


@WRITERS
def test_every_format_states_findings_and_their_novelty(write):
    written = write([LOUD])
    for event in LOUD.events:
        assert event.label in written
    assert ("out of distribution" in written) or ('"novel": true' in written)


@WRITERS
@pytest.mark.parametrize("verdict", [QUIET, LOUD])
def test_ignored_unknown_frames_are_stated_in_every_format(write, verdict):
    ignoring = replace(verdict, unknown=Unknown.IGNORE, message="Unknown frames are ignored.")
    assert "ignore" in write([ignoring])
    assert "ignore" not in write([verdict])


def test_junit_drops_control_characters_that_xml_forbids():
    odd = Verdict(Path("a\x00b\x1b.npz"), Status.BAD_INPUT, message="x\x07y")
    assert ET.fromstring(junit([odd])).find(".//testcase").get("name") == "ab.npz"


def test_github_annotations_escape_what_would_end_them():
    line = github([BROKEN])
    assert line == "::error file=broken%2C1.npz::bad-input: not a run file: 100%25%0Abad"


def test_github_gets_ten_annotations_of_a_kind_at_most():
    lines = github([LOUD] * 25 + [SLOW]).splitlines()
    errors = [line for line in lines if line.startswith("::error")]
    assert len(errors) == ANNOTATIONS
    assert errors[-1] == "::error::16 more runs are not shown here"
    assert sum(line.startswith("::warning") for line in lines) == 1


def test_an_empty_list_of_verdicts_is_valid_in_every_format():
    for write in FORMATS.values():
        assert isinstance(write([]), str)
