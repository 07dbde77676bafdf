"""Expectations, formats and exit statuses of `classify`, as a job runs it."""

import errno
import json
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from commandline import call

from inspector import verdict as verdicts
from inspector.analysis.status import worst
from inspector.assets import demo_run
from inspector.report.formats import FORMATS

ROOT = Path(__file__).parents[1]


@pytest.fixture
def runs(tmp_path):
    """A folder with the demo run, which has an impact, a run that is too slow, and a bad file."""
    folder = tmp_path / "runs"
    folder.mkdir()
    shutil.copy(demo_run(), folder / "demo.npz")
    time = np.arange(300) / 30
    np.savez(folder / "slow.npz", time=time, velocity=np.cos(time)[:, None])
    (folder / "broken.npz").write_text("not an archive")
    return folder


def test_what_expect_writes_makes_classify_pass(runs):
    demo = runs / "demo.npz"
    assert call("classify", demo)[0] == 1
    status, out, _ = call("expect", demo)
    assert status == 0
    assert out.splitlines() == [
        f"{runs}/expect.toml: 1 finding of 1 run allowed; edit it, then",
        f"  inspector classify {demo}",
    ]
    assert '# joints = "panda_joint' in (runs / "expect.toml").read_text()
    status, out, _ = call("classify", demo)
    assert status == 0
    head, finding = out.splitlines()[:2]
    assert head == f"{demo}   ok   4.0 s, 7 joints, 10000 Hz   by {runs}/expect.toml"
    assert finding.split()[:5] == ["1.78", "-", "1.91", "s", "impact"]
    assert call("classify", demo, "--no-expect")[0] == 1
    status, _, err = call("expect", demo)
    assert status == 3
    assert "exists already" in err


@pytest.mark.parametrize("place", ["my-expect.toml", "runs/mine.toml", "expect.toml"])
def test_what_expect_says_to_type_next_applies_its_file(runs, tmp_path, monkeypatch, place):
    monkeypatch.chdir(tmp_path)
    status, out, _ = call("expect", "runs/demo.npz", "-o", place)
    assert status == 0
    command = out.splitlines()[1].split()
    assert ("--expect" in command) is (place != "expect.toml")
    status, out, _ = call(*command[1:])
    assert status == 0
    assert out.startswith("runs/demo.npz   ok   4.0 s, 7 joints, 10000 Hz   by " + place)


def test_expect_names_a_bad_file_and_writes_the_others(runs):
    status, out, err = call("expect", runs, "--required")
    assert status == 3
    assert f"{runs}/broken.npz: not a run file" in err
    assert "1 finding of 2 runs required" in out
    assert '[[require]]\nruns = "demo.npz"' in (runs / "expect.toml").read_text()


def test_expect_writes_nothing_if_no_run_can_be_read(runs, tmp_path):
    junk = tmp_path / "junk"
    junk.mkdir()
    for name in ("a.npz", "b.csv"):
        shutil.copy(runs / "broken.npz", junk / name)
    status, out, err = call("expect", junk)
    assert (status, out) == (3, "")
    assert [line.partition(": ")[2].partition(": ")[0] for line in err.splitlines()] == [
        f"{junk}/a.npz",
        f"{junk}/b.csv",
    ]
    assert not (junk / "expect.toml").exists()


