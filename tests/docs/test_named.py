"""Links, files, parameters, commands, messages, tests and public names of the pages exist."""

import ast
import re
import runpy
from functools import cache
from importlib import import_module
from itertools import pairwise

from markdown_it import MarkdownIt

import stickslip_ros
from stickslip_ros.app.commands import COMMANDS
from stickslip_ros.app.main import command_parser
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from tests.docs.page import CHECKOUT, pages, public_names, spans
from tests.slow import listed


def text_of(page: str) -> str:
    return (CHECKOUT / page).read_text(encoding="utf-8")


def links(page: str) -> set[str]:
    """The targets of a page's links and figures within the checkout."""
    tokens = MarkdownIt().enable("table").parse(text_of(page))
    children = [child for token in tokens for child in token.children or []]
    targets = {str(child.attrs.get("href") or child.attrs.get("src") or "") for child in children}
    return {target for target in targets if target and "://" not in target}


@cache
def anchors(page: str) -> set[str]:
    """The headings of a page as GitHub makes anchors of them."""
    tokens = MarkdownIt().parse(text_of(page))
    titles = [after.content for token, after in pairwise(tokens) if token.type == "heading_open"]
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def test_the_links_of_the_pages_lead_somewhere() -> None:
    for page in pages():
        for link in links(page):
            name, _, anchor = link.partition("#")
            target = ((CHECKOUT / page).parent / name).resolve() if name else CHECKOUT / page
            assert target.exists(), f"{page}: {link}"
            if anchor:
                assert anchor in anchors(str(target.relative_to(CHECKOUT))), f"{page}: {link}"


def test_the_files_that_the_theory_names_exist() -> None:
    named = {s for s in spans("docs/theory.md") if re.search(r"\.py$|\w/$", s)}
    assert "model/equations.py" in named
    for path in named:
        room = "" if path.startswith("stickslip_ros/") else "stickslip_ros"
        assert (CHECKOUT / room / path).exists(), path


def test_the_drawing_of_the_model_is_that_of_the_script() -> None:
    script = runpy.run_path(str(CHECKOUT / "docs/model_drawing.py"))
    assert text_of("docs/model.svg") == script["drawing"]()


def test_the_model_names_every_parameter_of_the_drive_and_its_controller() -> None:
    named = set(re.findall(r"`(plant|washout_controller)\.([\w.]+)`", text_of("docs/model.md")))
    for node, name in named:
        assert name in NODE_PARAMETERS[node].known
    drive = {"mass", "damping", "stiffness", "normal_force", "belt_speed"}
    gains = {"corner_frequency", "linear_gain", "cubic_gain"}
    assert {("plant", name) for name in drive} <= named
    assert {("washout_controller", name) for name in gains} <= named


def test_commands_that_are_named_have_the_options_that_are_named() -> None:
    for command in {s for page in pages() for s in spans(page) if re.match(r"stickslip \w", s)}:
        names, *arguments = command.split()[1:]
        for name in names.split("|"):
            assert name in COMMANDS, command
            options = {a.split("=")[0] for a in arguments if re.match("--?[a-z]", a)}
            assert options <= set(command_parser(name)._option_string_actions), command


def test_make_has_the_targets_that_are_named() -> None:
    targets = set(re.findall(r"^(\w[\w-]*):", text_of("Makefile"), re.MULTILINE))
    for command in {s for page in pages() for s in spans(page) if re.match(r"make \w", s)}:
        assert {word for word in command.split()[1:] if "=" not in word} <= targets, command


def test_the_messages_of_troubleshooting_are_messages_of_the_package() -> None:
    others = r"ros2|1e6|late_forces|workers"
    cells = re.findall(r"^\| ([^|]*) \|", text_of("docs/troubleshooting.md"), re.MULTILINE)
    quoted = [message for cell in cells for message in re.findall("`([^`]+)`", cell)]
    messages = [message for message in quoted if not re.match(others, message)]
    assert len(messages) > 10
    texts = list(texts_of_the_package())
    for message in messages:
        pieces = [piece.strip() for piece in message.split("…") if piece.strip()]
        near = [text for text in texts if pieces[0] in text]
        assert any(re.search(".*".join(map(re.escape, pieces)), text) for text in near), message


def texts_of_the_package() -> list[str]:
    """Texts in the package, with … for what is filled in, and the Makefile."""
    found = [text_of("Makefile")]
    for file in (CHECKOUT / "stickslip_ros").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            parts = node.values if isinstance(node, ast.JoinedStr) else [node]
            values = [part.value if isinstance(part, ast.Constant) else None for part in parts]
            found.append("".join(value if isinstance(value, str) else "…" for value in values))
    return found


def test_every_guarantee_names_a_test_that_exists() -> None:
    lines = [line for line in text_of("docs/reliability.md").splitlines() if line[:1] == "|"]
    rows = [line for line in lines if not re.match(r"\| *(guarantee|---)", line)]
    assert len(rows) > 50
    for row in rows:
        guarantee, test = (cell.strip() for cell in re.split(r"(?<!\\)\|", row)[1:-1])
        assert guarantee
        assert re.fullmatch(r"`(reproduction/)?tests/[\w/]+\.py::test_\w+`", test), test
        assert exists(test.strip("`")), test


def test_every_slow_test_that_is_listed_exists() -> None:
    for test in listed():
        assert exists(test), f"{test}: run `make slow`"


@cache
def functions(path: str) -> set[str]:
    return {
        node.name for node in ast.parse(text_of(path)).body if isinstance(node, ast.FunctionDef)
    }


def exists(test: str) -> bool:
    """Whether a module of tests has a function of that name."""
    path, _, name = test.partition("::")
    return (CHECKOUT / path).is_file() and name in functions(path)


def test_public_names_exist_once_and_have_docstrings() -> None:
    names = public_names()
    assert len(names) == len(set(names))
    found = {
        name: getattr(import_module(name.rpartition(".")[0]), name.rpartition(".")[2])
        for name in names
    }
    for name, value in found.items():
        assert not (isinstance(value, type) or callable(value)) or value.__doc__, name
    listed = {id(value) for value in found.values()}
    for name in stickslip_ros.__all__:
        assert name == "__version__" or id(getattr(stickslip_ros, name)) in listed, name
