"""Settings of a project, results of several jobs, and results over commits."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commandline import call, complaint, printed, refused
from wholeverdict import WHOLE

from inspector.errors import InspectorError, Status
from inspector.library import demo_run
from inspector.localisation import Localisation
from inspector.report import html
from inspector.report.formats import FORMATS, as_json
from inspector.verdict import Beside, Finding, Missing, Verdict, read_results


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A repository; the working folder is one below its top."""
    top = tmp_path / "project"
    for folder in (top / ".git", top / "sub"):
        folder.mkdir(parents=True)
    monkeypatch.chdir(top / "sub")
    time = np.arange(400) / 100
    rows = "".join(f"{each:g},{np.sin(each):g}\n" for each in time)
    (top / "log.csv").write_text(f"time,elbow\n{rows}")
    return top


def test_settings_hold_for_commands_and_the_command_line_wins(project):
    assert call("audit", "../log.csv")[0] == 3  # which signal is elbow?
    (project / "inspector.toml").write_text(
        'map = ["velocity.elbow=elbow"]\nrate = 90.0\n'
        '[audit]\nformat = "json"\n'
        '[classify]\nruns = "log.csv"\nmin-duration = 0.5\nfail-on-class = "impact"\n'
    )
    _, out, err = call("audit", "../log.csv")
    assert json.loads(out), err
    assert "  rate " not in call("audit", "../log.csv", "--format", "text")[1]
    _, out, err = call("classify")
    assert "/log.csv   " in out
    assert "elbow" in err


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('robto = "ur5e"', "no setting 'robto' (did you mean 'robot'?)"),
        ("[audit]\nfrmat = 1", "[audit] no setting 'frmat' (did you mean 'format'?)"),
        ("[audits]\nformat = 1", "no command 'audits'"),
        ('[view]\noutput = "~/.bashrc"', "[view] no setting 'output'"),
        ("robot =", "cannot be read (Invalid value"),
    ],
)
def test_settings_that_are_not_known_are_one_line(project, text, problem):
    (project / "inspector.toml").write_text(text)
    err = refused("view" if "[view]" in text else "audit", "../log.csv", status=2)
    assert err.startswith(f"inspector: {project}/inspector.toml:")
    assert problem in err


def test_settings_beyond_the_repository_do_not_hold_and_of_a_wrong_type_are_wrong_usage(project):
    (project.parent / "inspector.toml").write_text("robto = 1")
    status, _, err = call("audit", "../log.csv")
    assert (status, "setting" in err) == (3, False)
    (project / "inspector.toml").write_text('rate = "fast"')
    assert "Invalid value for '--rate'" in complaint("audit", "../log.csv", status=2)


def results(path, *verdicts):
    path.write_text(as_json(verdicts))
    return path


def test_results_of_jobs_are_joined_into_one_table_page_and_exit_status(tmp_path):
    call("classify", demo_run(), "--no-reference", "--write", f"json={tmp_path / 'a.json'}",
         "--report", tmp_path / "first")  # fmt: skip
    quiet = [Verdict(Path(f"reach-{each}.npz"), Status.OK, "general") for each in range(3)]
    results(tmp_path / "b.json", *quiet)
    page = tmp_path / "page"
    out = printed("merge", tmp_path / "a.json", tmp_path / "b.json", "--report", page, status=1)
    first, second, *_, last = out.splitlines()
    assert first.startswith(f"{demo_run()}   FAIL   ")
    assert second.split() == ["reach", "ok", "3", "runs"]
    assert last == "4 runs: 1 with findings, 3 ok; findings: 1 failing"
    (picture,) = (page / "pictures").iterdir()
    assert f"pictures/{picture.name}" in (page / "index.html").read_text()
    assert call("merge", tmp_path / "b.json", "--format", "json")[0] == 0
    before = json.loads((tmp_path / "a.json").read_text())["runs"]
    assert json.loads(call("merge", tmp_path / "a.json", "--format", "json")[1])["runs"] == before
    output = ("--write", f"json={tmp_path / 'b.json'}", "--overwrite")
    assert "is read, too" in complaint("merge", tmp_path / "b.json", *output)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("{", "no results of classify"),
        ('{"format": "noise-verdict/2", "runs": []}', "of format 'noise-verdict/2', expected"),
        ("[]", "of format None, expected"),
        (
            '{"format": "noise-verdict/3", "version": "0.1", "runs": [{}]}',
            "by version 0.1, this is",
        ),
    ],
)
def test_what_is_no_result_is_one_line(tmp_path, content, problem):
    (tmp_path / "a.json").write_text(content)
    err = refused("merge", tmp_path / "a.json")
    assert err.startswith(f"inspector: {tmp_path}/a.json: ")
    assert problem in err
    (tmp_path / "a.json").unlink()
    no_results = f"inspector: {tmp_path}: no result of `classify --write json=FILE`\n"
    assert call("history", tmp_path) == (3, "", no_results)


