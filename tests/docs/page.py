"""Pages of the documentation, and what is said on them about how their blocks are run.

Every fenced block of a page is run, in the order of the page, in one copy of the checkout per page
(tests/docs/shell.py). What kind it is follows from its language:

- `sh`: by `bash -e`. Directory and environment carry over from block to block. `ros2` is the
  stand-in tests/docs/ros2.py. `.venv` is there, filled; pip reaches no index.
- `python`: as a script; with a `def test_` in it, by pytest.
- `yaml`: parsed, and loaded as a scenario where `ros__parameters` stand in it. `xml`: parsed.
- `text`: not run.

What needs more says so in HTML comments right above it, each on a line of its own:

`<!-- test: with NEW for OLD -->`
    Run with NEW wherever OLD stands in it: a smaller count, or a name that the reader has to
    replace. NEW may be `$(ls -d bags/feed_drive-*Z)`. Several are allowed; OLD must be there.
`<!-- test: beside COMMAND -->`
    Run while COMMAND runs in another terminal and is up: its nodes are active, and a joint state
    of `stickslip run` has been heard, or it has said so (`dask`; a free port is in `$PORT`).
    Blocks in a row beside the same COMMAND share it. Several are allowed, started in this order.
`<!-- test: until Ctrl-C -->`, `<!-- test: until Ctrl-C COMMAND -->`
    Each line, or each that begins with COMMAND, is started, interrupted when it is up (for
    `ros2 topic`: when something has been printed), and has to end by that, without an error.
`<!-- test: in terminals -->`
    Each line in a terminal of its own, all at the same time; Ctrl-C in all of them at the end.
`<!-- test: file NAME -->`
    Saved under that name, a path from where the reader is, for later blocks, one of which has to
    use it; itself it is run if it is a test and no later block has its name. If the checkout has
    that file, or has it in examples, the block must be its text.
`<!-- test: after CODE -->`
    For `python`: run after this line of code, which imports what the reader has by then.
`<!-- test: output -->`
    For `text`: what the block before prints, or a part of it in whole lines; `…` stands for
    anything.
`<!-- test: new shell -->`
    For `sh`: in a shell that knows nothing of this environment, with an index for pip. Stays in
    force to the end of the page. `$ROS_SETUP` stands in for the set-up script of an installed
    ROS.
`<!-- test: not because REASON -->`
    Nothing runs it. test_pages.py has the list of these.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from markdown_it import MarkdownIt

CHECKOUT = Path(__file__).parents[2]

LANGUAGES = {"sh", "python", "yaml", "xml", "text"}

_MARKDOWN = MarkdownIt().enable("table")

_DIRECTIVES = {
    "with": r".+ for .+",
    "beside": r".+",
    "until Ctrl-C": r".*",
    "in terminals": r"",
    "file": r"\S+",
    "after": r".+",
    "output": r"",
    "new shell": r"",
    "not because": r".+",
}


@dataclass(frozen=True)
class Block:
    """A fenced block: where it begins, its language, its text, and the directives above it."""

    page: str
    line: int
    language: str
    text: str
    directives: dict[str, list[str]] = field(default_factory=dict)

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"

    @property
    def to_run(self) -> str:
        """The text with what the directives put in place of other things."""
        text = self.text
        for value in self.directives.get("with", []):
            new, old = value.split(" for ", 1)
            assert old in text, f"{self.place}: no {old!r} in it"
            text = text.replace(old, new)
        return text


def pages() -> list[str]:
    """The pages, as paths in the checkout."""
    found = [*CHECKOUT.glob("*.md"), *(CHECKOUT / "docs").rglob("*.md")]
    found += (CHECKOUT / "bags").glob("*.md")
    return sorted(str(page.relative_to(CHECKOUT)) for page in found)


def blocks(page: str) -> list[Block]:
    """The blocks of a page."""
    return list(parse(page, (CHECKOUT / page).read_text(encoding="utf-8")))


def spans(page: str) -> list[str]:
    """What stands in single backticks within the text of a page."""
    text = (CHECKOUT / page).read_text(encoding="utf-8")
    inlines = (token.children or [] for token in _MARKDOWN.parse(text))
    return [child.content for each in inlines for child in each if child.type == "code_inline"]


def parse(page: str, text: str) -> Iterator[Block]:
    """The blocks in the text of a page.

    Raises AssertionError, saying where, for what nobody would run: an unknown language or
    directive, a directive without a block, an indented block.
    """
    directives: dict[str, list[str]] = {}
    for token in _MARKDOWN.parse(text):
        line = token.map[0] + 1 if token.map else 0
        where = f"{page}:{line}"
        if token.type == "html_block":
            for comment in re.findall(r"<!--\s*test:(.*?)-->", token.content, re.DOTALL):
                name, value = _directive(where, " ".join(comment.split()))
                directives.setdefault(name, []).append(value)
            continue
        if token.type == "fence":
            assert token.info in LANGUAGES, f"{where}: {token.info!r} is none of {LANGUAGES}"
            yield Block(page, line, token.info, token.content, directives)
        else:
            assert token.type != "code_block", f"{where}: an indented block, which nobody runs"
            assert not directives, f"{where}: a directive without a block"
        directives = {}
    assert not directives, f"{page}: a directive without a block at the end"


def _directive(where: str, text: str) -> tuple[str, str]:
    for name, pattern in _DIRECTIVES.items():
        value = text.removeprefix(name)
        if value != text and (not value or value[0] == " "):
            assert re.fullmatch(pattern, value.strip()), f"{where}: {text!r} lacks something"
            return name, value.strip()
    raise AssertionError(f"{where}: no directive {text!r}; there are {', '.join(_DIRECTIVES)}")
