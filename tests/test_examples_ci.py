"""What teams copy into their jobs, run as far as it can be without the hosts."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from inspector.library import demo_run

ROOT = Path(__file__).parents[1]
yaml = pytest.importorskip("ruamel.yaml", reason="needs ruamel.yaml, which rosbags brings")


def read(path):
    return yaml.YAML(typ="safe").load((ROOT / path).read_text())


@pytest.fixture
def job(tmp_path):
    """A folder of a job with the demo run in `logs`; runs a script in it, with `inspector`."""
    (tmp_path / "logs").mkdir()
    (tmp_path / "bin").mkdir()
    shutil.copy(demo_run(), tmp_path / "logs")
    tool(tmp_path, "inspector", f'exec {shlex.quote(sys.executable)} -m inspector "$@"')

    def run(*command, **variables):
        path = f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}"
        code = f"{ROOT}{os.pathsep}{ROOT / 'models'}"
        env = os.environ | {"PATH": path, "PYTHONPATH": code} | variables
        return subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True)

    run.folder = tmp_path
    return run


def tool(folder, name, line):
    path = folder / "bin" / name
    path.write_text(f"#!/bin/sh\n{line}\n")
    path.chmod(0o755)


def allow(job):
    accept = ("inspector", "accept", "logs", "--reason", "the touch is wanted", "--in-ci")
    assert job(*accept).returncode == 0


def steps():
    return {step["name"]: step for step in read("action.yml")["runs"]["steps"]}


def bash(script):
    """How GitHub runs a step with `shell: bash`."""
    return "bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script


def check(job, **inputs):
    """Run the step of the action that checks; outputs by name besides."""
    (job.folder / "temp").mkdir(exist_ok=True)
    variables = {"RUNS": "logs", "REPORT": "noise-report", "NAME": "noise"}
    variables |= dict.fromkeys(("OPTIONS", "DIFF", "REFERENCE", "ACCEPT"), "")
    files = {"RUNNER_TEMP": "temp", "GITHUB_STEP_SUMMARY": "summary.md", "GITHUB_OUTPUT": "outputs"}
    (job.folder / "outputs").write_text("")
    done = job(*bash(steps()["Check"]["run"]), **(variables | inputs), **files)
    return done, (job.folder / "outputs").read_text()


def test_the_action_annotates_summarises_and_keeps_a_page(job):
    (job.folder / "summary.md").write_text("before\n")
    done, outputs = check(job)
    assert done.returncode == 1, done.stderr
    assert "::error file=logs/demo.npz::findings: impact from 1.78 s" in done.stdout
    assert "logs/demo.npz   FAIL   4.0 s, 7 joints, 10000 Hz" in done.stdout.splitlines()
    summary = (job.folder / "summary.md").read_text()
    assert summary.startswith("before\n<!-- noise-inspector noise -->\n### Noise: 1 run: 1 with")
    assert (job.folder / "noise-report" / "index.html").exists()
    status, report, begin, first, *_, end = outputs.splitlines()
    assert (status, report, begin) == ("status=1", "report=noise-report", f"findings<<{end}")
    assert first.startswith("logs/demo.npz   FAIL")
    assert json.loads((job.folder / "temp" / "noise-noise.sarif").read_text())["version"] == "2.1.0"
    # What is misspelt shows no verdict of this earlier use.
    done, outputs = check(job, OPTIONS="--fail-on-clas impact")
    assert done.returncode == 2
    assert "--fail-on-clas" in done.stderr
    assert "FAIL" not in done.stdout + outputs
    assert outputs.startswith("status=2\n")


def test_the_action_takes_names_with_spaces_and_nothing_that_is_typed_is_a_command(job):
    odd = "logs/a b's $(touch pwned) `touch pwned`; touch pwned.npz"
    (job.folder / "logs" / "demo.npz").rename(job.folder / odd)
    options = "--min-duration '0.01' --no-reference"
    done, _ = check(job, RUNS=shlex.quote(odd), OPTIONS=options, REPORT="the page", NAME="nightly")
    assert done.returncode == 1, done.stderr
    assert "touch pwned.npz   FAIL" in done.stdout
    assert (job.folder / "the page" / "index.html").exists()
    assert not (job.folder / "pwned").exists()
    for hostile in ("--help", "--model=/etc/passwd"):  # are names of runs, not options
        assert check(job, RUNS=hostile)[0].returncode == 3
    wrong = {"RUNS": "'logs"}, {"OPTIONS": "'--no-reference"}, {"NAME": "a b"}, {"NAME": "../x"}
    for inputs in wrong:
        done, outputs = check(job, **inputs)
        assert (done.returncode, outputs) == (2, "")
        assert done.stdout.startswith("::error::")


@pytest.mark.slow
def test_the_action_passes_when_all_is_expected_and_compares_with_runs_before(job):
    allow(job)
    done, _ = check(job)
    assert (done.returncode, done.stderr) == (0, "")
    assert check(job, OPTIONS="--no-reference --min-duration 0.01")[0].returncode == 1
    done, outputs = check(job, DIFF="logs")
    assert done.returncode in (0, 4), done.stderr
    assert outputs.startswith(f"status={done.returncode}\n")


def test_the_action_gives_each_input_to_a_step_and_installs_what_it_is_part_of():
    action = read("action.yml")
    text = (ROOT / "action.yml").read_text()
    used = set(re.findall(r"inputs\.(\w+)", text))
    assert used == set(action["inputs"])
    assert set(action["outputs"]) == {"status", "findings", "report"}
    assert '"$GITHUB_ACTION_PATH[report]"' in steps()["Install"]["run"]
    # What users type reaches scripts as variables only.
    assert not [step for step in steps().values() if "${{" in step.get("run", "")]


@pytest.mark.parametrize(
    ("known", "method"),
    [("", "POST repos/o/r/issues/7/comments"), ("42", "PATCH repos/o/r/issues/comments/42")],
)
def test_the_comment_of_the_action_is_made_once_and_then_replaced(job, known, method):
    tool(job.folder, "gh", f'echo "$@" >> calls; [ "$2" = --paginate ] && echo "{known}"; exit 0')
    places = {"COMMENTS": "repos/o/r/issues/7/comments", "COMMENT": "repos/o/r/issues/comments"}
    variables = {"RUNNER_TEMP": "temp", "NAME": "nightly"} | places
    (job.folder / "temp").mkdir()
    assert job(*bash(steps()["Comment"]["run"]), **variables).returncode == 0
    assert not (job.folder / "calls").exists()  # nothing to say
    (job.folder / "temp" / "noise-nightly.md").touch()
    done = job(*bash(steps()["Comment"]["run"]), **variables)
    assert done.returncode == 0, done.stderr
    asked, sent = (job.folder / "calls").read_text().splitlines()
    assert "<!-- noise-inspector nightly -->" in asked
    assert sent == f"api --method {method} --field body=@temp/noise-nightly.md --silent"


class Repository:
    """A repository whose workflow is run as GitHub runs it; ``gh`` keeps the comment in a file."""

    def __init__(self, job):
        self.job, self.folder, self.origin = job, job.folder, job.folder / "origin.git"
        self.git("init", "--quiet", "--bare", "--initial-branch=main", self.origin)
        (self.folder / "comment").mkdir()
        line = (
            'for each; do case $each in body=@*) cp "${each#body=@}" ../comment/body.md; esac; done'
        )
        tool(self.folder, "gh", line)
        work = self.checked_out()
        for path in ("examples/accept/simulate.py", "examples/ci/github.yml"):
            shutil.copy(ROOT / path, work)
        (work / "change").write_text("")
        (work / "simulate.sh").write_text(
            f'#!/bin/sh\nexec {shlex.quote(sys.executable)} simulate.py "$1" $(cat change)\n'
        )
        (work / "simulate.sh").chmod(0o755)
        self.push("main")

    def git(self, *command):
        names = ("-c", "user.name=a", "-c", "user.email=a@b")
        done = self.job("git", "-C", self.folder / "work", *names, *command)
        if not (self.folder / "work").exists():
            done = self.job("git", *command)
        assert done.returncode == 0, done.stderr
        return done.stdout

    def checked_out(self, branch=""):
        shutil.rmtree(self.folder / "work", ignore_errors=True)
        self.job("git", "clone", "--quiet", self.origin, "work")
        if branch:
            self.git("checkout", "--quiet", "-B", branch, f"origin/{branch}")
        return self.folder / "work"

    def push(self, branch):
        self.git("add", "--all")
        self.git("commit", "--quiet", "--message", branch)
        self.git("push", "--quiet", "origin", f"HEAD:refs/heads/{branch}")

    def run(self, event, branch, **inputs):
        """Run the workflow; the exit status of its first step that fails, and what was written."""
        work, temp = self.checked_out(branch), self.folder / "temp"
        temp.mkdir(exist_ok=True)
        (temp / "summary").write_text("")
        variables = {"GITHUB_REF": f"refs/heads/{branch}", "GITHUB_ACTOR": "ann"}
        variables |= {"RUNNER_TEMP": str(temp), "GITHUB_STEP_SUMMARY": str(temp / "summary")}
        known = {"inputs": inputs, "github.event_name": event, "github.repository": "o/r"}
        known |= {"github.event.pull_request.number": "7", "runner.temp": str(temp)}
        status, said = 0, ""
        jobs = read("examples/ci/github.yml")["jobs"].values()
        (chosen,) = [each for each in jobs if holds(each["if"], known, 0)]
        for step in chosen["steps"]:
            action = step.get("uses", "")
            if not action.startswith("OWNER/"):
                steps_of = [] if action else [step]
                own = known
            else:
                steps_of = read("action.yml")["runs"]["steps"]
                given = {name: filled(value, known) for name, value in step["with"].items()}
                defaults = {
                    k: v.get("default", "") for k, v in read("action.yml")["inputs"].items()
                }
                own = known | {"inputs": defaults | given}
            for each in steps_of:
                if not holds(each.get("if", "success()"), own, status):
                    continue
                if each.get("uses", "").startswith("actions/upload-artifact"):
                    kept = work / filled(each["with"]["path"], own)
                    assert (kept / "index.html").exists()
                    own[f"steps.{each['id']}.outputs.artifact-url"] = "https://host/artifact/1"
                if "run" not in each or each.get("name") == "Install":  # what is tested is there
                    continue
                env = {name: filled(value, own) for name, value in each.get("env", {}).items()}
                (temp / "outputs").write_text("")
                env |= variables | {"GITHUB_OUTPUT": str(temp / "outputs")}
                done = self.job("env", "-C", work, *bash(each["run"]), **env)
                said += done.stdout + done.stderr
                status = status or done.returncode
        return status, said, (temp / "summary").read_text()


def filled(text, known):
    """A text with the expressions in it replaced by what they stand for."""

    def value(found):
        place, _, name = found[1].partition(".")
        return str(known["inputs"].get(name, "") if place == "inputs" else known.get(found[1], ""))

    return re.sub(r"\$\{\{ *([\w.-]+) *\}\}", value, text)


def holds(condition, known, status):
    """Whether a step is run."""
    parts = condition.split(" && ")
    if "always()" not in parts and status:
        return False
    facts = [part.split() for part in parts if "()" not in part]
    return all(
        (filled(f"${{{{ {name} }}}}", known) == word.strip("'")) == (sign == "==")
        for name, sign, word in facts
    )


@pytest.mark.slow
def test_runs_are_accepted_changed_shown_and_accepted_after_review(job):
    repository = Repository(job)
    status, said, summary = repository.run("workflow_dispatch", "main", reason="first release")
    assert (status, "pick: new, 3 repetitions" in summary) == (0, True), said
    work = repository.checked_out("main")
    assert 'by = "ann"' in (work / "reference" / "reference.toml").read_text()
    assert "Accept runs: first release" in repository.git("log", "-1", "--format=%an %s")
    for change, expected in (("harmless", 0), ("chatter", 1)):
        (repository.checked_out("main") / "change").write_text(change)
        repository.push(change)
        status, said, summary = repository.run("pull_request", change)
        assert status == expected, said
    assert re.search(
        r"::error file=logs/pick-\d.npz,title=pick::findings: .*elbow.* 32-64 Hz", said
    )
    assert re.search(r"\| `pick` \| FAIL \| .*elbow.*, 32-64 Hz, \+\d+ dB over 3 rep", summary)
    comment = (repository.folder / "comment" / "body.md").read_text()
    assert comment.startswith("<!-- noise-inspector noise -->\n### Noise: 9 runs: 3 with findings")
    assert "[Page with pictures](https://host/artifact/1)" in comment
    reason = """it's "new"; $(touch pwned) `touch pwned`"""
    inputs = {"reason": reason, "options": "--only 'pick'"}
    status, said, summary = repository.run("workflow_dispatch", "chatter", **inputs)
    assert (status, "pick: 3 repetitions replace the accepted" in summary) == (0, True), said
    assert not (repository.folder / "work" / "pwned").exists()
    status, said, _ = repository.run("pull_request", "chatter")
    assert status == 0, said
    assert "9 runs: 9 ok" in (repository.folder / "comment" / "body.md").read_text()


