"""The pages: their code runs, their commands exist, and the site is built without a warning.

A page's blocks run one after the other, in a folder of its own with files of the names that pages
use. In ```python``` blocks names live on from block to block. Of ```sh``` blocks the lines run that
call `inspector`; in ```console``` blocks lines with `$ ` run, and the rest is what they print (`…`
stands for any text). Right above a block, a comment may say:

    <!-- not run: REASON -->            the block does not run
    <!-- not run (WORDS): REASON -->    neither do its lines with these words
    <!-- before: CODE -->               Python that runs first, in place of what the reader has
"""

import ast
import os
import re
import runpy
import shlex
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from commandline import python, ran

from noisemodel import Run, decimated, runfile

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [
    "README.md",
    "CONTRIBUTING.md",
    *sorted(str(p.relative_to(ROOT)) for p in DOCS.rglob("*.md")),
]
GENERATED = {"commands", "log-formats", "accuracy", "robots"}
BY_HAND = [page.stem for page in sorted(DOCS.glob("*.md")) if page.stem not in GENERATED]
BLOCK = re.compile(r"((?:^<!-- .*? -->\n+)*)^```(python|sh|console)\n(.*?)^```", re.M | re.S)
MARK = re.compile(r"<!-- (not run|before)(?: \((.*?)\))?: (.*?) -->", re.S)
CALL = re.compile(r"(?:.* \| )?(?:\.venv/bin/)?inspector ")


