import json
import re
from dataclasses import asdict, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from inspector.errors import Status, Unknown
from inspector.localisation import Localisation
from inspector.report.formats import ANNOTATIONS, COMMENT, FORMATS, MARKER, as_json, text
from inspector.report.html import index_page
from inspector.verdict import Evidence, Finding, Missing, Ruling, Verdict, exit_status

github, junit, markdown, sarif = (
    FORMATS[name] for name in ("github", "junit", "markdown", "sarif")
)
BLOW, RATTLE = Finding("impact", 1.0, 1.5, 0.9), Finding("oscillations", 2.0, 3.0, 0.8, novel=True)
KNEE = (("knee", 0.75), ("hip", 0.25))
LOCATED = Localisation("desired", "measured", 0.002, joints=KNEE, band=(85.0, 130.0))
QUIET = Verdict(Path("quiet.npz"), Status.OK, "general")
LOUD = Verdict(Path("loud.npz"), Status.FINDINGS, "general", (BLOW, RATTLE), model_sha256="1f2e")
SLOW = Verdict(Path("slow.npz"), Status.CANNOT_TELL, message="30 Hz is below every model")
BROKEN = Verdict(Path("broken,1.npz"), Status.BAD_INPUT, message="not a run file: 100%\nbad")
BUG = Verdict(
    Path("odd.npz"), Status.INTERNAL_ERROR, message="KeyError: 7", trace="Traceback:\nKeyError: 7\n"
)
EXPECTED = replace(
    LOUD,
    path=Path("expected.npz"),
    status=Status.OK,
    events=(
        replace(BLOW, ruling=Ruling.ALLOWED, reason="the pick"),
        replace(RATTLE, ruling=Ruling.WAIVED, reason="ticket 1"),
    ),
    expectations="expect.toml",
)
LACKING = Verdict(
    Path("lacking.npz"),
    Status.FINDINGS,
    "general",
    missing=(Missing("impact", 1.1, 1.3, "the pick"),),
    expectations="expect.toml",
)
ALL = [QUIET, LOUD, SLOW, BROKEN, BUG, EXPECTED, LACKING]
SCHEMA = Path(__file__).parents[1] / "docs" / "noise-verdict-3.schema.json"


def test_the_exit_status_is_that_of_the_worst_run():
    worse, ignored = [QUIET, SLOW, LOUD, BROKEN, BUG], replace(BROKEN, ignored=True)
    assert [exit_status(worse[:count]) for count in range(6)] == [0, 0, 4, 1, 3, 70]
    assert exit_status([QUIET, LACKING]) == 1
    assert exit_status([EXPECTED]) == 0
    assert exit_status([QUIET, ignored]) == 0
    assert exit_status([LOUD, ignored]) == 1
    assert exit_status([ignored]) == 3  # nothing was tested


def test_text_has_a_line_for_each_finding_and_says_what_to_type():
    located = Localisation(joints=(("wrist_1", 0.71), ("wrist_2", 0.28)), band=(32.0, 35.0))
    louder = Evidence("repetitions", 24.3, 5.6, "wrist_1", "velocity", (22.0, 45.0))
    run = replace(
        LOUD,
        events=(replace(BLOW, localisation=located, evidence=louder), RATTLE),
        duration=20.0,
        rate=500.0,
        joints=6,
        message="At 500 Hz, oscillations above 220 Hz cannot be seen.",
    )
    assert text([run]).splitlines() == [
        "loud.npz   FAIL   20.0 s, 6 joints, 500 Hz",
        "    1.00 -   1.50 s   impact         wrist_1 71%, wrist_2 28%   32-35 Hz"
        "   +24 dB over repetitions",
        "    2.00 -   3.00 s   oscillations" + " " * 41 + "out of distribution",
        "note:    At 500 Hz, oscillations above 220 Hz cannot be seen.",
        "next:    inspector view loud.npz",
    ]
    line = (
        "impact from 1.00 s to 1.50 s, wrist_1 71%, wrist_2 28%, 32-35 Hz, +24 dB over repetitions"
    )
    for write in (junit, sarif, markdown):
        assert line in write([run])
    assert line.replace("%", "%25") in github([run])


def test_text_states_what_was_expected_missing_and_ignored_and_counts_runs():
    head, blow, rattle = text([EXPECTED]).splitlines()
    assert head == "expected.npz   ok   by expect.toml"
    assert blow == "    1.00 -   1.50 s   impact         (allowed: the pick)"
    assert rattle.endswith("oscillations   out of distribution (waived: ticket 1)")
    missing = "  missing: impact from 1.10 s to 1.30 s (required: the pick)"
    assert text([LACKING]).splitlines()[1] == missing
    assert "1 of the bad input ignored" in text([replace(BROKEN, ignored=True), QUIET])
    assert text(ALL).splitlines()[-1] == (
        "7 runs: 1 internal error, 1 bad input, 2 with findings, 1 cannot tell, 2 ok;"
        " findings: 2 failing, 1 missing, 1 allowed, 1 waived"
    )


