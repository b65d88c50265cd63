"""Docstrings: their examples run, and those of the public API document every parameter."""

import ast
import doctest
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib import import_module
from typing import Any

import pytest

from stickslip_ros.model.constants import constants_of
from tests.docs.page import CHECKOUT, public_names

_SECTION = re.compile(r"^Parameters\n-+\n(.*?)(?=^\w+\n-+$|\Z)", re.MULTILINE | re.DOTALL)


def modules_with_examples() -> list[str]:
    files = sorted((CHECKOUT / "stickslip_ros").rglob("*.py"))
    found = [file for file in files if ">>> " in file.read_text(encoding="utf-8")]
    names = [".".join(file.relative_to(CHECKOUT).with_suffix("").parts) for file in found]
    return [name.removesuffix(".__init__") for name in names]


@pytest.mark.long
def test_the_examples_print_what_they_show(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(CHECKOUT)
    assert modules_with_examples()
    for module in modules_with_examples():
        result = doctest.testmod(import_module(module), optionflags=doctest.ELLIPSIS)
        assert result.attempted > 0, module
        assert result.failed == 0, module


def test_every_parameter_is_documented() -> None:
    for name in public_names():
        for label, given, documented in documented_parameters(name):
            assert documented == given, label


def documented_parameters(name: str) -> Iterator[tuple[str, list[str], list[str]]]:
    """Callables below a public name: name, parameters, and documented parameters."""
    module, _, own_name = name.rpartition(".")
    found = getattr(import_module(module), own_name)
    if inspect.isfunction(found):
        yield name, parameters(found), section(found)
    if not inspect.isclass(found):
        return
    if is_own_constructor(found):
        documented = section(found) or section(found.__init__)
        yield name, parameters(found), documented or attributes_of(found)
    for member, value in vars(found).items():
        method: Any = getattr(value, "__func__", value)
        if inspect.isfunction(method) and not member.startswith("_"):
            yield (
                f"{name}.{member}",
                parameters(getattr(found, member)),
                documented_of(found, member),
            )


def documented_of(found: type, member: str) -> list[str]:
    """The parameters that a method documents, or the one that it overrides or refers to."""
    for each in found.__mro__:
        if member in vars(each):
            method = getattr(vars(each)[member], "__func__", vars(each)[member])
            said = method.__doc__
            if said and (f".{member}`." not in said or section(method)):
                return section(method)
    return []


def is_own_constructor(found: type) -> bool:
    """Whether a class is constructed in a way that it defines itself."""
    if issubclass(found, Enum):
        return False
    return is_dataclass(found) or hasattr(found, "_fields") or is_of_package(found.__init__)


def is_of_package(found: Callable[..., Any]) -> bool:
    return (getattr(found, "__module__", None) or "").startswith("stickslip_ros.")


def parameters(found: Callable[..., Any]) -> list[str]:
    if inspect.isclass(found) and is_dataclass(found):
        return [field.name for field in fields(found) if field.init]
    return [name for name in inspect.signature(found).parameters if name != "self"]


def section(found: Any) -> list[str]:
    """The names in the Parameters section of a docstring."""
    matched = _SECTION.search(inspect.getdoc(found) or "")
    lines = matched[1].splitlines() if matched else []
    heads = [line.split(" : ")[0] for line in lines if line and not line.startswith(" ")]
    return [name.strip("* ") for head in heads for name in head.split(",")]


def attributes_of(found: type) -> list[str]:
    """The fields of a class and its bases that a docstring follows, or that have a meaning."""
    documented = [*constants_of(found)] if is_dataclass(found) else []
    for each in reversed(found.__mro__):
        if not is_of_package(each):
            continue
        (definition,) = ast.parse(textwrap.dedent(inspect.getsource(each))).body
        assert isinstance(definition, ast.ClassDef)
        for statement, after in zip(definition.body, definition.body[1:], strict=False):
            if isinstance(statement, ast.AnnAssign) and isinstance(after, ast.Expr):
                documented.append(ast.unparse(statement.target))
    return [name for name in parameters(found) if name in documented]
