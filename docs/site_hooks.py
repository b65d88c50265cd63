"""Hooks of `mkdocs build`: paths as in the checkout, and formulas as MathML."""

import html
import re
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

CHECKOUT = Path(__file__).parents[1]

PUBLISHED = (
    "*.md",
    "CITATION.cff",
    "LICENSE",
    "bags/*.md",
    "bags/*.json",
    "config/*",
    "docs/**/*.md",
    "docs/**/*.png",
    "docs/**/*.svg",
    "docs/json.schema.json",
    "docs/site.css",
    "examples/**/*.py",
    "examples/**/*.ipynb",
    "examples/**/*.png",
)
"""Files of the site, with the paths that links on the pages lead to, on GitHub as well."""

_FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Replace the files below docs by those of the whole checkout."""
    for file in list(files):
        if file.src_dir == config.docs_dir:
            files.remove(file)
    for pattern in PUBLISHED:
        for path in sorted(CHECKOUT.glob(pattern)):
            name = path.relative_to(CHECKOUT).as_posix()
            files.append(File(name, str(CHECKOUT), config.site_dir, config.use_directory_urls))
    return files


def on_page_content(content: str, **_: object) -> str:
    """Return the page with its formulas as MathML, which a browser shows without a script."""
    return _FORMULA.sub(_as_mathml, content)


def _as_mathml(formula: re.Match[str]) -> str:
    latex = html.unescape(formula[3])
    # latex2mathml lets only one of two bars grow, and spaces the letters of a word.
    latex = latex.replace("\\lvert", "|").replace("\\rvert", "|").replace("\\mathit", "\\text")
    return convert(latex, display="inline" if formula[2] == "(" else "block")
