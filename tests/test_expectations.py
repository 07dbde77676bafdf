from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from inspector.analysis.status import Status
from inspector.expectations.expectations import (
    ExpectationError,
    Expectations,
    classes_found,
    found_for,
    read,
)
from inspector.expectations.first import first
from inspector.expectations.judge import Gate, judge
from inspector.library import load_library
from inspector.localisation.localise import Localisation
from inspector.verdict import Missing, Ruled, Ruling, Verdict
from noiseclassifier import Event

TODAY = date(2026, 6, 1)
BLOW, RATTLE = Event("impact", 1.2, 1.4, 0.9), Event("oscillations", 2.0, 3.0, 0.7)
RUN = Verdict(
    Path("pick.npz"), Status.FINDINGS, "general", (BLOW, RATTLE), scenario="pick", duration=10.0
)
LIBRARY = load_library()


def written(path, text):
    path.write_text(text)
    return path


def expected(folder, text):
    return read(written(folder / "expect.toml", text))


def ruled(folder, text, verdict=RUN, **options):
    """What became of each finding of a run, by class."""
    run = replace(verdict, path=folder / verdict.path)
    judged = judge(run, expected(folder, text), today=TODAY, **options)
    return judged, {event.label: str(judged.ruled(event).ruling) for event in judged.events}


def test_a_run_without_expectations_keeps_its_verdict():
    assert judge(RUN, today=TODAY) == RUN


def test_a_run_is_ok_if_all_of_its_findings_are_allowed(tmp_path):
    judged, rulings = ruled(tmp_path, '[[allow]]\nreason = "contact"')
    assert judged.status is Status.OK
    assert rulings == {"impact": "allowed", "oscillations": "allowed"}
    assert judged.ruled(BLOW) == Ruled(Ruling.ALLOWED, "contact")
    assert judged.failing == ()
    assert judged.expectations == str(tmp_path / "expect.toml")


def test_a_finding_that_no_entry_is_about_fails_its_run_unless_others_are_allowed(tmp_path):
    allow = '[[allow]]\nclass = "impact"'
    judged, rulings = ruled(tmp_path, allow)
    assert judged.status is Status.FINDINGS
    assert rulings == {"impact": "allowed", "oscillations": "found"}
    judged, _ = ruled(tmp_path, f'others = "allow"\n{allow}')
    assert judged.status is Status.OK


def test_forbidden_findings_fail_whatever_is_allowed(tmp_path):
    text = 'others = "allow"\n[[allow]]\n[[forbid]]\nclass = "impact"\nreason = "brittle"'
    judged, rulings = ruled(tmp_path, text)
    assert judged.status is Status.FINDINGS
    assert rulings == {"impact": "forbidden", "oscillations": "allowed"}


REQUIRED = (
    '[[allow]]\nclass = "oscillations"\n[[require]]\nclass = "impact"\nat = {}\ntolerance = 0.1'
)


def test_a_required_finding_within_its_tolerance_passes(tmp_path):
    judged, rulings = ruled(tmp_path, REQUIRED.format(1.25))
    assert (judged.status, judged.missing) == (Status.OK, ())
    assert rulings["impact"] == "required"


def test_a_required_finding_that_is_missing_is_a_finding(tmp_path):
    judged, rulings = ruled(tmp_path, REQUIRED.format(1.5))
    assert judged.status is Status.FINDINGS
    assert judged.missing == (Missing("impact", 1.4, 1.6),)
    assert rulings["impact"] == "found"
    quiet = replace(RUN, status=Status.OK, events=())
    judged, _ = ruled(tmp_path, REQUIRED.format(1.2), quiet)
    assert judged.status is Status.FINDINGS


def test_nothing_is_missing_from_a_run_that_cannot_be_told(tmp_path):
    blind = replace(RUN, status=Status.CANNOT_TELL, events=())
    judged, _ = ruled(tmp_path, REQUIRED.format(1.2), blind)
    assert (judged.status, judged.missing) == (Status.CANNOT_TELL, ())


WAIVED = """
[[allow]]
class = "impact"
[[waive]]
class = "oscillations"
reason = "ticket 1"
until = {}
"""