def test_the_workflow_uses_inputs_of_the_action_and_only_accepting_writes_to_the_repository():
    workflow = read("examples/ci/github.yml")
    assert len((ROOT / "examples/ci/github.yml").read_text().splitlines()) <= 15
    assert workflow["permissions"]["contents"] == "read"
    jobs = workflow["jobs"]
    for each in jobs.values():
        (used,) = [step for step in each["steps"] if "with" in step]
        assert set(used["with"]) <= set(read("action.yml")["inputs"])
    may = {name: each.get("permissions") for name, each in jobs.items()}
    assert may == {"noise": None, "accept": {"contents": "write"}}
    known = {"inputs": {}, "github.event_name": "pull_request"}
    assert not holds(jobs["accept"]["if"], known, 0)


@pytest.mark.slow
def test_the_action_accepts_into_the_reference_that_it_compares_with(job):
    (job.folder / "logs").rename(job.folder / "arm")
    git = ("git", "-c", "user.name=a", "-c", "user.email=a@b")
    assert job(*git, "init", "--quiet", "--bare", "origin.git").returncode == 0
    assert job(*git, "init", "--quiet", ".").returncode == 0
    assert job(*git, "remote", "add", "origin", "origin.git").returncode == 0
    first = ("--reason", "first", "--in-ci", "--output", "arm/reference")
    assert job("inspector", "accept", "arm/demo.npz", *first).returncode == 0
    variables = {"GITHUB_ACTOR": "ann", "GITHUB_REF": "refs/heads/main"}
    done, _ = check(job, RUNS="arm/demo.npz", ACCEPT="again", **variables)
    assert done.returncode == 0, done.stdout + done.stderr
    shown = job(*git, "-C", "origin.git", "show", "--name-only", "--format=%s", "main").stdout
    assert shown.startswith("Accept runs: again\n\narm/reference/"), shown
    assert not (job.folder / "reference").exists()


