"""Make the pictures of docs/ci.md: the page of `classify`, and a job's annotations and summary.

    python assets/ci.py LOGS [--browser chromium]

Classifies the logs as the action does, and takes pictures of what it wrote in a browser
(Playwright). GitHub itself is not involved: its annotations are drawn from the lines that the job
prints, and the summary from its Markdown.
"""

import argparse
import io
import re
import shutil
import subprocess
import sys
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import unquote

from markdown_it import MarkdownIt
from PIL import Image
from playwright.sync_api import Browser, sync_playwright

PICTURES = Path(__file__).parent / "pictures"
COLORS = 192
"""Of the pictures: few, so that they are small."""
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
th, td { border: 1px solid #d1d9e0; padding: .3rem .7rem; text-align: left; font-size: .9rem; }
code { background: #eff1f3; border-radius: 4px; padding: .1rem .3rem; font-size: .85em; }
"""


def main() -> None:
    """Classify, and take the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("logs", type=Path)
    parser.add_argument("--browser", default="chromium")
    options = parser.parse_args()
    with TemporaryDirectory() as folder, sync_playwright() as driver:
        shutil.copytree(options.logs, Path(folder) / "logs")
        command = ["classify", "logs", "--report", "noise", "--format", "github"]
        done = subprocess.run(
            [sys.executable, "-m", "inspector", *command, "--write", "markdown=noise.md"],
            cwd=folder,
            capture_output=True,
            text=True,
        )
        page, job = Path(folder) / "noise" / "index.html", Path(folder) / "job.html"
        job.write_text(rendered(done.stdout, (Path(folder) / "noise.md").read_text()))
        path = shutil.which(options.browser) or options.browser
        window = driver.chromium.launch(executable_path=path, args=["--no-sandbox"])
        take(window, page, PICTURES / "ci-page.png", whole=False)
        take(window, job, PICTURES / "ci-job.png", whole=True)
        window.close()


def rendered(lines: str, summary: str) -> str:
    """The annotations and the summary of a job, as HTML."""
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
    told = MarkdownIt("commonmark", {"html": True}).enable("table").render(summary)
    return (
        f'<!DOCTYPE html><meta charset="utf-8"><style>{STYLE}</style>'
        f'<div class="job"><h2>Annotations</h2>{"".join(items)}</div>'
        f'<div class="job"><h2>noise summary</h2><div class="summary">{told}</div></div>'
    )


def take(browser: Browser, page: Path, target: Path, *, whole: bool) -> None:
    """Take a picture of a page."""
    window = browser.new_page(viewport={"width": 1440, "height": 900})
    window.goto(page.as_uri())
    window.wait_for_timeout(500)
    shot = Image.open(io.BytesIO(window.screenshot(full_page=whole)))
    shot.convert("RGB").quantize(COLORS).save(target, optimize=True)
    window.close()


if __name__ == "__main__":
    main()