def test_a_waiver_holds_through_its_last_day(tmp_path):
    judged, rulings = ruled(tmp_path, WAIVED.format("2026-06-01"))
    assert judged.status is Status.OK
    assert rulings["oscillations"] == "waived"


def test_an_expired_waiver_is_remarked_on_and_excuses_nothing(tmp_path):
    judged, rulings = ruled(tmp_path, WAIVED.format("2026-05-31"))
    assert judged.status is Status.FINDINGS
    assert rulings["oscillations"] == "waiver-expired"
    (remark,) = read(tmp_path / "expect.toml").remarks(TODAY)
    assert remark == (
        f"{tmp_path}/expect.toml: [[waive]] 1 expired on 2026-05-31 (ticket 1);"
        " its findings count again: fix them, or move `until`"
    )


def test_what_is_allowed_stays_allowed_when_a_waiver_expires(tmp_path):
    _, rulings = ruled(tmp_path, WAIVED.format("2026-05-31") + "\n[[allow]]")
    assert rulings["oscillations"] == "allowed"


@pytest.mark.parametrize(
    ("budget", "status", "reason"),
    [
        ("findings = 2", Status.OK, ""),
        ("findings = 1", Status.FINDINGS, "2 findings, at most 1"),
        ("percent = 12", Status.OK, ""),  # 1.2 s of 10 s
        ("percent = 11", Status.FINDINGS, "12.0 % of the time, at most 11 %"),
    ],
)
def test_a_budget_holds_for_all_findings_together(tmp_path, budget, status, reason):
    judged, _ = ruled(tmp_path, f"[[budget]]\n{budget}")
    assert judged.status is status
    assert judged.ruled(BLOW).reason == reason
    assert {judged.ruled(event).ruling.fails for event in RUN.events} == {bool(reason)}


@pytest.mark.parametrize(
    ("selector", "matches"),
    [
        ('runs = "pick.npz"', True),
        ('runs = "*.npz"', True),
        ('runs = ["other.npz", "p*"]', True),
        ('runs = "arm/pick.npz"', False),
        ('scenario = "pi*"', True),
        ("scenario = 7", False),
        ('class = ["oscillations", "impact"]', True),
        ('class = "highaccelerations"', False),
        ("time = [1.0, 3.0]", True),
        ("time = [1.3, 3.0]", False),  # the impact begins before
        ("at = 1.0", True),  # within 0.2 s
        ("at = 1.45", False),
    ],
)
def test_an_entry_is_about_the_findings_that_it_selects(tmp_path, selector, matches):
    judged, _ = ruled(tmp_path, f"[[allow]]\n{selector}", replace(RUN, events=(BLOW,)))
    assert (judged.status is Status.OK) is matches


def test_a_forbidden_time_is_one_that_findings_touch(tmp_path):
    _, rulings = ruled(tmp_path, 'others = "allow"\n[[forbid]]\ntime = [2.9, 5.0]')
    assert rulings == {"impact": "allowed", "oscillations": "forbidden"}


def test_joints_are_those_with_the_largest_share(tmp_path):
    joints = (("left_knee", 0.6), ("right_knee", 0.4))
    run = replace(
        RUN, localisations={BLOW: Localisation("a", "b", joints=joints), RATTLE: Localisation()}
    )
    judged, rulings = ruled(tmp_path, '[[allow]]\njoints = "left_*"', run)
    assert rulings == {"impact": "allowed", "oscillations": "found"}
    reason = "its joints are not known, which [[allow]] 1 names"
    assert judged.ruled(RATTLE).reason == reason
    _, rulings = ruled(tmp_path, '[[allow]]\njoints = "right_*"', run)
    assert rulings["impact"] == "found"


@pytest.mark.parametrize(
    ("gate", "fails"),
    [
        (Gate(), {"impact", "oscillations"}),
        (Gate(classes=("impact",)), {"impact"}),
        (Gate(min_score=0.8), {"impact"}),
        (Gate(min_duration=0.5), {"oscillations"}),
        (Gate(min_score=0.95), set()),
    ],
)
def test_a_gate_names_the_findings_that_fail_a_run(gate, fails):
    judged = judge(RUN, gate=gate, today=TODAY)
    assert {event.label for event in judged.failing} == fails
    assert judged.status is (Status.FINDINGS if fails else Status.OK)


