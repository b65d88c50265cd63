"""docs/studies.md: the commands on it are taken, and the Python on it runs."""

import re
import shlex
from pathlib import Path

import pytest

from stickslip_ros.app.main import _parser

PAGE = (Path(__file__).parents[2] / "docs" / "studies.md").read_text(encoding="utf-8")
# Those of clusters need a cluster.
BLOCKS = [
    block
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    if "stickslip_ros" in block
]
COMMANDS = [
    line
    for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)
    for line in block.replace("\\\n", "").splitlines()
    if line.startswith("stickslip ")
]


@pytest.mark.parametrize("command", COMMANDS)
def test_the_commands_are_taken(command: str) -> None:
    arguments = shlex.split(command)[1:]
    parsed = _parser(arguments).parse_args(arguments)
    assert parsed.command == arguments[0]


@pytest.mark.parametrize(
    ("block", "said"),
    [
        (BLOCKS[0], ["sticks up to 0.43 m/s", "largest amplitude 0.441 m"]),
        (BLOCKS[1], ["pure_slip: 1.00 ± 0.00"]),
    ],
)
def test_the_python_does_what_it_says(
    block: str, said: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    exec(compile(block, "docs/studies.md", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out.splitlines() == said
    assert len(BLOCKS) == 2