def repetitions(name, count, *events, **more):
    status = Status.FINDINGS if events else Status.OK
    return [
        Verdict(Path(f"runs/{name}-{each}.npz"), status, "general", events, **more)
        for each in range(count)
    ]


def test_repetitions_are_one_row_and_failures_come_first():
    later = replace(BLOW, start=1.2, score=0.7)
    pick = repetitions("pick", 3, BLOW)
    pick += [replace(pick[0], path=Path("runs/pick-3.npz"), events=(later, RATTLE))]
    note = "At 500 Hz, oscillations above 220 Hz cannot be seen."
    lines = text([*repetitions("reach", 5, message=note), SLOW, *pick]).splitlines()
    assert lines == [
        "runs/pick    FAIL            1.00 -   1.50 s   impact         4 of 4 runs",
        "                             2.00 -   3.00 s   oscillations   out of distribution,"
        " 1 of 4 runs",
        "slow.npz     cannot tell   30 Hz is below every model",
        "runs/reach   ok            5 runs",
        f"note:    {note} (5 of 10 runs)",
        "next:    inspector view runs/pick-3.npz",
        "10 runs: 4 with findings, 1 cannot tell, 5 ok; findings: 5 failing",
    ]
    rows = [each for each in markdown(pick).splitlines() if each.startswith("| `")]
    assert len(rows) == 1
    assert rows[0].startswith("| `runs/pick` | FAIL | impact from 1.00 s to 1.50 s, 4 of 4 runs;")
    error, *_ = github(pick).splitlines()
    assert error.startswith("::error file=runs/pick-3.npz,title=runs/pick::findings: impact from")
    assert junit(pick).count("<testcase ") == 4


def test_findings_of_repetitions_are_apart_by_class_joint_octave_time_and_ruling():
    known = [
        Evidence("repetitions", 9.0, 1.1, "a", "velocity", (8 * k, 16 * k)) for k in (1.0, 2.0)
    ]
    blow, high = (replace(BLOW, evidence=each) for each in known)
    elsewhere = replace(blow, evidence=replace(known[0], joint="b"))
    one = repetitions("a", 2, blow)
    assert text(one).count("2 of 2 runs") == 1
    for event in (replace(blow, start=1.3), replace(blow, label="louder"), high, elsewhere):
        pair = [one[0], replace(one[1], events=(event,))]
        assert text(pair).count("1 of 2 runs") == 2
    ruled = replace(one[1], events=(replace(blow, ruling=Ruling.EXPIRED, reason="never"),))
    assert text([one[0], ruled]).count("1 of 2 runs") == 2
    twice = replace(one[0], events=(blow, replace(blow, start=1.1)))
    assert text([twice, one[1]]).count("impact") == 2


def test_runs_that_name_a_scenario_are_of_it_in_each_folder():
    runs = [
        Verdict(Path(f"{folder}/{name}.npz"), Status.OK, scenario="walk")
        for folder in ("a", "b")
        for name in ("one", "two")
    ]
    assert [line.split() for line in text(runs).splitlines()[:2]] == [
        ["walk", "ok", "2", "runs"]
    ] * 2
    assert "run:     a/one.npz [no model]" in text(runs, verbose=True).splitlines()


def test_json_is_noise_verdict_3():
    verdicts = json.loads(as_json([LOUD, SLOW]))
    assert verdicts["format"] == "noise-verdict/3"
    assert verdicts["exit_status"] == 1
    assert verdicts["counts"]["runs"]["findings"] == 1
    loud, slow = verdicts["runs"]
    assert loud["events"][1] == {
        "label": "oscillations", "start": 2.0, "stop": 3.0, "score": 0.8, "novel": True,
        "order": None, "fails": True, "ruling": "found", "reason": "",
        "evidence": asdict(Evidence("general")),
    }  # fmt: skip
    assert loud["events"][0]["novel"] is False
    assert (loud["run"], loud["status"], loud["unknown"]) == ("loud.npz", "findings", "finding")
    assert (loud["model"], loud["model_sha256"]) == ("general", "1f2e")
    assert (slow["status"], slow["events"]) == ("cannot-tell", [])
    assert slow["message"] == "30 Hz is below every model"
    expected, lacking = json.loads(as_json([EXPECTED, LACKING]))["runs"]
    blow = expected["events"][0]
    assert (blow["fails"], blow["ruling"], blow["reason"]) == (False, "allowed", "the pick")
    assert lacking["expectations"] == "expect.toml"
    missing = {"label": "impact", "start": 1.1, "stop": 1.3, "reason": "the pick"}
    assert lacking["missing"] == [missing]