def test_expect_asks_for_a_file_if_runs_lie_in_several_folders(runs, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    status, _, err = call("expect", runs / "demo.npz", shutil.copy(demo_run(), other))
    assert status == 3
    assert "2 folders" in err
    assert "-o expect.toml" in err


def test_a_required_finding_that_is_missing_has_exit_status_1(runs, tmp_path):
    late = tmp_path / "late.toml"
    late.write_text('others = "allow"\n[[require]]\nclass = "impact"\nat = 3.0')
    status, out, _ = call("classify", runs / "demo.npz", "--expect", late)
    assert status == 1
    assert "  missing: impact from 2.80 s to 3.20 s" in out.splitlines()


@pytest.mark.parametrize("command", ["classify", "expect"])
def test_an_empty_folder_is_one_line(tmp_path, command):
    status, out, err = call(command, tmp_path)
    assert (status, out) == (3, "")
    (line,) = err.splitlines()
    assert line.startswith(f"inspector: {tmp_path}: a folder without logs (.bag, .csv, ")


def test_a_log_that_is_missing_from_a_folder_lacks_its_required_finding(runs):
    (runs / "broken.npz").unlink()
    text = 'others = "allow"\n[[require]]\nruns = "{}.npz"\nclass = "impact"'
    (runs / "expect.toml").write_text(text.format("demo"))
    assert call("classify", runs)[0] == 4  # the slow one
    (runs / "expect.toml").write_text(text.format("grasp"))
    status, out, _ = call("classify", runs)
    assert status == 1
    lines = out.splitlines()
    missing = "missing: impact (required: [[require]] 1: no run is grasp.npz)"
    assert lines[0].split(maxsplit=2) == [f"{runs}/expect.toml", "FAIL", missing]
    assert call("classify", runs, "--labels-to", runs / "labels")[0] == 1
    assert {each.name for each in (runs / "labels").iterdir()} == {"demo.txt"}
    assert call("classify", runs / "demo.npz")[0] == 0  # not the whole folder


REQUIRED = '[[allow]]\n[[require]]\nclass = "impact"\n'


def test_a_missing_log_has_its_reason_and_is_no_run(runs, tmp_path):
    (runs / "broken.npz").unlink()
    entry = '[[require]]\nruns = "{}-*.npz"\nclass = "impact"\nreason = "the {} closes"\n'
    expectations = "".join(entry.format(name, name) for name in ("pick", "grip"))
    (runs / "expect.toml").write_text(f"[[allow]]\n{expectations}")
    junit, page = tmp_path / "junit.xml", tmp_path / "report"
    written = ("--write", f"junit={junit}", "--report", page)
    status, out, _ = call("classify", runs, *written)
    assert status == 1
    told = "missing: impact (required: the {0} closes; [[require]] {1}: no run is {0}-*.npz)"
    first, second, *_, last = out.splitlines()
    assert first.split(maxsplit=2) == [f"{runs}/expect.toml", "FAIL", told.format("pick", 1)]
    assert second.strip() == told.format("grip", 2)
    assert last == (
        "2 runs: 1 cannot tell, 1 ok; no log for 2 required findings;"
        " findings: 2 missing, 1 allowed"
    )
    suite = ET.parse(junit).getroot().find("testsuite")
    assert [suite.get(each) for each in ("tests", "failures", "skipped")] == ["3", "1", "1"]
    html = (page / "index.html").read_text()
    assert "2 runs: 1 cannot tell, 1 ok; no log for 2 required findings" in html
    assert told.format("pick", 1) in html
    assert "<strong>1</strong>with findings" not in html
    counts = json.loads(call("classify", runs, "--format", "json")[1])["counts"]
    assert (sum(counts["runs"].values()), counts["findings"]["missing"]) == (2, 2)


@pytest.fixture
def arm(tmp_path, monkeypatch):
    """A folder with the demo run, in a folder of its own, from which commands are called."""
    folder = tmp_path / "runs" / "arm"
    folder.mkdir(parents=True)
    shutil.copy(demo_run(), folder / "demo.npz")
    monkeypatch.chdir(tmp_path)
    return folder


@pytest.mark.parametrize(
    ("entry", "status"),
    [
        ('runs = "grasp-*.npz"', 1),
        ('runs = "arm/grasp.npz"', 1),
        ('runs = "a*/grasp.npz"', 1),
        ('runs = "*/leg/grasp.npz"', 1),
        ('runs = ["leg/*.npz", "arm/[gp]*.npz"]', 1),
        ('scenario = "grasp"', 1),
        ('runs = "leg/grasp.npz"', 0),  # of another folder
        ('runs = "ar/*.npz"', 0),
        ('runs = "arm2/*.npz"', 0),
        ('runs = "leg*/grasp.npz"', 0),
        ('runs = "*/demo.npz"', 0),
        ('runs = "demo.npz"', 0),
    ],
)
def test_a_log_that_a_file_above_the_folder_requires_is_missing(arm, entry, status):
    Path("runs/expect.toml").write_text(REQUIRED + entry)
    assert call("classify", "runs/arm")[0] == status
    assert call("classify", "runs/arm", "--expect", "runs/expect.toml")[0] == status
    assert call("classify", "runs/arm/demo.npz")[0] == 0


def test_a_log_that_a_file_elsewhere_requires_is_missing_from_a_folder(arm):
    Path("ours.toml").write_text(REQUIRED + 'runs = "grasp.npz"')
    status, out, _ = call("classify", "runs", "--expect", "ours.toml")
    assert status == 1
    assert "  missing: impact (required: [[require]] 1: no run is grasp.npz)" in out
    Path("other").mkdir()
    Path("ours.toml").rename("other/ours.toml")
    assert call("classify", "runs", "--expect", "other/ours.toml")[0] == 1
    assert call("classify", "runs/arm/demo.npz", "--expect", "other/ours.toml")[0] == 0
    assert call("classify", "runs", "--no-expect")[0] == 1  # the finding of the demo
    Path("other/ours.toml").write_text(REQUIRED + 'runs = "demo.npz"')
    assert call("classify", "runs", "--expect", "other/ours.toml")[0] == 0


def test_a_log_is_missing_where_all_that_are_there_have_a_nearer_file(arm):
    Path("runs/expect.toml").write_text(REQUIRED + 'runs = "grasp.npz"')
    (arm / "expect.toml").write_text("[[allow]]")
    assert call("classify", "runs/arm")[0] == 0
    status, out, _ = call("classify", "runs")
    assert status == 1
    assert "no run is grasp.npz" in out


def test_a_log_that_is_a_folder_lacks_no_other_log(arm):
    bag = arm / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    (arm / "expect.toml").write_text(REQUIRED + 'runs = "grasp.npz"')
    status, out, err = call("classify", "runs/arm/bag")
    assert status == 3
    assert "runs/arm/bag: " in err
    assert "grasp" not in out


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('[[allow]]\nclass = "crash"', "[[allow]] 1: no model has the class 'crash'; there are"),
        ("[[allow]]\nwhen = 3", "[[allow]] 1: no 'when'"),
        ("allow", "no TOML"),
    ],
)
def test_wrong_expectations_are_one_line_and_exit_status_3(runs, text, problem):
    (runs / "expect.toml").write_text(text)
    status, out, err = call("classify", runs / "demo.npz")
    assert (status, out, err.count("\n")) == (3, "", 1)
    assert f"{runs}/expect.toml: {problem}" in err