def test_whatever_stands_in_a_result_is_shown_or_refused_in_one_line(tmp_path):
    whole = json.loads(as_json([WHOLE]))
    assert read_results(results(tmp_path / "a.json", WHOLE)) == [WHOLE]

    def places(value, path=()):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, each in items:
            yield (*path, key)
            if isinstance(each, (dict, list)):
                yield from places(each, (*path, key))

    refused = []
    for *above, last in places(whole["runs"]):
        for odd in (None, 0, -1.5, 10**19, True, "", "x", "\ud800", [], [1], {}, {"a": "b"}):
            changed = json.loads(json.dumps(whole))
            parent = changed["runs"]
            for key in above:
                parent = parent[key]
            parent[last] = odd
            (tmp_path / "1-a.json").write_text(json.dumps(changed))
            try:
                found = read_results(tmp_path / "1-a.json")
            except InspectorError as error:
                refused.append(str(error))
                continue
            for write in (*FORMATS.values(), html.index_page):
                assert isinstance(write(found), str)
    assert len(refused) > 500
    assert all("no results of classify" in each for each in refused)


@pytest.mark.parametrize(("least", "status"), [("no log; it had 1", 0), ("1 of 3 logs", 1)])
def test_scenarios_lack_only_what_no_job_has(tmp_path, least, status):
    store, jobs = Path("reference/reference.toml"), []
    for name, other in (("pick", "wave"), ("wave", "pick")):
        lost = (Missing(f"log of {other}", reason=least),)
        absent = Verdict(store, Status.FINDINGS, missing=lost, expectations=str(store))
        run = Verdict(Path(f"{name}-1.npz"), Status.OK, beside=Beside(str(store), (name,)))
        jobs.append(results(tmp_path / f"{name}.json", run, absent))
    found, out, _ = call("merge", *jobs)
    assert (found, "MISSING   1 of 3 logs" in out) == (status, status == 1)


def test_a_run_of_two_jobs_is_refused(tmp_path):
    one, two = (results(tmp_path / n, Verdict(Path("r"), Status.OK)) for n in ("a.json", "b.json"))
    assert refused("merge", one, two) == f"inspector: {two}: the run r is in {one}, too\n"


def test_a_history_of_200_commits_names_its_steps(tmp_path):
    noise = np.random.default_rng(0).normal(0, 0.5, (3, 200))
    pick, scan, calm = noise
    pick[60:] += 6.0
    pick[150:] -= 3.0
    scan += np.linspace(0, 8, 200)
    blow = Finding("impact", 1.0, 1.5, 0.9, localisation=Localisation(joints=(("wrist", 1.0),)))
    for commit in range(200):
        verdicts = []
        for name, value in (("pick", pick), ("scan", scan), ("calm", calm)):
            if name == "scan" and 20 <= commit < 30:
                continue  # a gap
            joints = {"elbow": float(calm[commit]), "wrist": float(value[commit])}
            beside = Beside("reference", (name,), 3, over_db=float(value[commit]), joints_db=joints)
            for number in range(2):
                run = Verdict(Path(f"{name}-{number}.npz"), Status.OK, beside=beside)
                if name == "pick" and commit >= 60:
                    run = replace(run, status=Status.FINDINGS, events=(blow,))
                verdicts.append(run)
        results(tmp_path / f"{commit}-c{commit:03d}.json", *verdicts)
    found = html.read_history(tmp_path)
    assert found.commits[:3] == ("c000", "c001", "c002")  # 10 comes after 9
    series = {(each.name, each.unit): each for each in found.series}
    (first, louder), (second, quieter) = html.changes(series["pick", "dB"])
    assert (first, second) == (60, 150)
    assert (louder, quieter) == (pytest.approx(6.0, abs=0.5), pytest.approx(-3.0, abs=0.5))
    rises = html.changes(series["scan", "dB"])  # a drift of 8 dB
    assert 1 < len(rises) < 4
    assert 4.0 < sum(by for _, by in rises) < 8.0
    assert html.changes(series["calm", "dB"]) == []
    assert [commit for commit, _ in html.changes(series["pick, wrist", "findings"])] == [60]
    assert [commit for commit, _ in html.changes(series["pick, wrist", "dB"])] == [60, 150]
    assert html.changes(series["pick, elbow", "dB"]) == []
    (tmp_path / "200-broken.json").write_text("{")
    status, out, err = call("history", tmp_path, "-o", tmp_path / "page.html")
    assert status == 3
    assert out.splitlines()[0] == "200 commits, c000 to c199"
    assert "pick: +6.0 dB at c060 (61 of 200)" in out
    assert "broken.json: no results of classify" in err
    page = (tmp_path / "page.html").read_text()
    assert page.index("<h2>scan</h2>") < page.index("<h2>calm</h2>")
    assert "at c150" in page


def test_results_that_a_rebase_replaced_are_left_out_and_told(tmp_path):
    for name, time in (("1-old", 1), ("2-old", 2), ("1-new", 3)):
        path = results(tmp_path / f"{name}.json", Verdict(Path("a.npz"), Status.OK))
        os.utime(path, (time, time))
    out = printed("history", tmp_path)
    told = ["2 commits, new to old", "1-old.json: replaced by 1-new.json"]
    assert out.splitlines()[:2] == told


def test_results_without_a_number_all_count(tmp_path):
    names = {"2024-01-05", "2024-01-06", "nightly-3f2a", "nightly-9c1b", "-3", "last"}
    for name in names:
        results(tmp_path / f"{name}.json", Verdict(Path("a.npz"), Status.OK))
    found = html.read_history(tmp_path)
    assert (found.notes, set(found.commits)) == ((), names)