@dataclass(frozen=True)
class Code:
    """A block of a page."""

    language: str
    text: str
    marks: tuple[tuple[str, str, str], ...]

    @property
    def runs(self) -> bool:
        """Whether any of it runs."""
        return not any(kind == "not run" and not words for kind, words, _ in self.marks)

    @property
    def python(self) -> str:
        """Its Python, after what a comment above it adds; empty if it is of another language."""
        before = [code for kind, _, code in self.marks if kind == "before"]
        return "\n".join([*before, self.text]) if self.language == "python" else ""

    @property
    def calls(self) -> list[str]:
        """Lines that call `inspector`, or any command of a console."""
        lines = self.text.replace("\\\n", " ").splitlines()
        if self.language == "console":
            return [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
        return [line.replace(".venv/bin/", "") for line in lines if CALL.match(line)]

    def left_out(self, line: str) -> bool:
        """Whether a mark says that a line does not run."""
        return any(kind == "not run" and words in line for kind, words, _ in self.marks)


def blocks(page: str) -> list[Code]:
    """The blocks of a page."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return [
        Code(kind, code, tuple(MARK.findall(marks))) for marks, kind, code in BLOCK.findall(text)
    ]


def with_blocks(*languages: str) -> list[str]:
    """Pages that have a block that runs, in one of these languages."""

    def there(each: Code) -> bool:
        return each.runs and each.language in languages and bool(each.python or each.calls)

    return [page for page in PAGES if any(map(there, blocks(page)))]


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """A folder with files of the names that pages use, all of the demo's Panda at 1 kHz."""
    folder = tmp_path_factory.mktemp("named")
    demo = Run.load(ROOT / "assets" / "runs" / "demo.npz")
    kinds = ("position", "velocity", "velocity_desired")
    signals = {kind: getattr(demo, kind)[::10] for kind in kinds}
    run = replace(decimated(demo, 1000.0), **signals)
    for place in ("run", "before", "after", "runs/one", "runs/two", "logs/one"):
        save(run, folder / place)
    for number in range(1, 11):
        good = smooth(run, np.random.default_rng(number))
        side = number > 5
        sides = f"{('before', 'after')[side]}/", f"policy-{'ab'[side]}/"
        for place in ("", *sides, "episodes/"):
            save(good, folder / f"{place}{'pick-' if place else 'good'}{number}")
    for name, own in {"measured": kinds[:2], "desired": kinds[2:], "log": kinds}.items():
        table = np.column_stack((run.time, *(signals[kind] for kind in own)))
        head = ["time", *(f"{joint}.{kind}" for kind in own for joint in run.joint_names)]
        file = folder / f"{name}.csv"
        np.savetxt(file, table, "%.7g", delimiter=",", header=",".join(head), comments="")
    (folder / "my_model.npz").symlink_to(ROOT / "models" / "general.npz")
    (folder / "assets").symlink_to(ROOT / "assets")
    call = folder / "bin" / "inspector"
    call.parent.mkdir()
    call.write_text(f'#!/bin/sh\nexec {sys.executable} -m inspector "$@"\n')
    call.chmod(0o755)
    return folder


def save(run, place):
    """Write a run file, and the folder for it."""
    place.parent.mkdir(exist_ok=True)
    run.save(f"{place}.npz")


def smooth(run, random):
    """The run with another motion: sines, as slow for all joints, and a sensor's noise."""
    phase = 0.9 * run.time[:, None] + random.uniform(0, 6, len(run.joint_names))
    desired, noise = 0.5 * np.sin(phase), random.normal(0.0, 0.003, run.velocity.shape)
    position = -0.55 * np.cos(phase)
    signals = {"velocity": desired + noise, "velocity_desired": desired, "position": position}
    return replace(run, **signals, blocks=(), stages={}, meta={})


@pytest.fixture
def scratch(files, tmp_path, request):
    """A copy of these files, and the environment of a shell there; a session begins without."""
    session = request.getfixturevalue("page") == "docs/tutorial.md"
    subprocess.run(["cp", "-a", f"{files}/{'bin' if session else '.'}", tmp_path], check=True)
    path = {"PATH": f"{tmp_path}/bin:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    return tmp_path, os.environ | path | {"LC_ALL": "C.UTF-8", "COLUMNS": "200"}


def run_python(code: str, folder: Path, environment) -> None:
    """Run Python in a process of its own, warnings as errors."""
    python("-W", "error", "-c", code, cwd=folder, env=environment, status=0)


@pytest.mark.parametrize("page", with_blocks("python"))
def test_the_python_of_a_page_runs(page, scratch):
    run_python("\n".join(each.python for each in blocks(page) if each.runs), *scratch)


@pytest.mark.slow
@pytest.mark.parametrize("page", with_blocks("sh", "console"))
def test_the_commands_of_a_page_run(page, scratch):
    folder, environment = scratch
    own = [each for each in blocks(page) if each.runs]
    if any(each.language == "console" for each in own):
        run_python("\n".join(each.python for each in own), folder, environment)
    for block in own:
        calls = [line for line in block.calls if not block.left_out(line)]
        # After each: its status is kept for `echo $?`, and a mark ends its output.
        script = "".join(f"{line}\ns=$?; printf '\\036%s\\037' $s; (exit $s)\n" for line in calls)
        alone = {"cwd": folder, "env": environment, "stdin": subprocess.DEVNULL}
        done = ran("bash", "-c", script, **alone)
        ended = re.findall(r"(.*?)\x1e(\d+)\x1f", done.stdout, re.S)
        assert len(ended) == len(calls), done.stderr
        for line, (_, status) in zip(calls, ended, strict=True):
            assert status in "01", f"{line}: exit status {status}\n{done.stderr}"
            assert "Traceback" not in done.stderr, f"{line}\n{done.stderr}"
        if block.language == "console":
            printed = [part.strip("\n") for part in re.split(r"^\$ .*\n", block.text, flags=re.M)]
            for line, wanted, (found, _) in zip(calls, printed[1:], ended, strict=True):
                pattern = ".*".join(map(re.escape, wanted.split("…")))
                assert re.fullmatch(pattern, found.strip("\n"), re.S), f"{line}\n{found}"


def test_every_command_of_the_pages_exists_with_its_options():
    from typer.main import get_command

    from inspector.cli import app

    commands = get_command(app).commands
    called = set()
    for page in PAGES:
        for block in blocks(page):
            for line in block.calls:
                words = shlex.shlex(line, posix=True, punctuation_chars="|&;")
                words.whitespace_split = True
                for part in re.split(r"[|&;]+", "\0".join(words)):
                    name, *given = part.strip("\0").split("\0")
                    if name == "inspector" and not given[0].startswith("-"):
                        called.add(given[0])
                        assert given[0] in commands, f"{page}: {line}"
                        commands[given[0]].make_context(given[0], given[1:])
    assert {"view", "classify", "import", "simulate", "train", "evaluate"} <= called


def test_a_comment_above_a_block_is_one_that_these_tests_know():
    for page in PAGES:
        text = (ROOT / page).read_text(encoding="utf-8")
        comments = re.findall(r"<!--.*?-->", re.sub(r"`[^`\n]+`", "", text), re.S)
        unknown = [each for each in comments if not MARK.fullmatch(each)]
        code = "\n".join(re.findall(r"^```.*?^```", text, re.M | re.S))
        assert not [each for each in unknown if each not in code], page


def test_the_readme_and_the_pages_stay_short():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(readme.splitlines()) <= 120
    assert len(readme.split()) <= 900
    by_hand = [(DOCS / f"{page}.md").read_text(encoding="utf-8") for page in BY_HAND]
    assert sum(len(page.splitlines()) for page in by_hand) <= 1500
    assert sum(len(page.split()) for page in by_hand) <= 16_000


def test_no_line_of_prose_is_longer_than_120_characters():
    for page in ["README.md", *(f"docs/{name}.md" for name in BY_HAND)]:
        for number, line in enumerate((ROOT / page).read_text(encoding="utf-8").splitlines(), 1):
            whole = line.startswith(("|", "!", "<!--", "$", "M^")) or "\\begin" in line
            assert len(line) <= 120 or whole, f"{page}:{number}"


def test_generated_pages_are_current():
    generate = runpy.run_path(str(DOCS / "generate.py"))
    for page, make in generate["PAGES"].items():
        assert (DOCS / page).read_text(encoding="utf-8") == make(), (
            f"python docs/generate.py: {page}"
        )


def test_pictures_are_small_and_shown():
    pictures = sorted((ROOT / "assets" / "pictures").iterdir())
    assert all(picture.stat().st_size < 250_000 for picture in pictures)


def test_the_formats_have_every_array_of_a_run_file():
    page = (DOCS / "formats.md").read_text(encoding="utf-8")
    section = page.split("## Run file")[1].split("\n## ")[0]
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in section.splitlines()]
    shapes = {row[0].strip("`"): row[1] for row in rows if row[0].startswith("`") and len(row) > 1}
    kinds = runfile.KIND_WORDS
    wanted = {
        name: f"{kinds[kind]}, ({', '.join(axes)}{',' if len(axes) == 1 else ''})"
        if axes
        else kinds[kind]
        for name, (kind, axes) in {**runfile.ARRAYS, "stage_<name>": runfile.STAGE_ARRAY}.items()
    }
    assert shapes == wanted


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_requests_nothing(tmp_path):
    pytest.importorskip("sphinx", reason="needs the extra docs")
    options = ("-W", "--keep-going", "-q", "-E", DOCS, tmp_path)
    python("-m", "sphinx", *options, env=os.environ | {"no_proxy": "*"}, status=0)
    requested = re.compile(
        r"""<(?:script|img|iframe|source|video|audio|embed|object)\b[^>]*?(?:src|data)=["']?(?:https?:)?//"""
        r"""|<link\b[^>]*?href=["']?(?:https?:)?//|url\(\s*["']?(?:https?:)?//|@import\s+["']?(?:url|http)"""
        r"""|(?:fetch|importScripts|XMLHttpRequest|sendBeacon)\(\s*["'](?:https?:)?//"""
    )
    built = [p for p in tmp_path.rglob("*") if p.suffix in (".html", ".css", ".js")]
    assert len(built) > 30
    for path in built:
        assert not requested.search(path.read_text(encoding="utf-8")), path
    noise = (tmp_path / "noise.html").read_text(encoding="utf-8")
    assert "<math" in noise
    assert not [left for left in ("$$", r"\frac", r"\sqrt") if left in noise]


def test_the_site_has_every_page():
    tree = ast.parse((DOCS / "conf.py").read_text(encoding="utf-8"))
    (parts,) = (
        ast.literal_eval(each.value)
        for each in tree.body
        if isinstance(each, ast.Assign) and ast.unparse(each.targets[0]) == "NAVIGATION"
    )
    shown = {entry.split("<")[-1].strip(">") for part in parts.values() for entry in part}
    assert {f"docs/{page}.md" for page in shown} | {"docs/index.md"} == set(PAGES[2:])