def test_an_expired_waiver_is_one_line_and_its_finding_counts(runs):
    waiver = '[[waive]]\nclass = "impact"\nreason = "ticket 1"\nuntil = {}'
    (runs / "expect.toml").write_text(waiver.format("2099-01-31"))
    assert call("classify", runs / "demo.npz")[0] == 0
    (runs / "expect.toml").write_text(waiver.format("2020-01-31"))
    status, out, err = call("classify", runs / "demo.npz")
    assert status == 1
    assert "(waiver expired: 2020-01-31, ticket 1)" in out
    assert err.count("\n") == 1
    assert "[[waive]] 1 expired on 2020-01-31 (ticket 1)" in err


def test_entries_that_name_joints_are_applied(runs):
    (runs / "expect.toml").write_text('[[allow]]\njoints = "panda_joint2"')
    assert call("classify", runs / "demo.npz")[0] == 0
    (runs / "expect.toml").write_text('[[allow]]\njoints = "panda_joint7"')
    assert call("classify", runs / "demo.npz")[0] == 1


@pytest.mark.parametrize(
    ("options", "status"),
    [
        (["--fail-on-class", "oscillations"], 0),
        (["--fail-on-class", "oscillations,impact"], 1),
        (["--fail-on-class", "oscillations", "--fail-on-class", "impact"], 1),
        (["--min-score", "0.99"], 0),
        (["--min-duration", "0.5"], 0),
        (["--min-duration", "0.05"], 1),
        (["--fail-on-class", "crash"], 2),
        (["--expect", "x.toml", "--no-expect"], 2),
        (["--write", "excel=x"], 2),
        (["--write", "junit"], 2),
        (["--write", "junit=-"], 2),
        (["--write", "junit=a.out", "--write", "json=a.out"], 2),
        (["--min-score", "nan"], 2),
        (["--min-duration", "inf"], 2),
    ],
)
def test_options_name_the_findings_that_fail_a_run(runs, options, status):
    assert call("classify", runs / "demo.npz", *options)[0] == status


