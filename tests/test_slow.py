"""The list of slow tests, and the plugin that makes and checks it."""

from math import inf
from pathlib import Path

import pytest

from tests import slow

pytest_plugins = ["pytester"]

TESTS = """
import time
import pytest

def work():
    end = time.process_time() + 0.1
    while time.process_time() < end:
        pass

@pytest.fixture(scope="module")
def shared():
    work()

def test_slow():
    work()

@pytest.mark.parametrize("number", (1, 2))
def test_of_what_is_slow(shared, number):
    pass

def test_quick():
    if "first" not in globals():  # as an import does
        globals()["first"] = work()

@pytest.mark.process
def test_in_a_process():
    work()
"""


def test_names_tests_that_exist() -> None:
    for line in slow.LIST.read_text(encoding="utf-8").splitlines():
        file, _, function = line.partition("::")
        text = (Path(__file__).parents[1] / file).read_text(encoding="utf-8")
        assert f"def {function.rpartition('::')[2]}(" in text, f"{line}: run `make slow`"


def test_lists_what_is_slow_and_fails_what_is_not_listed(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(slow, "LIST", pytester.path / "slow.txt")
    for name, value in {"LIMIT": 0.02, "FAR": 2.0, "LOOP": inf}.items():  # on any processor
        monkeypatch.setattr(slow, name, value)
    pytester.makeini("[pytest]\nmarkers = process")
    pytester.makepyfile(test_it=TESTS)
    pytester.runpytest("-p", "tests.slow").assert_outcomes(passed=5)
    names = slow.LIST.read_text(encoding="utf-8").splitlines()
    assert names == ["test_it.py::test_of_what_is_slow", "test_it.py::test_slow"]

    slow.LIST.write_text(f"{names[0]}\n", encoding="utf-8")
    slow.listed.cache_clear()
    result = pytester.runpytest("-p", "tests.slow", "--slow-tests=known")
    result.assert_outcomes(passed=5, errors=1)
    result.stdout.fnmatch_lines("*ERROR test_it.py::test_slow*")
    slow.listed.cache_clear()
