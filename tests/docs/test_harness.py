"""A block that would not be run, and an output that is not the expected one, are noticed."""

import pytest

from tests.docs.page import Block, parse
from tests.docs.test_pages import check_output, in_a_row

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


def test_a_page_with_a_block_that_would_not_be_run_is_refused() -> None:
    for text, said in (
        ("```bash\nls\n```\n", "'bash' is none of"),
        ("```\nls\n```\n", "'' is none of"),
        ("Text:\n\n    ls\n", "an indented block"),
        ("<!-- test: output -->\n```sh\nls\n```\n", "a directive outside docs/blocks"),
    ):
        with pytest.raises(AssertionError, match=said):
            list(parse("page.md", text, {}))


def test_directives_that_would_have_no_effect_are_refused() -> None:
    for heading, number, directive, said in (
        ("One", "1", "lnog", "'lnog' is none of the directives"),
        ("One", "1", "file", "'file' is incomplete"),
        ("One", "2", "output", r"without a block: \[\('One', '2'\)\]"),
        ("Three", "1", "output", r"without a block: \[\('Three', '1'\)\]"),
        ("One (3)", "1", "output", r"without a block: \[\('One \(3\)', '1'\)\]"),
    ):
        with pytest.raises(AssertionError, match=said):
            list(parse("page.md", PAGE, {heading: {number: [directive]}}))


def test_directives_go_to_the_block_that_they_name() -> None:
    for number, heading in enumerate(("One", "`Two`", "One (2)")):
        found = list(parse("page.md", PAGE, {heading: {"1": ["with 1 for 2", "output"]}}))
        directed = {"with": ["1 for 2"], "output": [""]}
        assert [block.directives for block in found] == [
            directed if block is found[number] else {} for block in found
        ]
        assert found[number].line == (3, 11, 17)[number]


def test_a_replacement_changes_what_is_run_or_is_refused() -> None:
    assert Block("page.md", 1, "sh", "echo 2\n", {"with": ["1 for 2"]}).to_run == "echo 1\n"
    block = Block("page.md", 2, "sh", "echo 2\n", {"with": ["1 for 3"]})
    with pytest.raises(AssertionError, match=r"page\.md:2: no '3' in it"):
        assert block.to_run


def test_whole_lines_of_the_output_are_what_is_expected() -> None:
    said = "one\ntwo\nthree\n"
    for expected in ("two\n", "one\n…\nthree", "th…"):
        check_output(expected, said)
    for expected in ("tw", "one\nthree", "four", "…four"):
        with pytest.raises(AssertionError):
            check_output(expected, said)


def test_output_between_blocks_does_not_end_what_runs_beside_them() -> None:
    beside = {"beside": ["a"]}
    page = [
        Block("page.md", 1, "sh", "1", beside),
        Block("page.md", 2, "text", "2", {"output": [""]}),
        Block("page.md", 3, "sh", "3", beside),
        Block("page.md", 4, "sh", "4"),
    ]
    assert in_a_row(page) == [(["a"], page[:3]), ([], page[3:])]