def test_a_run_that_is_named_twice_is_classified_once(runs):
    (runs / "link.npz").symlink_to("demo.npz")
    (runs / "loop.npz").symlink_to("loop.npz")
    assert call("classify", runs / "loop.npz", runs / "loop.npz")[0] == 3
    demo = runs / "demo.npz"
    status, out, _ = call("classify", demo, runs / "link.npz", demo, "--format", "json")
    assert status == 1
    assert [each["run"] for each in json.loads(out)["runs"]] == [str(demo)]


@pytest.mark.parametrize(
    ("output", "name"),
    [
        (["--labels-to", "runs", "--labels-format", "csv"], "demo.csv"),
        (["--write", "json=runs/demo.csv"], "demo.csv"),
    ],
)
def test_an_output_never_replaces_a_run_that_is_read(runs, monkeypatch, output, name):
    monkeypatch.chdir(runs.parent)
    log = Path("runs") / name
    log.write_text("time,elbow.velocity\n" + "".join(f"{k / 100},0\n" for k in range(300)))
    before = log.read_text()
    status, _, err = call("classify", log, *output, "--overwrite")
    assert (status, log.read_text()) == (3, before)
    assert f"inspector: {log}: is read, too; choose another name for the output\n" in err


def test_a_report_never_replaces_its_run(runs):
    demo = runs / "demo.npz"
    before = demo.read_bytes()
    status, _, err = call("export", demo, "-o", demo, "--overwrite")
    assert (status, demo.read_bytes()) == (3, before)
    assert "is read, too" in err


def test_a_class_as_reports_write_it_is_answered_with_its_name(runs):
    status, out, err = call("classify", runs / "demo.npz", "--fail-on-class", "high accelerations")
    assert (status, out) == (2, "")
    words = " ".join(err.replace("│", " ").split())  # it stands in a box
    assert "unknown (did you mean 'highaccelerations'?)" in words


def test_bad_input_is_ignored_on_request_unless_there_is_nothing_else(runs):
    ignore = ("--on-bad-input", "ignore")
    assert call("classify", runs)[0] == 3
    status, out, err = call("classify", runs, *ignore)
    assert status == 1
    assert "1 bad input" in out
    assert "broken.npz: not a run file" in err
    assert call("classify", runs / "broken.npz", runs / "slow.npz", *ignore)[0] == 4
    assert call("classify", runs / "broken.npz", *ignore)[0] == 3


@pytest.mark.parametrize("format_", FORMATS)
def test_every_format_has_the_counts_of_several_runs(runs, format_):
    _, out, _ = call("classify", runs, "--format", format_)
    if format_ == "json":
        assert json.loads(out)["counts"]["runs"] == {
            "internal-error": 0, "bad-input": 1, "findings": 1, "cannot-tell": 1, "ok": 0,
        }  # fmt: skip
    elif format_ == "sarif":
        assert json.loads(out)["runs"][0]["properties"]["counts"]["runs"]["bad-input"] == 1
    elif format_ == "junit":
        suite = ET.fromstring(out).find("testsuite")
        assert [suite.get(each) for each in ("failures", "errors", "skipped")] == ["1"] * 3
    else:
        assert "3 runs: 1 bad input, 1 with findings, 1 cannot tell" in out