@pytest.mark.slow
def test_the_job_for_gitlab_writes_what_it_keeps(job):
    noise = read("examples/ci/gitlab.yml")["noise"]
    install, command = noise["script"]
    assert install == 'pip install --quiet "noise-inspector[report]"'
    assert job(*bash(command)).returncode == 1
    (kept,) = noise["artifacts"]["paths"]
    assert (job.folder / kept / "index.html").exists()
    case = ET.parse(job.folder / noise["artifacts"]["reports"]["junit"]).find(".//testcase")
    (line,) = case.find("system-out").text.splitlines()
    picture = re.fullmatch(r"\[\[ATTACHMENT\|(.*)\]\]", line)[1]
    assert (job.folder / picture).read_bytes().startswith(b"\x89PNG")
    allow(job)
    assert job(*bash(f"{command} --overwrite")).returncode == 0


@pytest.mark.slow
def test_the_pre_merge_script_says_what_to_do(job):
    script = ROOT / "examples" / "ci" / "pre-merge.sh"
    done = job(script, "logs")
    assert done.returncode == 1
    page = re.search(r"noise: findings, see (\S+/index.html);", done.stdout)[1]
    assert Path(page).exists()
    allow(job)
    done = job(script, "logs")
    assert done.returncode == 0
    assert done.stdout.splitlines()[-1] == "noise: nothing new"
    time = np.arange(300) / 30
    np.savez(job.folder / "slow.npz", time=time, velocity=np.cos(time)[:, None])
    assert job(script, "slow.npz").returncode == 0
    done = job(script, "gone.npz")
    assert done.returncode == 3
    assert done.stdout.splitlines()[-1] == "noise: not checked, exit status 3"
