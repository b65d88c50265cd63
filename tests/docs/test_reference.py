"""docs/reference: the pages name what is public, and nothing that does not exist."""

import re
from importlib import import_module

import pytest

import stickslip_ros
from tests.docs.page import CHECKOUT

PAGES = sorted((CHECKOUT / "docs/reference").glob("*.md"))
NAMES = [
    name
    for page in PAGES
    for name in re.findall(r"^::: (\S+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
]


def found(name: str) -> object:
    module, _, attribute = name.rpartition(".")
    return getattr(import_module(module), attribute)


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_exists_and_has_a_docstring(name: str) -> None:
    value = found(name)
    assert not isinstance(value, type) or value.__doc__
    assert not callable(value) or value.__doc__


def test_no_name_is_listed_twice() -> None:
    assert len(NAMES) == len(set(NAMES))


def test_all_names_of_the_package_are_on_the_pages() -> None:
    listed = {id(found(name)) for name in NAMES}
    names = [name for name in stickslip_ros.__all__ if name != "__version__"]
    assert [name for name in names if id(getattr(stickslip_ros, name)) not in listed] == []
