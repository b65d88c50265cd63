"""Units that lines above a table tell of its columns, or that they mention."""

import re
from collections.abc import Iterator, Sequence
from functools import cache
from math import isnan
from typing import NamedTuple

from stickslip_ros.record.header_units import Unit, are_units, units_in

_WORD = re.compile(r"[^\W\d_][^\s\d,;:=()\[\]{}<>|、]*")
_WORDS = re.compile(r"(?i)(?:in|min|h|d|yd|dyn|mil|turns?|rot|foot|yard|day|grad)\W*")
"""Units that may be other words."""
_IN = r"(?<!\w)(?:in|en|em|v|w|в)\s"
_TOLD = re.compile(rf"(?i)(?:{_IN}|[\[(:=/])\s*$")
"""What is before a unit that may be another word."""
_LABEL = re.compile(r"(?i)unit|einheit|unidad|jednot|единиц|单位|単位")
"""What is in the line of a unit of one letter."""
_NUMBER_BEFORE = re.compile(r"(?i)\d[\d.,]*(?:e[-+]?\d+)?\s*[\[(]?$")
_NUMBER_BEHIND = re.compile(r"[\s\])}>:;,=\"]*[-+]?\d")
_TARGETS = ("s", "m", "m/s", "N")
"""SI units of the quantities of a motion."""


class Mention(NamedTuple):
    """A unit in a line above a table."""

    unit: Unit
    line: str
    is_fact: bool
    """Whether a number has it, or it is of another quantity: it tells no column."""


def unit_told(lines: Sequence[str], name: str) -> str:
    """Return the unit that is behind the name of a column in lines above, or nothing."""
    column = re.compile(
        rf"(?i)(?<!\w){re.escape(name)}(?!\w)(?:\s*[:=-].*[\s(\[]|\W*(?:{_IN})?)([^\W\d]\S*?)[\W_]*$"
    )
    parts = (part for line in lines for part in re.split(r"[,;|\t、]", line) if name)
    units = {match[1] for match in map(column.search, parts) if match and are_units([match[1]])}
    return units.pop() if len(units) == 1 else ""


def mentions(lines: Sequence[str], target: str) -> Iterator[Mention]:
    """Yield the units of a quantity, with the SI unit `target`, in lines above, but for this."""
    for line in lines:
        label = _LABEL.search(line)
        for match in _WORD.finditer(line):
            before, word, behind = line[: match.start()], match[0], line[match.end() :]
            word = word if are_units([word]) else word.partition("/")[2]  # as in x/mm
            certain = not _WORDS.fullmatch(word) and (len(word) > 1 or label)
            if not are_units([word]) or not (certain or _TOLD.search(before)):
                continue
            number = _NUMBER_BEFORE.search(before) or _NUMBER_BEHIND.match(behind)
            for unit in _readings(word, target):
                if unit.factor > 0.0 and unit.factor != 1.0:
                    yield Mention(unit, line, number is not None)
                elif label and all(isnan(u.factor) for si in _TARGETS for u in _readings(word, si)):
                    yield Mention(unit, line, True)


@cache
def _readings(word: str, target: str) -> Sequence[Unit]:
    return units_in("", word, target)
