"""Every block of README and docs does what it says: page.py describes how it is run."""

import re
from collections.abc import Generator
from contextlib import ExitStack
from itertools import groupby
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from stickslip_ros.nodes.base.network import environment, own_domain, this_machine_only
from stickslip_ros.scenarios.files import load_scenario
from tests.docs.page import CHECKOUT, DIRECTIVES, Block, blocks, directives_file, pages
from tests.docs.shell import Shell

PAGES = [
    page
    for page in pages()
    if re.search(r"^\s*```(?!text)\w", (CHECKOUT / page).read_text(), re.MULTILINE)
]

PATIENCE = 1200.0
"""Time limit of a block, s."""

# Printed on standard error with status 0, by `ros2` and by its stand-in.
REFUSALS = ("Setting parameter failed", "Transitioning failed")


@pytest.fixture
def shell(tmp_path: Path) -> Generator[Shell]:
    with environment(this_machine_only()), own_domain() as domain:
        yield Shell(tmp_path, domain)


@pytest.mark.long
@pytest.mark.timeout(2 * PATIENCE)
@pytest.mark.parametrize("page", PAGES)
def test_the_blocks_of_a_page_run(page: str, shell: Shell) -> None:
    run(blocks(page), shell)


def test_every_page_has_blocks_that_are_known_and_every_file_of_directives_a_page() -> None:
    parsed = {directives_file(page): blocks(page) for page in pages()}
    assert {*DIRECTIVES.rglob("*.toml")} <= parsed.keys()


def run(page: list[Block], shell: Shell) -> None:
    """Run blocks in order; successive blocks beside the same commands share them."""
    said: list[str] = []
    for needed, group in in_a_row(page):
        with ExitStack() as terminals:
            try:
                for command in needed:
                    terminals.enter_context(shell.beside(command))
            except AssertionError as error:
                raise AssertionError(f"beside {group[0].place}: {error}") from error
            for block in group:
                run_block(block, page, shell, said)


def in_a_row(page: list[Block]) -> list[tuple[list[str], list[Block]]]:
    """The blocks in groups beside the same commands; a `text` belongs to the group before it."""
    groups: list[tuple[list[str], list[Block]]] = []
    for block in page:
        needed = block.directives.get("beside", [])
        if groups and (block.language == "text" or needed == groups[-1][0]):
            groups[-1][1].append(block)
        else:
            groups.append((needed, [block]))
    return groups


def run_block(block: Block, page: list[Block], shell: Shell, said: list[str]) -> None:
    """Run one block; `said` holds the output of the block before, and then that of this block."""
    if "not because" in block.directives:
        return
    if "file" in block.directives:
        save(block, page, shell)
    try:
        if block.language == "text":
            if "output" in block.directives:
                check_output(block.text, said[0])
            return
        later = page[page.index(block) + 1 :]
        if any(name in each.text for name in block.directives.get("file", []) for each in later):
            return
        said[:] = [RUNNERS[block.language](block, shell)]
        if not any("output" in each.directives for each in later[:1]):
            assert not any(refusal in said[0] for refusal in REFUSALS), said[0]
    except Exception as error:
        raise AssertionError(f"{block.place}: {error}\n{block.text}") from error


def save(block: Block, page: list[Block], shell: Shell) -> None:
    (name,) = block.directives["file"]
    stem = Path(name).stem
    later = page[page.index(block) + 1 :]
    is_test = block.language == "python" and "def test_" in block.text
    used = is_test or any(
        stem in "\n".join([b.to_run, *b.directives.get("after", [])]) for b in later
    )
    assert used, f"{block.place}: {name} is saved but not used"
    for kept in (CHECKOUT / name, CHECKOUT / "examples" / name):
        if kept.is_file():
            assert kept.read_text(encoding="utf-8") == block.text, f"{block.place}: not {kept}"
    shell.path(name).parent.mkdir(parents=True, exist_ok=True)
    shell.path(name).write_text(block.to_run, encoding="utf-8")


def check_output(expected: str, said: str) -> None:
    lines = [line.rstrip() for line in said.splitlines()]
    pattern = re.escape(expected.rstrip()).replace("…", ".*")
    assert re.search(f"(?m:^){pattern}(?m:$)", "\n".join(lines), re.DOTALL), f"not in:\n{said}"


def run_sh(block: Block, shell: Shell) -> str:
    if "new shell" in block.directives:
        shell.renew()
    if "in terminals" in block.directives:
        with ExitStack() as terminals:
            for line in commands(block):
                terminals.enter_context(shell.beside(line))
        return ""
    prefixes = block.directives.get("until Ctrl-C", [])
    said = ""
    for endless, lines in groupby(
        commands(block) if prefixes else [block.to_run],
        key=lambda line: any(line.startswith(prefix) for prefix in prefixes),
    ):
        if endless:
            for line in lines:
                with shell.beside(line):
                    pass
        else:
            said += run_script("\n".join(lines), shell)
    return said


def run_script(script: str, shell: Shell) -> str:
    status, said = shell.run(script, PATIENCE)
    assert status == 0, f"ended with status {status}:\n{said}"
    return said


def commands(block: Block) -> list[str]:
    """The commands of an `sh` block, without comments."""
    lines = re.sub(r"\\\n\s*", "", block.to_run).splitlines()
    return [line for line in (re.sub(r"(^|\s)#.*", "", line).strip() for line in lines) if line]


def run_python(block: Block, shell: Shell) -> str:
    is_test = "def test_" in block.text
    if "file" in block.directives and not is_test:
        return ""
    name = block.directives.get("file", [f"{'test_' if is_test else ''}line_{block.line}.py"])[0]
    code = "\n".join([*block.directives.get("after", []), block.to_run])
    shell.path(name).write_text(code, encoding="utf-8")
    how = "-m pytest -q -c /dev/null" if is_test else ""
    return run_script(f"python {how} {name}", shell)


def run_yaml(block: Block, shell: Shell) -> str:
    yaml.safe_load(block.to_run)
    if "ros__parameters" in block.text:
        name = block.directives.get("file", [f"line_{block.line}.yaml"])[0]
        shell.path(name).write_text(block.to_run, encoding="utf-8")
        load_scenario(str(shell.path(name)))
    return ""


def run_xml(block: Block, _: Shell) -> str:
    ElementTree.fromstring(block.to_run)
    return ""


RUNNERS = {"sh": run_sh, "python": run_python, "yaml": run_yaml, "xml": run_xml}
