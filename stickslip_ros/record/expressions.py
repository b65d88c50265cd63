"""Expressions of columns and numbers, as in `--columns position=cmd-x,time=sec+nanosec*1e-9`."""

import ast
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.text import did_you_mean, shown

_LONGEST = 1000
"""Characters of the longest expression; the longest list of columns in a message."""

_OPERATIONS: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.UAdd: np.positive,
    ast.USub: np.negative,
}
_SUMS = (ast.Name, ast.Load, ast.UnaryOp, ast.BinOp, ast.Add, ast.Sub, ast.UAdd, ast.USub)
_NUMBERS = {"nan": np.nan, "inf": np.inf}
_KNOWN = (*_NUMBERS, "unwrap", "cumsum")
_ALLOWED = (
    "must be columns and numbers with + - * /, brackets, unwrap(column, turn) and cumsum(column); "
    "other names go into quotes"
)


def parts_of(text: str) -> list[str]:
    """Split a list at its commas, but not at those in brackets and quotes."""
    parts, depth, quote = [""], 0, ""
    for character in text:
        if quote or character in "'\"":
            quote = character if not quote else "" if character == quote else quote
        else:
            depth = max(0, depth + (character in "([") - (character in ")]"))
        if character == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += character
    return parts


@dataclass(frozen=True)
class Expression:
    """An expression of columns of a table."""

    text: str
    bare: bool
    """Whether it is a column, or a sum or difference of columns: a number in it converts it."""
    places: tuple[int, ...]
    """The columns in it."""
    _tree: ast.expr

    @classmethod
    def read(cls, source: object, text: str, columns: Mapping[str, int]) -> "Expression":
        """Return the expression in a text; `columns` has the places of columns by name.

        The exact name of a column is that column, whatever characters it has. Raises
        InvalidInputError, which names the `source`, for a text that is no expression.
        """
        name = text.strip()
        if name[:1] == "#" and name not in columns:  # of a comment, in which the names are
            name = name[1:].strip() if name[1:].strip() in columns else name
        if name in columns:
            return cls(text, True, (columns[name],), ast.Name("_0"))
        places: dict[int, str] = {}

        def placed(match: re.Match[str]) -> str:
            name = match[0] if match[0] in columns or match[0][0] == "#" else match[0][1:-1]
            if name not in columns:
                raise InvalidInputError(_unknown(source, name, columns))
            return places.setdefault(columns[name], f" _{len(places)} ")

        try:
            if len(text) > _LONGEST:
                raise ValueError(text)
            tree = ast.parse(_pattern(columns, text).sub(placed, text).strip(), mode="eval").body
            by_name = {name.strip(): place for place, name in places.items()}
            for node in ast.walk(tree):
                if isinstance(node, ast.Name) and node.id not in {*by_name, *_KNOWN}:
                    raise InvalidInputError(_unknown(source, node.id, columns))
            bare = all(isinstance(node, _SUMS) for node in ast.walk(tree))
            expression = cls(text, bare and bool(places), tuple(places), tree)
            expression.value([np.zeros(1)] * len(places))
        except (MemoryError, RecursionError, SyntaxError, TypeError, ValueError) as error:
            if isinstance(error, InvalidInputError):
                raise
            raise InvalidInputError(
                f"{source}: the expression {shown(text)} is invalid: {_ALLOWED}; the columns are "
                f"{listed(columns)}"
            ) from None
        return expression

    def value(self, values: list[FloatArray]) -> FloatArray:
        """Return the value for the `values` of the columns, in the order of `places`."""
        named = {f"_{number}": column for number, column in enumerate(values)}
        with np.errstate(all="ignore"):
            return _value(self._tree, named)


def _value(node: ast.AST, named: Mapping[str, Any]) -> Any:
    """Evaluate a node; ValueError if it is none of those that are allowed."""
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.float64(str(number))
        case ast.Name(id=name) if name in named or name in _NUMBERS:
            return named[name] if name in named else np.float64(_NUMBERS[name])
        case ast.UnaryOp(op=operator, operand=operand) if type(operator) in _OPERATIONS:
            return _OPERATIONS[type(operator)](_value(operand, named))
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATIONS:
            return _OPERATIONS[type(operator)](_value(left, named), _value(right, named))
        case ast.Call(func=ast.Name(id="unwrap"), args=[counter, turn], keywords=[]):
            return _unwrapped(_value(counter, named), _value(turn, named))
        case ast.Call(func=ast.Name(id="cumsum"), args=[column], keywords=[]):
            return np.nancumsum(_value(column, named))
        case _:
            raise ValueError(ast.dump(node))


def _unwrapped(counter: Any, turn: Any) -> Any:
    """Return a counter without its jumps by a whole turn; cells without a number are passed by."""
    if np.ndim(turn) or not 0.0 < turn < np.inf:
        raise ValueError("the turn must be a positive number")
    if not np.ndim(counter):
        return counter
    unwrapped = np.array(counter, dtype=np.result_type(counter, np.float64))
    known = np.isfinite(unwrapped)
    unwrapped[known] = np.unwrap(unwrapped[known], period=turn)
    return unwrapped


def _pattern(columns: Mapping[str, int], text: str) -> re.Pattern[str]:
    """Return what finds quoted names, places and the names of columns, the longest first."""
    names = [name for name in columns if name in text and _may_stand(name)]
    names.sort(key=len, reverse=True)
    before, after = r"(?<![\w.])(?=\w)|(?=\W)", r"(?<=\w)(?![\w(])|(?<=\W)"
    known = [f"(?:{before}){re.escape(name)}(?:{after})" for name in names]
    return re.compile("|".join(["'[^']*'", '"[^"]*"', *known, r"#\d+"]))


def _may_stand(name: str) -> bool:
    """Return whether a name is one without quotes: a number or a mark stands for itself."""
    try:
        float(name)
    except ValueError:
        return any(map(str.isalpha, name))
    return False


def _unknown(source: object, name: str, columns: Mapping[str, int]) -> str:
    hint = did_you_mean(name, names_of(columns), f"has {listed(columns)}")
    return f"{source} has no column {shown(name)}; {hint}"


def names_of(columns: Mapping[str, int]) -> list[str]:
    """Return the names of columns without the places, such as #1, of those that have one."""
    return [name for name in columns if name[:1] != "#"] or [*columns]


def listed(columns: Mapping[str, int]) -> str:
    """Return the names of columns for a message."""
    return ", ".join(names_of(columns))[:_LONGEST]