def test_json_fits_its_published_schema():
    jsonschema = pytest.importorskip("jsonschema", reason="needs jsonschema")
    schema = json.loads(SCHEMA.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    events = (replace(BLOW, localisation=LOCATED),)
    localised = replace(LOUD, events=events, picture=Path("report/pictures/loud.png"))
    written = json.loads(as_json([*ALL, localised, replace(BROKEN, ignored=True)]))
    jsonschema.Draft202012Validator(schema).validate(written)
    assert set(schema["$defs"]["run"]["required"]) == set(written["runs"][0])
    assert set(schema["$defs"]["event"]["required"]) == set(written["runs"][1]["events"][0])
    written["runs"][1]["events"][0]["ruling"] = "forgiven"
    with pytest.raises(jsonschema.ValidationError, match="'forgiven' is not one of"):
        jsonschema.Draft202012Validator(schema).validate(written)


def test_json_has_the_localisation_of_findings_that_were_localised():
    events = (replace(BLOW, localisation=LOCATED), replace(RATTLE, localisation=Localisation()))
    localised = replace(LOUD, events=events)
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
    assert [suite.get(key) for key in ("tests", "failures", "errors", "skipped")] == list("4111")
    failure = suite.find("testcase[@name='loud.npz']/failure")
    both = "impact from 1.00 s to 1.50 s; oscillations from 2.00 s to 3.00 s, out of distribution"
    assert failure.get("message") == both
    assert failure.get("type") == "impact"  # of the best score
    assert "oscillations from 2.00 s to 3.00 s, out of distribution" in failure.text


@pytest.mark.parametrize("write", FORMATS.values(), ids=FORMATS)
@pytest.mark.parametrize("verdict", [QUIET, LOUD])
def test_ignored_unknown_frames_are_stated_in_every_format(write, verdict):
    ignoring = replace(verdict, unknown=Unknown.IGNORE, message="Unknown frames are ignored.")
    assert "ignore" in write([ignoring])
    assert "ignore" not in write([verdict])
    assert isinstance(write([]), str)


def test_junit_has_one_case_with_time_type_and_picture_for_each_run():
    slow = replace(SLOW, seconds=0.25, picture=Path("report/pictures/slow.png"))
    suite = ET.fromstring(junit([slow, BUG, EXPECTED, LACKING])).find("testsuite")
    cases = {case.get("name"): case for case in suite.iter("testcase")}
    assert cases["slow.npz"].get("time") == "0.250"
    lines = cases["slow.npz"].find("system-out").text.splitlines()
    assert "[[ATTACHMENT|report/pictures/slow.png]]" in lines
    assert cases["odd.npz"].find("error").get("type") == "internal-error"
    assert "Traceback" in cases["odd.npz"].find("error").text
    assert cases["lacking.npz"].find("failure").get("type") == "missing"
    assert cases["expected.npz"].find("failure") is None
    assert "allowed: the pick" in cases["expected.npz"].find("system-out").text
    numbers = {each.get("name"): each.get("value") for each in suite.iter("property")}
    assert (numbers["runs.internal-error"], numbers["findings.waived"]) == ("1", "1")


def test_names_and_texts_are_kept_apart_and_escaped_and_what_is_ignored_is_a_warning():
    odd = Verdict(Path("a\x00b\x1b.npz"), Status.BAD_INPUT, message="x\x07y")
    cases = ET.fromstring(junit([odd, LOUD, LOUD])).iter("testcase")
    assert [case.get("name") for case in cases] == ["ab.npz", "loud.npz", "loud.npz (2)"]
    line = github([BROKEN])
    assert line == "::error file=broken%2C1.npz::bad-input: not a run file: 100%25%0Abad"
    ignored = [replace(BROKEN, ignored=True)]
    skipped = ET.fromstring(junit(ignored)).find(".//skipped")
    assert skipped.get("message") == "not a run file: 100%\nbad"
    assert github(ignored).startswith("::warning file=broken")
    odd = replace(LACKING, path=Path("a|b`c<i>.npz"), missing=(Missing("x|y<b>"),))
    row = next(line for line in markdown([odd]).splitlines() if line.startswith("| `"))
    assert row == "| `a\\|b'c<i>.npz` | FAIL | missing: x\\|y&lt;b> |"


def test_github_gets_the_ten_worst_and_then_a_summary():
    worst = replace(LOUD, path=Path("worst.npz"), missing=LACKING.missing)
    lacking = [replace(LACKING, path=Path(f"{each}/lacking.npz")) for each in range(5)]
    loud = [replace(LOUD, path=Path(f"{each}/loud.npz")) for each in range(19)]
    lines = github([*lacking, *loud, worst, SLOW]).splitlines()
    errors = [line for line in lines if line.startswith("::error")]
    assert len(errors) == ANNOTATIONS
    assert errors[0].startswith("::error file=worst.npz")
    assert all("loud.npz" in error for error in errors[1:])
    assert sum(line.startswith("::warning") for line in lines) == 1
    assert lines[-1].startswith("::notice title=noise-inspector::26 runs: 25 with findings")
    assert lines[-1].endswith("; 15 more are not shown here")


def test_bad_input_hides_no_finding_from_github():
    many = [
        replace(each, path=Path(f"{place}/{each.path}"))
        for each in (BROKEN, LOUD)
        for place in range(20)
    ]
    errors = [line for line in github(many).splitlines() if "error" in line]
    assert sum("broken" in line for line in errors) == ANNOTATIONS // 2
    assert sum("loud" in line for line in errors) == ANNOTATIONS // 2


def test_sarif_has_a_result_for_each_finding_that_fails_its_run():
    log = json.loads(sarif(ALL))
    assert log["version"] == "2.1.0"
    (run,) = log["runs"]
    results = run["results"]
    rules = ["impact", "oscillations", "missing-impact"]
    assert [each["ruleId"] for each in results] == rules
    assert [rule["id"] for rule in run["tool"]["driver"]["rules"]] == rules
    for result in results:
        assert result["message"]["text"]
        (location,) = result["locations"]
        place = location["physicalLocation"]
        assert place["artifactLocation"]["uri"] in ("loud.npz", "lacking.npz")
        assert place["region"]["startLine"] == 1
    prints = {each["partialFingerprints"]["primaryLocationLineHash"] for each in results}
    assert len(prints) == len(results)
    (invocation,) = run["invocations"]
    assert (invocation["executionSuccessful"], invocation["exitCode"]) == (False, 70)
    notes = [each["message"]["text"] for each in invocation["toolExecutionNotifications"]]
    assert [note.split(":")[0] for note in notes] == ["internal-error", "bad-input", "cannot-tell"]
    assert run["properties"]["counts"]["findings"]["allowed"] == 1


def test_sarif_names_files_by_addresses_and_keeps_fingerprints_when_findings_move():
    odd = replace(LOUD, path=Path("a folder/50%.npz"))
    far = replace(LOUD, path=Path("/elsewhere/run.npz"))
    moved = replace(far, events=(replace(BLOW, start=1.01), RATTLE))
    first, *_, last = json.loads(sarif([odd, far]))["runs"][0]["results"]
    places = [
        each["locations"][0]["physicalLocation"]["artifactLocation"] for each in (first, last)
    ]
    assert [place["uri"] for place in places] == [
        "a%20folder/50%25.npz", "file:///elsewhere/run.npz",
    ]  # fmt: skip
    before, after = (json.loads(sarif([e]))["runs"][0]["results"][0] for e in (far, moved))
    assert before["partialFingerprints"] == after["partialFingerprints"]
    missing = tuple(Missing(f"log of {name}") for name in ("pick", "place"))
    absent = replace(LACKING, missing=missing)
    results = json.loads(sarif([absent]))["runs"][0]["results"]
    prints = [each["partialFingerprints"]["primaryLocationLineHash"] for each in results]
    assert len(prints) == len(set(prints)) == 2


def test_markdown_is_a_table_with_the_worst_first_and_one_picture():
    drawn = replace(LOUD, picture=Path("r/pictures/loud.png"))
    lines = markdown([QUIET, LACKING, drawn, EXPECTED]).splitlines()
    assert lines[0] == MARKER
    assert lines[1].startswith("### Noise: 4 runs: 2 with findings, 2 ok")
    rows = [line for line in lines if line.startswith("| `")]
    assert [row.split("`")[1] for row in rows] == ["loud.npz", "lacking.npz"]
    assert sum(line.startswith("Picture of") for line in lines) == 1
    assert "Picture of `loud.npz`: `r/pictures/loud.png`." in lines
    assert any("(allowed: the pick)" in line for line in lines)


def test_markdown_fits_into_a_comment():
    many = [replace(LOUD, path=Path(f"{'deep/' * 20}{place}.npz")) for place in range(2000)]
    written = markdown(many + [replace(EXPECTED, path=each.path) for each in many])
    assert len(written) < COMMENT
    assert re.search(r"^\d+ more are left out here\.$", written, re.MULTILINE)


def test_scenarios_without_logs_are_told_alike_in_every_format():
    store, why = Path("reference/reference.toml"), {"pick": "no log; it had 3", "place": "1 of 2"}
    missing = tuple(Missing(f"log of {name}", reason=reason) for name, reason in why.items())
    lacking = replace(LACKING, path=store, missing=missing, expectations=str(store))
    for write in (text, junit, github, sarif, markdown, index_page):
        written = write([lacking])
        for name, reason in why.items():
            assert name in written
            assert reason in written
            assert f"missing: log of {name} (" not in written
