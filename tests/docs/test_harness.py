"""A block that would not be run, and an output that is not the expected one, are noticed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs import ros2
from tests.docs.page import DIRECTIVES, Block, Directives, directives_file, parse
from tests.docs.test_pages import check_output, in_a_row


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("```bash\nls\n```\n", "'bash' is none of"),
        ("```\nls\n```\n", "'' is none of"),
        ("Text:\n\n    ls\n", "an indented block"),
        ("<!-- test: output -->\n```sh\nls\n```\n", "a directive outside docs/blocks"),
    ],
)
def test_a_page_with_a_block_that_would_not_be_run_is_refused(text: str, said: str) -> None:
    with pytest.raises(AssertionError, match=said):
        list(parse("page.md", text, {}))


PAGE = """\
# One

```sh
ls
```

# `Two`

- Item:

  ```sh
  echo 2
  ```

# One

```sh
ls
```
"""


@pytest.mark.parametrize(
    ("directives", "said"),
    [
        ({"One": {"1": ["lnog"]}}, "'lnog' is none of the directives"),
        ({"One": {"1": ["file"]}}, "'file' is incomplete"),
        ({"One": {"1": ["not because"]}}, "'not because' is incomplete"),
        ({"One": {"2": ["output"]}}, r"without a block: \[\('One', '2'\)\]"),
        ({"One": {"first": ["output"]}}, r"without a block: \[\('One', 'first'\)\]"),
        ({"Three": {"1": ["output"]}}, r"without a block: \[\('Three', '1'\)\]"),
        ({"One (3)": {"1": ["output"]}}, r"without a block: \[\('One \(3\)', '1'\)\]"),
    ],
)
def test_directives_that_would_have_no_effect_are_refused(
    directives: Directives, said: str
) -> None:
    with pytest.raises(AssertionError, match=said):
        list(parse("page.md", PAGE, directives))


@pytest.mark.parametrize(
    ("heading", "number", "line"), [("One", 0, 3), ("`Two`", 1, 11), ("One (2)", 2, 17)]
)
def test_directives_go_to_the_block_that_they_name(heading: str, number: int, line: int) -> None:
    found = list(parse("page.md", PAGE, {heading: {"1": ["with 1 for 2", "output"]}}))
    assert [block.directives for block in found if block.directives] == [
        {"with": ["1 for 2"], "output": [""]}
    ]
    assert found[number].directives
    assert found[number].line == line


def test_a_replacement_changes_what_is_run() -> None:
    assert Block("page.md", 1, "sh", "echo 2\n", {"with": ["1 for 2"]}).to_run == "echo 1\n"


def test_the_readme_and_the_index_of_the_docs_have_files_of_their_own() -> None:
    assert directives_file("README.md") == DIRECTIVES / "README.toml"
    assert directives_file("docs/README.md") == DIRECTIVES / "docs" / "README.toml"
    assert directives_file("docs/how-to/colcon.md") == DIRECTIVES / "how-to" / "colcon.toml"


def test_a_replacement_for_what_is_not_there_is_refused() -> None:
    block = Block("page.md", 2, "sh", "echo 2\n", {"with": ["1 for 3"]})
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
