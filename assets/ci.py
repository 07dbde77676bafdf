"""Make the pictures of docs/ci.md and docs/accept.md: what a job says of a chatter, and a history.

    python assets/ci.py [--browser chromium]

Simulates and accepts the runs of examples/accept, classifies runs with a chatter in one scenario
and in all as the action does, and takes pictures of what it wrote in a browser (Playwright). GitHub
itself is not involved: its annotations are drawn from the lines that the job prints, and comment
and summary, which are the same, from its Markdown.
"""

import argparse
import io
import os
import re
import shutil
import subprocess
import sys
from datetime import date
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from urllib.parse import unquote

from markdown_it import MarkdownIt
from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from inspector.library import load_library, model_files
from inspector.reference.verdicts import References
from inspector.report.formats import as_json
from inspector.verdict import classify_files

ROOT = Path(__file__).parents[1]
PICTURES = ROOT / "assets" / "pictures"
COLORS = 192  # of the pictures: few, so that they are small
COMMITS, SINCE = 20, 12  # of the history, and how many of them come before the chatter
COMMAND = re.compile(r"::(?P<kind>error|warning|notice)(?P<about>[^:]*)::(?P<text>.*)")
STYLE = """
body { font: 15px/1.45 system-ui, "DejaVu Sans", sans-serif; color: #1f2328; margin: 1.2rem;
  max-width: 74rem; }
.job { border: 1px solid #d1d9e0; border-radius: 6px; margin-bottom: 1.2rem; }
.job > h2 { font-size: 1rem; background: #f6f8fa; margin: 0; padding: .5rem 1rem;
  border-bottom: 1px solid #d1d9e0; }
.item { border-bottom: 1px solid #d1d9e0; padding: .45rem 1rem; overflow-wrap: anywhere; }
.item:last-child { border: 0; } .item b { display: inline-block; min-width: 5rem; }
.error b { color: #cf222e; } .warning b { color: #9a6700; } .notice b { color: #0969da; }
.item small { color: #59636e; display: block; margin-left: 5rem; }
.summary { padding: .2rem 1rem 1rem; } table { border-collapse: collapse; }
pre { background: #f6f8fa; padding: .8rem; } h1 { font-size: 1.2rem; }
th, td { border: 1px solid #d1d9e0; padding: .3rem .7rem; text-align: left; font-size: .9rem; }
code { background: #eff1f3; border-radius: 4px; padding: .1rem .3rem; font-size: .85em; }
"""


def main() -> None:
    """Simulate, classify, and take the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--browser", default="chromium")
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT / "examples" / "accept"))
    import simulate

    with TemporaryDirectory() as name, sync_playwright() as driver:
        folder = Path(name)
        simulate.write(folder / "logs")
        called(folder, "accept", "logs", "--reason", "first release", "--in-ci")
        jobs = [job(folder, change) for change in ("chatter", "chatter-all")]
        (folder / "job.html").write_text(HEAD + "".join(jobs))
        history(folder, simulate)
        path = shutil.which(options.browser) or options.browser
        window = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        page = folder / "chatter" / "noise" / "index.html"
        take(window, page, PICTURES / "ci-page.png", whole=False)
        take(window, folder / "job.html", PICTURES / "ci-job.png", whole=True)
        take(window, folder / "history.html", PICTURES / "ci-history.png", whole=False)
        window.close()
        (drawn,) = (page.parent / "pictures").glob("pick-1-*.png")
        kept(Image.open(drawn), PICTURES / "over-reference.png")


def called(folder: Path, *command: str) -> str:
    """What a command prints."""
    done = subprocess.run(
        [sys.executable, "-m", "inspector", *command],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'models'}"},
        capture_output=True,
        text=True,
    )
    assert done.returncode in (0, 1), done.stderr
    return done.stdout


def job(folder: Path, change: str) -> str:
    """The annotations and the comment of a job, as HTML."""
    import simulate

    own = folder / change
    simulate.write(own / "logs", change)
    shutil.copytree(folder / "reference", own / "reference")
    command = ["classify", "logs", "--report", "noise", "--format", "github"]
    lines = called(own, *command, "--write", "markdown=noise.md")
    told = "one scenario" if change == "chatter" else "all scenarios"
    return rendered(f"A chatter in {told}", lines, (own / "noise.md").read_text())


def history(folder: Path, simulate: ModuleType) -> None:
    """Results of many commits, from one on with a chatter in one scenario, and their page."""
    library, reference = load_library(model_files()), folder / "reference"
    for name in ("results", "now"):
        (folder / name).mkdir()
    runs = [folder / "now" / f"{name}-1.npz" for name in simulate.SCENARIOS]
    beside = References.found(runs, reference)
    for commit in range(COMMITS):
        for path, name in zip(runs, simulate.SCENARIOS, strict=True):
            change = "chatter" if commit >= SINCE else ""
            simulate.run(name, 20 + commit, change).save(path, overwrite=True)
        verdicts = [
            beside.judge(each, None, date.today())
            for each in classify_files(runs, library, reference=beside)
        ]
        (folder / "results" / f"{commit:04d}-c{commit:03d}.json").write_text(as_json(verdicts))
    called(folder, "history", "results", "-o", "history.html")


HEAD = f'<!DOCTYPE html><meta charset="utf-8"><style>{STYLE}</style>'


def rendered(title: str, lines: str, comment: str) -> str:
    """The annotations and the comment of a job, as HTML."""
    items = []
    for line in lines.splitlines():
        if command := COMMAND.fullmatch(line):
            about = dict(part.split("=", 1) for part in command["about"].split(",") if "=" in part)
            names = {key.strip(): unquote(value) for key, value in about.items()}
            place = " ".join(filter(None, (names.get("title"), names.get("file"))))
            text = escape(unquote(command["text"]))
            items.append(
                f'<div class="item {command["kind"]}"><b>{command["kind"].capitalize()}</b>'
                f"{text}<small>{escape(place)}</small></div>"
            )
    told = MarkdownIt("commonmark", {"html": True}).enable("table").render(comment)
    return (
        f"<h1>{title}</h1>"
        f'<div class="job"><h2>Annotations</h2>{"".join(items)}</div>'
        f'<div class="job"><h2>Summary and comment</h2><div class="summary">{told}</div></div>'
    )


def take(browser: Browser, page: Path, target: Path, *, whole: bool) -> None:
    """Take a picture of a page."""
    window = browser.new_page(viewport={"width": 1280, "height": 800})
    window.goto(page.as_uri())
    window.wait_for_timeout(500)
    kept(Image.open(io.BytesIO(window.screenshot(full_page=whole))), target)
    window.close()


def kept(picture: Image.Image, target: Path) -> None:
    """Write a picture with few colours."""
    picture.convert("RGB").quantize(COLORS).save(target, optimize=True)


if __name__ == "__main__":
    main()
