"""Pages of the documentation, and how the tests run their blocks.

Every fenced block of a page is run, in the order of the page, in one copy of the checkout per page
(tests/docs/shell.py). Its language decides how:

- `sh`: by `bash -e`. Directory and environment carry over from block to block. `ros2` is the
  stand-in tests/docs/ros2.py. `.venv` exists and is filled; pip reaches no index.
- `python`: as a script; with a `def test_` in it, by pytest.
- `yaml`: parsed, and loaded as a scenario if it contains `ros__parameters`. `xml`: parsed.
- `text`: not run.

A block that needs more has directives in `docs/blocks`, in a TOML file with the path of the page:
`docs/blocks/how-to/colcon.toml` for `docs/how-to/colcon.md`, `docs/blocks/README.toml` for
`README.md`. A table is named as the heading that the block follows, a key is the number of the
block below that heading, from 1. A heading that occurs again on the page is `heading (2)`.

    ["Running it yourself"]
    1 = ["until Ctrl-C stickslip run feed_drive", "with --duration 10 for --duration 100"]

The directives:

`with NEW for OLD`
    Run with NEW in place of every OLD: a smaller count, or a name that the reader has to replace.
    NEW may be `$(ls -d bags/feed_drive-*Z)`. Several are allowed; OLD must be in the block.
`beside COMMAND`
    Run while COMMAND runs in another terminal and is up: its nodes are active, and a joint state
    of `stickslip run` has been heard, or it has printed so (`dask`; a free port is in `$PORT`).
    Successive blocks beside the same COMMAND share it. Several are allowed, started in this order.
`until Ctrl-C`, `until Ctrl-C COMMAND`
    Each line, or each that begins with COMMAND, is started, interrupted when it is up (for
    `ros2 topic`: when something has been printed), and has to end by that, without an error.
`in terminals`
    Each line in a terminal of its own, all at the same time; Ctrl-C in all of them at the end.
`file NAME`
    Saved under that name, a path relative to the reader's directory, for later blocks, one of
    which has to use it. The block itself is run if it is a test and no later block has its name.
    If the checkout has that file, or has it in examples, the block must be its text.
`after CODE`
    For `python`: run after this line of code, which imports what the reader has by then.
`output`
    For `text`: what the block before prints, or a part of it in whole lines; `…` stands for
    anything.
`new shell`
    For `sh`: in a shell without this environment, with an index for pip. Stays in effect to the
    end of the page. `$ROS_SETUP` replaces the set-up script of an installed ROS.
`not because REASON`
    Not run. Each of these is a decision.
"""

import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from markdown_it import MarkdownIt

CHECKOUT = Path(__file__).parents[2]
DIRECTIVES = CHECKOUT / "docs" / "blocks"

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

Directives = Mapping[str, Mapping[str, list[str]]]
"""Those of a page, by heading and number of the block."""


@dataclass(frozen=True)
class Block:
    """A fenced block: where it begins, its language, its text, and its directives."""

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
        """The text with the replacements of its directives."""
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


def public_names() -> list[str]:
    """The names that the reference documents, with their modules."""
    found = [
        page.read_text(encoding="utf-8") for page in (CHECKOUT / "docs/reference").glob("*.md")
    ]
    return [name for text in found for name in re.findall(r"^::: (\S+)$", text, re.MULTILINE)]


def directives_file(page: str) -> Path:
    """Where the directives of a page are, if it has any."""
    name = page.removeprefix("docs/")
    if (CHECKOUT / name).is_file():  # README.md, of which there is one in docs, too
        name = page
    return DIRECTIVES / Path(name).with_suffix(".toml")


def blocks(page: str) -> list[Block]:
    """The blocks of a page."""
    path = directives_file(page)
    directives = tomllib.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return list(parse(page, (CHECKOUT / page).read_text(encoding="utf-8"), directives))


def spans(page: str) -> list[str]:
    """The spans in single backticks in the text of a page."""
    text = (CHECKOUT / page).read_text(encoding="utf-8")
    inlines = (token.children or [] for token in _MARKDOWN.parse(text))
    return [child.content for each in inlines for child in each if child.type == "code_inline"]


def parse(page: str, text: str, directives: Directives) -> Iterator[Block]:
    """The blocks in the text of a page, with their directives.

    Raises AssertionError, with the place, for what would silently not be run: an unknown language
    or directive, directives without a block, directives on the page itself, an indented block.
    """
    left = {(heading, n) for heading, numbers in directives.items() for n in numbers}
    headings: Counter[str] = Counter()
    heading, number = "", 0
    tokens = _MARKDOWN.parse(text)
    for index, token in enumerate(tokens):
        line = token.map[0] + 1 if token.map else 0
        where = f"{page}:{line}"
        assert token.type != "code_block", f"{where}: an indented block, which is never run"
        if token.type == "html_block":
            assert "<!-- test:" not in token.content, f"{where}: a directive outside docs/blocks"
        elif token.type == "heading_open":
            title = tokens[index + 1].content
            headings[title] += 1
            heading = title if headings[title] == 1 else f"{title} ({headings[title]})"
            number = 0
        elif token.type == "fence":
            assert token.info in LANGUAGES, f"{where}: {token.info!r} is none of {LANGUAGES}"
            number += 1
            found: dict[str, list[str]] = {}
            for directive in directives.get(heading, {}).get(str(number), []):
                name, value = _directive(where, directive)
                found.setdefault(name, []).append(value)
            left.discard((heading, str(number)))
            yield Block(page, line, token.info, token.content, found)
    assert not left, f"{page}: directives without a block: {sorted(left)}"


def _directive(where: str, text: str) -> tuple[str, str]:
    for name, pattern in _DIRECTIVES.items():
        value = text.removeprefix(name)
        if value != text and (not value or value[0] == " "):
            assert re.fullmatch(pattern, value.strip()), f"{where}: {text!r} is incomplete"
            return name, value.strip()
    raise AssertionError(f"{where}: {text!r} is none of the directives {', '.join(_DIRECTIVES)}")
