"""The list of slow tests, and the plugin that makes and checks it."""

from pathlib import Path

from tests import slow


def test_names_tests_that_exist() -> None:
    for line in slow.LIST.read_text(encoding="utf-8").splitlines():
        file, _, function = line.partition("::")
        text = (Path(__file__).parents[1] / file).read_text(encoding="utf-8")
        assert f"def {function.rpartition('::')[2]}(" in text, f"{line}: run `make slow`"
