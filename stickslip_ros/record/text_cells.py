"""What the cells of a column as text mean: numbers with their marks, or instants."""

import re
import warnings
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.record.header_units import are_units

GROUPED = r"(?:(?<=\d)(?<!\d{4})['\u2019\xa0\u202f ](?=\d{3}(?!\d)))"
"""Marks between thousands that are no decimal marks."""
NUMBER = re.compile(
    rf"[-+]?(?:\d+(?:{GROUPED}\d{{3}})*(?:[.,]\d+)*\.?|[.,]\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|infinity)",
    re.IGNORECASE,
)
_CLOCK = r"\d{1,2}:\d\d(?::\d\d(?:[.,:]\d+|;\d{3})?|[.,]\d+)?"
TIME = re.compile(
    rf"(?P<date>\d{{1,4}}([-./])\d{{1,2}}\2\d{{1,4}})(?:,?[T ] ?{_CLOCK})?"
    rf"(?: ?[AP]M)?(?: ?Z|[+-]\d\d(?::?\d\d)?)?|{_CLOCK}(?: ?[AP]M)?",
    re.IGNORECASE,
)
"""A time of day, or a date with or without one."""
_LOOK = 10
"""Cells by which a column has times."""
_DAY = 86_400.0
_COMMAS = {",": "decimal commas"}


def unit_of(cell: str) -> str:
    """Return the unit behind the number in a cell, or nothing."""
    unit = cell.lstrip("0123456789.,+-eE'\u2019\xa0\u202f ")
    number = cell[: len(cell) - len(unit)]
    return unit if NUMBER.fullmatch(number.strip()) and are_units([unit]) else ""


class OtherMarkError(Exception):
    """A decimal mark is not what it was taken for; its text is the mark."""


def values_of(cells: Any, decimal: str, given: str | None) -> tuple[Any, dict[str, str]]:
    """Return numbers, or instants, of a column as pandas has read it, and what marks were read as.

    `decimal` is the mark of the table as far as it is known, and `given` one that the user gave: by
    this the other one groups digits. Raises OtherMarkError.
    """
    import pandas as pd

    if cells.dtype.kind in "iuf":
        return np.array(cells), _COMMAS if cells.dtype.kind == "f" and decimal == "," else {}
    if cells.dtype.kind == "b":
        return np.full(len(cells), np.nan), {}
    text = cells.astype(str).str.strip(" \t'\"")
    if unit := unit_of(next(iter(text.dropna()), "")):
        text = text.str.removesuffix(unit).str.rstrip()
    instant = next(filter(None, map(TIME.fullmatch, text.dropna()[:_LOOK])), None)
    if instant is not None:
        return _instants(text, instant), {}
    spaced = next(iter(text[text.str.contains(r"\d \d{3}", na=False)]), None)
    text = text.str.replace(GROUPED, "", regex=True)
    if given is None:
        grouped = ((".", r",\d*[.,]"), (",", r"\.\d*[.,]"))  # commas, or points, group digits
        others = (mark for mark, pattern in grouped if text.str.contains(pattern).any())
        points = decimal == "," and text.str.contains(".", regex=False).any()
        if mark := next(others, "," * bool(points)):
            raise OtherMarkError(mark)
    else:
        text = text.str.replace("," if given == "." else ".", "", regex=False)
    has_commas = given != "." and text.str.contains(",", regex=False).any()
    marks = _COMMAS if has_commas else {}
    if spaced is not None:  # they may be two numbers
        marks = {**marks, " ": f"{spaced} as {re.sub(GROUPED, '', spaced)}"}
    numbers: Any = pd.to_numeric(text.str.replace(",", ".", regex=False), errors="coerce")
    return numbers.to_numpy(float, na_value=np.nan), marks


def check_thousands(values: FloatArray, decimal: str) -> None:
    """Refuse numbers in which the decimal mark groups digits: 1.002 is beside 998.

    Then all parts of whole numbers are thousandths, and none is below 1.
    """
    if np.max(values, initial=0.0, where=np.isfinite(values)) >= 1000.0:
        return
    for before, after in ((values[:-1], values[1:]), (values[1:], values[:-1])):
        crossing = (before >= 500.0) & (before == np.rint(before)) & (after >= 1.0) & (after < 2.0)
        for row in np.flatnonzero(crossing)[:1].tolist():
            parts = values[np.isfinite(values) & (values != np.rint(values))]
            grouped = (parts >= 1.0) & (np.abs(1e3 * parts - np.rint(1e3 * parts)) < 1e-6)
            if len(parts) and grouped.all() and 1e3 * after[row] < 2.0 * before[row]:
                raise ValueError(
                    f"it has {before[row]:g} beside {after[row]:.3f}, as if this were "
                    f"{1e3 * after[row]:g}: --decimal {',' if decimal == '.' else '.'} takes it as "
                    f"that, and --decimal {decimal} as it is"
                )


def _instants(text: Any, like: re.Match[str]) -> Any:
    """Return times of day, or dates with them, like one of them."""
    import pandas as pd

    text = text.str.replace(r",(?=\d)", ".", regex=True)
    text = text.str.replace(r"(:\d\d:\d\d)[:;](?=\d)", r"\1.", regex=True)
    text = text.str.replace(r"^(?=\d+:\d\d\.)", "0:", regex=True)  # mm:ss.0 of Excel
    if like["date"] is None and like[0][-1] not in "mM":
        return pd.to_timedelta(text, errors="coerce").to_numpy("timedelta64[ns]")
    instants: Any = pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")
    if instants.isna().all():
        day_first = "." in (like["date"] or "")
        with warnings.catch_warnings():  # that they have no common form
            warnings.simplefilter("ignore", UserWarning)
            instants = pd.to_datetime(text, dayfirst=day_first, utc=True, errors="coerce")
    return instants.dt.tz_localize(None).to_numpy("datetime64[ns]")


def seconds(
    values: Any, start: tuple[str, int] | None
) -> tuple[FloatArray, tuple[str, int] | None]:
    """Return instants as s from the first one of their kind, over midnights, and what this is.

    `start` is that of a column before: kind, as numpy has it, and ns.
    """
    kind, known = values.dtype.kind, ~np.isnat(values)
    since, instants = np.full(len(values), np.nan), values[known].astype(np.int64)
    if len(instants):
        start = start or (kind, int(instants[0]))
        since[known] = (instants - (start[1] if start[0] == kind else instants[0])) / 1e9
    if kind == "m":
        since[known] = np.unwrap(since[known], period=_DAY)
    return since, start
