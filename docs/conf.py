"""The site of these pages, built by Sphinx: `make docs`. They stay readable without it.

Navigation is here, so that pages are plain Markdown. Readers' browsers request nothing from
elsewhere: equations are MathML, in a font that is part of the site.
"""

import ast
import os
import re
import sys
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing
from docutils import nodes
from docutils.utils.math import latex2mathml
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxTranslator

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "models")]


class _Shown:
    """What signatures show of an array: docstrings have shape and unit."""

    def __class_getitem__(cls, _: Any) -> type:
        return np.ndarray


numpy.typing.NDArray = _Shown  # type: ignore[misc, assignment]

# Pages by part, in the order of the site's side bar; the text before <…> replaces their title.
NAVIGATION = {
    "Start": ["tutorial", "Reading the picture <reading>", "troubleshooting"],
    "How to": [
        "Read your log <logs>",
        "Record from code <record>",
        "Gate CI <ci>",
        "Accept and review <accept>",
        "Compare versions <compare>",
        "Export and listen <export>",
        "Train and evaluate <training>",
    ],
    "Explanation": [
        "paper",
        "noise",
        "classifier",
        "localisation",
        "statistics",
        "accuracy",
    ],
    "Reference": [
        "Commands <commands>",
        "formats",
        "log-formats",
        "exit-status",
        "limits",
        "metrics",
        "robots",
        "security",
        "upgrading",
        "changelog",
        "contributing",
    ],
    "API": [
        "api/inspector",
        "api/noisemodel",
        "api/noiseclassifier",
        "api/noiseclassifier.scenarios",
    ],
}
# Pages that have the text of a file of the root.
PAGES = {
    "changelog": "CHANGELOG.md",
    "contributing": "CONTRIBUTING.md",
    "security": "SECURITY.md",
}
# The font by which browsers lay equations out where the reader's system has none for that.
FONT = files("ziamath").joinpath("fonts/STIXTwoMath-Regular.ttf")
project = "noise-inspector"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
napoleon_use_ivar = True
napoleon_use_rtype = False
add_module_names = False
default_role = "code"
maximum_signature_line_length = 130
highlight_language = "text"
suppress_warnings = ["ref.python"]  # errors of one name in two packages
html_theme = "furo"
html_title = "noise-inspector"
html_static_path = ["site.css", str(FONT)]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_copyright = False


def _page(_: Sphinx, name: str, text: list[str]) -> None:
    """Take a file of the root in place of the page that names it; add the side bar.

    Links to folders, which a site does not show, become their text.
    """
    folder = ROOT if name in PAGES else (ROOT / "docs" / name).parent
    if name in PAGES:
        text[0] = (ROOT / PAGES[name]).read_text(encoding="utf-8")
    pages = {ROOT / file: ROOT / "docs" / f"{page}.md" for page, file in PAGES.items()}

    def here(link: re.Match[str]) -> str:
        path, hash_, anchor = link[2].partition("#")
        target = (folder / path).resolve()
        if target.is_dir() or not target.exists():
            return link[1] if target.is_dir() else link[0]
        path = os.path.relpath(pages.get(target, target), (ROOT / "docs" / name).parent)
        return f"[{link[1]}]({path}{hash_}{anchor})"

    text[0] = re.sub(r"\[([^]\[]*)\]\((?!\w+:|#)([^)\s]+)\)", here, text[0])
    if name == "index":
        for part, members in NAVIGATION.items():
            lines = ("```{toctree}", ":hidden:", f":caption: {part}", "", *members, "```")
            text[0] += "\n" + "\n".join(lines) + "\n"


def _constant(
    _: Sphinx, what: str, name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """Document a constant of a package by the text below it in the module that it comes from."""
    package, _, constant = name.rpartition(".")
    if what != "data" or not hasattr(import_module(package), "__path__"):
        return
    source = Path(str(import_module(package).__file__)).read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and constant in {each.name for each in node.names}:
            docs = ModuleAnalyzer.for_module(str(node.module)).find_attr_docs()
            found = docs.get(("", constant), lines)
            lines[:] = [line.replace("|", r"\|") for line in found]


def _signature(
    _: Sphinx, _what: str, _name: str, _object: Any, _options: Any, given: str | None, found: str
) -> tuple[str | None, str]:
    """Show `...` for defaults that are made anew, which no signature can state."""
    return given and given.replace("<factory>", "..."), found


def _mathml(formula: str, *, block: bool = False) -> str:
    """MathML of a formula; docutils puts the index of a letter with an accent below the letter."""
    accent = r'(<mo stretchy="false">[ˉ˙ˆ]</mo>)'  # noqa: RUF001
    accented = rf"<munderover>\s*(<mi>\w</mi>)\s*(.*?)\s*{accent}\s*</munderover>"
    beside = r'<msub><mover accent="true">\1\3</mover>\2</msub>'
    return re.sub(accented, beside, latex2mathml.tex2mathml(formula, as_block=block), flags=re.S)


def _inline(self: SphinxTranslator, node: nodes.math) -> None:
    self.body.append(_mathml(node.astext()))
    raise nodes.SkipNode


def _block(self: SphinxTranslator, node: nodes.math_block) -> None:
    self.body.append(f'<div class="math">{_mathml(node.astext(), block=True)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Register what this file adds to Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("source-read", _page)
    app.connect("autodoc-process-docstring", _constant)
    app.connect("autodoc-process-signature", _signature)