def test_a_gate_without_a_score_lets_negative_scores_fail_a_run():
    run = replace(RUN, events=(replace(BLOW, score=-0.5),))
    assert judge(run, gate=Gate(), today=TODAY).status is Status.FINDINGS


def test_a_gate_says_why_a_finding_does_not_fail():
    judged = judge(RUN, gate=Gate(min_score=0.8), today=TODAY)
    ruled = judged.ruled(RATTLE)
    assert str(ruled) == "filtered: score 0.70 below 0.8 (--min-score)"


def test_a_gate_lets_no_required_finding_be_missing(tmp_path):
    judged, rulings = ruled(tmp_path, REQUIRED.format(1.2), gate=Gate(min_score=0.99))
    assert (judged.status, rulings["impact"]) == (Status.OK, "required")
    judged, _ = ruled(tmp_path, REQUIRED.format(9.0), gate=Gate(min_score=0.99))
    assert judged.status is Status.FINDINGS


def test_bad_input_stays_bad_input(tmp_path):
    bad = Verdict(Path("bad.npz"), Status.BAD_INPUT, message="empty")
    judged, _ = ruled(tmp_path, REQUIRED.format(1.2), bad)
    assert (judged.status, judged.missing) == (Status.BAD_INPUT, ())


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[[allow]", "no TOML"),
        ('format = "noise-expect/9"', "of format 'noise-expect/9', expected 'noise-expect/1'"),
        ('others = "warn"', "others = 'warn', expected"),
        ("[[alow]]", "the file: no 'alow'; there are format, others, waive, require"),
        ("[allow]\nclass = 'impact'", r"allow: expected entries that begin with \[\[allow\]\]"),
        ("[[allow]]\n[[allow]]\nclas = 'impact'", r"\[\[allow\]\] 2: no 'clas'; there are class"),
        ("[[require]]\nat = 1.0", r"\[\[require\]\] 1: needs 'class'"),
        ("[[waive]]\nreason = 'x'", r"\[\[waive\]\] 1: needs 'until'"),
        ("[[waive]]\nuntil = 2026-01-01", r"\[\[waive\]\] 1: needs 'reason'"),
        ("[[waive]]\nreason = 'x'\nuntil = '2026-01-01'", "expected a date without quotes"),
        ("[[budget]]", r"\[\[budget\]\] 1: needs 'findings' or 'percent'"),
        ("[[budget]]\nfindings = 1.5", "findings = 1.5, expected a whole number of 0 or more"),
        ("[[budget]]\npercent = -1", "percent = -1, expected a number from 0 to 100"),
        ("[[budget]]\npercent = 200", "percent = 200, expected a number from 0 to 100"),
        ("[[budget]]\npercent = nan", "percent = nan, expected a number from 0 to 100"),
        ("[[budget]]\nfindings = -1", "findings = -1, expected a whole number of 0 or more"),
        ("[[allow]]\nclass = []", r"1: class = \[\], expected one at least, or no 'class'"),
        ("[[allow]]\nruns = []", r"1: runs = \[\], expected one at least"),
        ("[[forbid]]\njoints = []", r"1: joints = \[\], expected one at least"),
        ("[[allow]]\nscenario = []", r"1: scenario = \[\], expected one at least"),
        ("[[allow]]\nat = 'now'", "at = 'now', expected a number"),
        ("[[allow]]\nat = 2027-01-31T10:00:00", "at = 2027-01-31 10:00:00, expected a number"),
        ("[[allow]]\nruns = [2027-01-31, true]", r"runs = \[2027-01-31, true\], expected a text"),
        ("[[allow]]\nclass = {a = 07:30:00}", "class = {a = 07:30:00}, expected a text"),
        (
            "[[waive]]\nreason = 'x'\nuntil = 2027-01-31T10:00:00",
            "until = 2027-01-31 10:00:00, exp",
        ),
        ("format = 2027-01-31", "of format 2027-01-31, expected"),
        ("others = 2027-01-31", "others = 2027-01-31, expected"),
        ("[[allow]]\nat = nan", "at = nan, expected a number"),
        ("[[allow]]\ntolerance = 0.1", "a tolerance without 'at'"),
        ("[[allow]]\ntime = [2, 1]", r"time = \[2, 1\], expected \[from, to\] in seconds"),
        ("[[allow]]\njoints = [1]", r"joints = \[1\], expected a text or a list of them"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, text, problem):
    with pytest.raises(ExpectationError, match=problem) as error:
        expected(tmp_path, text)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"{tmp_path}/expect.toml: ")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ExpectationError, match=r"none.toml: cannot be read \(No such file"):
        read(tmp_path / "none.toml")