def test_one_pass_writes_several_formats_and_a_page_of_all_runs(runs, tmp_path):
    report = tmp_path / "report"
    files = {name: tmp_path / f"out.{name}" for name in FORMATS}
    options = [option for name, path in files.items() for option in ("--write", f"{name}={path}")]
    everything = (*options, "--report", report, "--report-url", "https://ci.example/7/")
    status, _, _ = call("classify", runs, *everything)
    assert status == 3
    pictures = sorted((report / "pictures").glob("*.png"))
    assert [each.name.rpartition("-")[0] for each in pictures] == ["demo", "slow"]
    page = (report / "index.html").read_text()
    places = [page.index(f"{name}.npz") for name in ("broken", "demo", "slow")]
    assert places == sorted(places)
    for each in pictures:
        assert f'src="pictures/{each.name}"' in page
    assert "3 runs: 1 bad input, 1 with findings, 1 cannot tell" in page
    assert f"[[ATTACHMENT|{pictures[0]}]]" in files["junit"].read_text()
    address = f"(https://ci.example/7/pictures/{pictures[0].name})"
    assert address in files["markdown"].read_text()
    status, _, err = call("classify", runs, *everything)
    assert status == 3
    assert "exists already" in err
    assert call("classify", runs, *everything, "--overwrite")[0] == 3


def test_pictures_of_runs_of_one_name_are_two(runs, tmp_path):
    other = tmp_path / "runs" / "again"
    other.mkdir()
    shutil.copy(demo_run(), other)
    call("classify", runs / "demo.npz", other, "--report", tmp_path / "report", "-j", 2)
    assert len(list((tmp_path / "report" / "pictures").glob("demo-*.png"))) == 2


def test_names_of_runs_are_text_in_the_page(runs, tmp_path):
    odd = (runs / "demo.npz").rename(runs / "<b>&amp;.npz")
    call("classify", odd, "--report", tmp_path / "report")
    page = (tmp_path / "report" / "index.html").read_text()
    assert "<b>" not in page
    assert "&lt;b&gt;&amp;amp;.npz" in page


def test_a_bug_that_one_run_shows_has_exit_status_70_and_hides_no_finding(runs, monkeypatch):
    right = verdicts.open_source

    def wrong(source, reading):
        return right(source, reading) if source.path.stem == "demo" else {}[source.path.stem]

    monkeypatch.setattr(verdicts, "open_source", wrong)
    status, out, err = call("classify", runs)
    assert status == 70
    assert " 1.78 -   1.91 s   impact " in out
    assert "3 runs: 2 internal error, 1 with findings" in out
    assert "Traceback" in err
    assert f"inspector: {runs}/slow.npz: KeyError: 'slow'" in err


def test_a_bug_of_a_command_has_exit_status_70(monkeypatch):
    def wrong(*_):
        raise KeyError("bug")

    monkeypatch.setattr("inspector.library.load_library", wrong)
    status, _, err = call("classify", demo_run())
    assert status == 70
    assert "Traceback" in err


def test_an_output_that_is_lost_has_exit_status_5(runs, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("inspector.report.index.write", full)
    report = tmp_path / "report"
    status, out, err = call("classify", runs, "--report", report)
    assert status == 5  # worse than the bad input
    assert " 1.78 -   1.91 s   impact " in out
    assert f"inspector: output lost: {report}: cannot be written (No space left on device)" in err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_behind_standard_output_has_exit_status_5():
    command = [sys.executable, "-m", "inspector", "classify", demo_run()]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 5
    assert done.stderr.splitlines()[0] == (
        "inspector: output lost: standard output: cannot be written (No space left on device)"
    )


def test_the_worst_of_exit_statuses_is_in_a_fixed_order():
    order = [70, 5, 3, 1, 4, 0]
    for place, status in enumerate(order):
        assert worst(reversed(order[place:])) == status
    assert worst([]) == 0
