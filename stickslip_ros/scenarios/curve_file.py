"""Reading a measured curve: a CSV file of pairs of numbers."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.files import open_regular
from stickslip_ros.model.constants import LARGEST
from stickslip_ros.text import shown

_LARGEST_FILE = 1_000_000
"""Largest size of a file, bytes."""

Pairs = tuple[tuple[float, float], ...]

CURVES = "stickslip_ros/curves"
"""Name of the table of a bag that has the pairs of each file, by its path."""


def read_curve(
    name: str,
    path: str,
    refusal: Callable[[Pairs], str | None],
    known: dict[str, Pairs] | None = None,
) -> Pairs:
    """Return the pairs of numbers in the file of a parameter; see `read_pairs`.

    A file whose pairs are `known`, by path, is not read, and one that is read is known then. Raises
    ValueError, as a validator does, with a sentence that names the parameter: if the file cannot be
    read, or if there is a `refusal` of its pairs.
    """
    known = {} if known is None else known
    try:
        if path not in known:
            known[path] = read_pairs(path)
        reason = refusal(known[path])
    except InvalidInputError as error:
        reason = str(error)
    if reason is not None:
        raise ValueError(f"{name} = {shown(path)} is refused: {reason}")
    return known[path]


def read_pairs(path: str) -> Pairs:
    """Return the pairs of numbers in a CSV file, one on each line.

    Empty lines and lines that start with # are skipped, and so is a first line of names. Raises
    InvalidInputError with the reason, which does not name the file.
    """
    lines = [
        (number, line)
        for number, line in enumerate(_text(Path(path)).splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if lines and not any(_number(cell) is not None for cell in lines[0][1].split(",")):
        del lines[0]
    if not lines:
        raise InvalidInputError("the file has no numbers: must have two on each line")
    return tuple(_pair(number, line) for number, line in lines)


def as_pairs(values: Any) -> Pairs:
    """Return pairs that JSON holds as lists; raises ValueError if they are anything else."""
    try:
        pairs = tuple((float(first), float(second)) for first, second in values)
    except (TypeError, OverflowError) as error:
        raise ValueError(str(error)) from None
    if not all(abs(value) <= LARGEST for pair in pairs for value in pair):
        raise ValueError("a number is too large")
    return pairs


def _text(path: Path) -> str:
    try:
        with open_regular(path) as file:
            data = file.read(_LARGEST_FILE + 1)
        if len(data) > _LARGEST_FILE:
            raise InvalidInputError(f"the file must have at most {_LARGEST_FILE} bytes")
        return data.decode("utf-8-sig")
    except (OSError, ValueError) as error:  # ValueError: not UTF-8, or a path with a null character
        reason = getattr(error, "strerror", None) or error
        if isinstance(error, UnicodeError):
            reason = "it is not UTF-8 text"
        raise InvalidInputError(f"the file cannot be read: {reason}") from None


def _pair(number: int, line: str) -> tuple[float, float]:
    values = [_number(cell) for cell in line.split(",")]
    if len(values) != 2 or values[0] is None or values[1] is None:
        # Another file may have named this one: what is in it stays there.
        raise InvalidInputError(f"line {number} must be two numbers with a comma between")
    return values[0], values[1]


def _number(cell: str) -> float | None:
    """Return a number that no product or power in the physics overflows, or None."""
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if abs(value) <= LARGEST else None
