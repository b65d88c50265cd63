"""What nobody would run, or what does not come true, is noticed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs import ros2
from tests.docs.page import Block, parse
from tests.docs.test_pages import check_output, in_a_row


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("```bash\nls\n```\n", "'bash' is none of"),
        ("```\nls\n```\n", "'' is none of"),
        ("Text:\n\n    ls\n", "an indented block"),
        ("<!-- test: lnog -->\n```sh\nls\n```\n", "no directive 'lnog'"),
        ("<!-- test: file -->\n```sh\nls\n```\n", "'file' lacks something"),
        ("<!-- test: not because -->\n```sh\nls\n```\n", "'not because' lacks something"),
        ("<!-- test: output -->\nText.\n\n```sh\nls\n```\n", "a directive without a block"),
        ("```sh\nls\n```\n\n<!-- test: output -->\n", "a directive without a block at the end"),
    ],
)
def test_what_nobody_would_run_is_refused(text: str, said: str) -> None:
    with pytest.raises(AssertionError, match=said):
        list(parse("page.md", text))


def test_directives_go_with_the_block_below_them_in_a_list_too() -> None:
    lines = ["<!-- test: with 1 for 2 -->", "<!-- test: output -->", "```sh", "echo 2", "```"]
    (block,) = parse("page.md", "\n  ".join(["- Item:\n", *lines]))
    assert block == Block("page.md", 5, "sh", "echo 2\n", {"with": ["1 for 2"], "output": [""]})
    assert block.to_run == "echo 1\n"


def test_a_replacement_for_what_is_not_there_is_refused() -> None:
    (block,) = parse("page.md", "<!-- test: with 1 for 3 -->\n```sh\necho 2\n```\n")
    with pytest.raises(AssertionError, match=r"page\.md:2: no '3' in it"):
        assert block.to_run


@pytest.mark.parametrize("expected", ["two\n", "one\n…\nthree", "th…"])
def test_whole_lines_of_the_output_are_what_is_expected(expected: str) -> None:
    check_output(expected, "one\ntwo\nthree\n")


@pytest.mark.parametrize("expected", ["tw", "one\nthree", "four", "…four"])
def test_what_is_not_said_is_noticed(expected: str) -> None:
    with pytest.raises(AssertionError):
        check_output(expected, "one\ntwo\nthree\n")


@pytest.mark.process
@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["topic", "frob"], "invalid choice: 'frob'"),
        (["topic", "pub", "--nonsense", "/t", "std_msgs/msg/Header"], "unrecognized arguments"),
        (["topic", "pub", "/t", "std_msgs/msg/Nothing", "{}"], "message type is invalid"),
        (["topic", "pub", "/t", "std_msgs/msg/Header", "{nothing: 1}"], "no attribute 'nothing'"),
        (["service", "call", "/s", "std_srvs/srv/SetBool", "{date: true}"], "no attribute 'date'"),
        (["run", "nothing", "nothing"], "Package 'nothing' not found"),
        (["run", "stickslip_ros", "nothing"], "No executable found"),
    ],
)
def test_the_stand_in_for_ros2_refuses_what_does_not_exist(arguments: list[str], said: str) -> None:
    command = [sys.executable, str(Path(ros2.__file__)), *arguments]
    environment = os.environ | {"AMENT_PREFIX_PATH": sys.prefix}
    refused = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert refused.returncode in (1, 2)
    assert said in refused.stderr


def test_output_between_blocks_does_not_end_what_runs_beside_them() -> None:
    beside = {"beside": ["a"]}
    page = [
        Block("page.md", 1, "sh", "1", beside),
        Block("page.md", 2, "text", "2", {"output": [""]}),
        Block("page.md", 3, "sh", "3", beside),
        Block("page.md", 4, "sh", "4"),
    ]
    assert in_a_row(page) == [(["a"], page[:3]), ([], page[3:])]
