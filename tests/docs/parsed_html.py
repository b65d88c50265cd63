"""What is in a page of HTML."""

import re
from html.parser import HTMLParser


class Html(HTMLParser):
    """The tags, identifiers, references and text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]

    def handle_data(self, data: str) -> None:
        self.text += f"{data} "

    @property
    def identifiers(self) -> list[str]:
        return [value for name, value in self.attributes if name == "id"]

    @property
    def links(self) -> list[str]:
        """What links and images refer to."""
        return [v for n, v in self.attributes if n in ("href", "xlink:href", "src") and v]

    @property
    def references(self) -> list[str]:
        """And what clipping paths refer to; no namespaces."""
        values = " ".join(value for _, value in self.attributes)
        return self.links + re.findall(r"url\((.*?)\)", values)
