"""The web site: it builds without a warning, shows what GitHub shows, and has no broken link."""

import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from markdown_it import MarkdownIt

from tests.docs.page import CHECKOUT, pages
from tests.docs.parsed_html import Html
from tests.nodes.graph import PATIENCE

pytestmark = [pytest.mark.long, pytest.mark.process]

COUNTED = ("h2", "li", "table", "tr", "pre", "img")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    environment = os.environ | {"NO_COLOR": "1", "NO_MKDOCS_2_WARNING": "1"}
    built = subprocess.run(
        command, cwd=CHECKOUT, env=environment, capture_output=True, text=True, timeout=4 * PATIENCE
    )
    assert built.returncode == 0, built.stderr
    output = [line for line in built.stderr.splitlines() if re.match("INFO|WARNING|ERROR", line)]
    assert [re.sub(r"[\d.]+|/\S*", "", line) for line in output] == [
        "INFO    -  Cleaning site directory",
        "INFO    -  Building documentation to directory: ",
        "INFO    -  Documentation built in  seconds",
    ]
    return folder


@cache
def parsed(path: Path) -> Html:
    return Html(path.read_text(encoding="utf-8"))


def counts(text: str) -> dict[str, int]:
    """How many there are of each element of an article."""
    tags = Html(text).tags
    return {tag: tags.count(tag) for tag in COUNTED}


def place(site: Path, page: str) -> Path:
    """Where a page of the checkout is on the site."""
    return site / page.removesuffix(".md").removesuffix("README") / "index.html"


def test_every_page_has_what_it_has_on_github(site: Path) -> None:
    for page in pages():
        if page.startswith("docs/reference/"):  # filled in
            continue
        text = (CHECKOUT / page).read_text(encoding="utf-8")
        expected = counts(MarkdownIt().enable("table").render(text))
        shown = place(site, page).read_text(encoding="utf-8")
        found = counts(shown.partition("<article")[2].partition("</article>")[0])
        assert found == expected, page


def test_the_public_names_are_filled_in(site: Path) -> None:
    for page in (CHECKOUT / "docs/reference").glob("*.md"):
        names = re.findall(r"^::: (\S+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
        assert names
        assert {*names} <= {*parsed(site / "docs/reference" / page.stem / "index.html").identifiers}


def test_no_link_of_the_site_is_broken(site: Path) -> None:
    for path in sorted(site.rglob("*.html")):
        if path.name == "404.html":
            continue
        for link in parsed(path).links:
            split = urlsplit(link)
            if split.scheme:
                assert split.scheme in ("http", "https", "data"), f"{path}: {link}"
                continue
            target = (path.parent / unquote(split.path)).resolve() if split.path else path
            target = target / "index.html" if target.is_dir() else target
            assert target.is_file(), f"{path}: {link}"
            if split.fragment and target.suffix == ".html":
                assert split.fragment in parsed(target).identifiers, f"{path}: {link}"


def test_a_reader_of_the_site_asks_no_other_server(site: Path) -> None:
    for path in site.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r'<(script|img|iframe)[^>]* src="https?:', text), path
        assert not re.search(r'<link[^>]* href="https?:(?![^>]*rel="canonical")', text), path