def test_a_class_that_no_model_has_is_refused_with_those_that_there_are(tmp_path):
    found = expected(tmp_path, '[[allow]]\nclass = ["impact", "impacts"]')
    known = "impact, highaccelerations, oscillations, unknown"
    with pytest.raises(ExpectationError, match=rf"no model has the class 'impacts'; .* {known}"):
        found.check_classes(LIBRARY)
    expected(tmp_path, '[[allow]]\nclass = ["impact", "unknown"]').check_classes(LIBRARY)
    assert "ok" not in classes_found(LIBRARY)


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("high accelerations", "highaccelerations"),
        ("High accelerations", "highaccelerations"),
        ("impacts", "impact"),
        ("oscillation", "oscillations"),
    ],
)
def test_the_class_that_is_meant_is_suggested(tmp_path, name, meant):
    found = expected(tmp_path, f'[[allow]]\nclass = "{name}"')
    with pytest.raises(ExpectationError, match=rf"\(did you mean '{meant}'\?\)$"):
        found.check_classes(LIBRARY)


def test_the_nearest_file_counts_up_to_the_top_of_a_repository(tmp_path):
    deep = tmp_path / "repository" / "runs" / "arm"
    deep.mkdir(parents=True)
    written(tmp_path / "expect.toml", "")
    run = deep / "run.npz"
    assert found_for([run])[run].path == tmp_path / "expect.toml"
    (tmp_path / "repository" / ".git").mkdir()
    assert found_for([run]) == {}
    written(tmp_path / "repository" / "expect.toml", "")
    assert found_for([run])[run].path == tmp_path / "repository" / "expect.toml"
    written(deep / "expect.toml", "")
    assert found_for([run])[run].path == deep / "expect.toml"


def test_patterns_of_runs_are_relative_to_the_folder_of_the_file(tmp_path):
    text = '[[allow]]\nruns = "arm/*.npz"'
    found = expected(tmp_path, text)
    assert len(found.of(tmp_path / "arm" / "a.npz", "")) == 1
    assert found.of(tmp_path / "leg" / "a.npz", "") == ()


def test_a_run_that_is_a_link_has_the_name_of_the_link(tmp_path):
    (tmp_path / "elsewhere.npz").touch()
    (tmp_path / "runs").mkdir()
    link = tmp_path / "runs" / "pick.npz"
    link.symlink_to(tmp_path / "elsewhere.npz")
    found = read(written(tmp_path / "runs" / "expect.toml", '[[allow]]\nruns = "pick.npz"'))
    assert len(found.of(link, "")) == 1


def test_a_first_file_makes_its_own_runs_pass(tmp_path):
    odd = replace(RUN, path=tmp_path / 'a "b" [c].npz')
    for required in (False, True):
        text = first([odd], tmp_path, required=required, today=TODAY)
        judged = judge(odd, expected(tmp_path, text), today=TODAY)
        assert judged.status is Status.OK
        kind = Ruling.REQUIRED if required else Ruling.ALLOWED
        assert {judged.ruled(event).ruling for event in odd.events} == {kind}
    later = replace(odd, events=(replace(BLOW, start=2.0, stop=2.2),))
    assert judge(later, expected(tmp_path, text), today=TODAY).status is Status.FINDINGS


def test_the_examples_in_a_first_file_are_valid(tmp_path):
    text = first([], tmp_path, required=False, today=TODAY)
    examples = text[text.index("# [[require]]") :]
    found = expected(
        tmp_path,
        "\n".join(line.removeprefix("# ") for line in examples.splitlines() if line != "#"),
    )
    assert [entry.kind for entry in found.entries] == ["waive", "require", "forbid", "budget"]
    assert isinstance(found, Expectations)
    found.check_classes(LIBRARY)
