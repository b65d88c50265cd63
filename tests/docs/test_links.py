"""Every link from page to page has a target."""

import re

import pytest
from markdown_it import MarkdownIt

from tests.docs.page import CHECKOUT, pages


def links(page: str) -> set[str]:
    """The targets of a page's links and pictures within the checkout."""
    targets: set[str] = set()
    for token in MarkdownIt().enable("table").parse((CHECKOUT / page).read_text(encoding="utf-8")):
        for child in token.children or []:
            target = child.attrs.get("href") or child.attrs.get("src")
            if target and "://" not in str(target):
                targets.add(str(target))
    return targets


def anchors(page: str) -> set[str]:
    """The headings of a page as GitHub makes anchors of them."""
    tokens = MarkdownIt().parse((CHECKOUT / page).read_text(encoding="utf-8"))
    titles = [
        tokens[number + 1].content
        for number, token in enumerate(tokens)
        if token.type == "heading_open"
    ]
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", pages())
def test_the_links_of_a_page_lead_somewhere(page: str) -> None:
    for link in links(page):
        name, _, anchor = link.partition("#")
        target = ((CHECKOUT / page).parent / name).resolve() if name else CHECKOUT / page
        assert target.exists(), f"{page}: {link}"
        if anchor:
            assert anchor in anchors(str(target.relative_to(CHECKOUT))), f"{page}: {link}"
