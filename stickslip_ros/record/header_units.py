"""Units of the columns of a table: in their names or in a line of their own.

A name has its unit in brackets (`x [mm]`), after a mark (`x / mm`, `x, mm`, `x in mm`), or as its
last words (`x mm`, `x_mm`, `x.mm`, `xMM`). Those are one of the quantity: `v_m` has none.
"""

import re
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import product
from math import isnan, nan, tau
from typing import NamedTuple
from unicodedata import normalize

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.quantities import ROTARY, number_of
from stickslip_ros.text import shown

NO_UNITS = ("", "-", "1", "unit", "units", "einheit", "einheiten")
_LONG = {"nano": "n", "micro": "u", "mikro": "u", "milli": "m", "mili": "m", "centi": "c",
         "zenti": "c", "kilo": "k", "chilo": "k"}  # fmt: skip
_ANY_LONG = "|".join(_LONG)
_OTHER_UNITS = (
    "[vwgk]|volts?|grams?|kgs|kilos?|tons?|tonn(?:e[ns]?|ellat[ae])|toneladas?|lbs?|oz|pounds?|pa|bar"
    "|degc|°c|%|percent|pct|prozent"
)
_SPELLINGS = tuple(
    (name, dimension, re.compile(f"({prefixes})?(?:{words})"))
    for name, dimension, prefixes, words in (
        ("m", "L", f"[pnumcdk]|{_ANY_LONG}", "m|met(?:er[sn]?|res?|ros?|r[iy]?)"),
        ("s", "T", f"[num]|{_ANY_LONG}", r"s|se[ckg](?:s|[ou]nd\w{0,2})?"),
        ("N", "F", f"[umck]|da|{_ANY_LONG}", "n|newton[sy]?"),
        ("N m", "FL", "[umck]", "nm"),
        ("N cm", "FL", "", "ncm"),
        ("N mm", "FL", "", "nmm"),
        ("kgf m", "FL", "", "kgf?m"),
        ("kgf cm", "FL", "", "kgf?cm"),
        ("lbf ft", "FL", "", "lb[fs]?ft|ftlb[fs]?"),
        ("lbf inch", "FL", "", "lb[fs]?in|inlb[fs]?"),
        ("ozf inch", "FL", "", "ozf?in"),
        ("rad", "R", f"[um]|{_ANY_LONG}", r"rad(?:s|ian\w*)?"),
        ("turn/s", "R/T", "k", "hz|rps"),
        ("turn/min", "R/T", "k", "rpm|upm|umin"),
        ("m/s", "L/T", "[um]", "mps"),
        ("mm/s", "L/T", "", "mms(?:ec)?"),
        ("km/hour", "L/T", "", "kmh|kph"),
        ("mile/hour", "L/T", "", "mph"),
        ("knot", "L/T", "", "knots?|kts"),
        ("m/min", "L/T", "m", "mpm|mmin"),
        ("ft/s", "L/T", "", "fps"),
        ("ft/min", "L/T", "", "fpm"),
        ("inch/s", "L/T", "", "ips|inps"),
        ("inch/min", "L/T", "", "ipm"),
        ("degree/s", "R/T", "", "dps|degp?s"),
        ("rad/s", "R/T", "m", "radp?s"),
        ("inch", "L", "u|micro", "in|inch(?:es)?|zoll|pulgadas?|pouces?|pollic[ei]"),
        ("ft", "L", "", "ft|foot|feet"),
        ("yard", "L", "", "yds?|yards?"),
        ("angstrom", "L", "", "angstr[oö]ms?"),
        ("thou", "L", "", "thou|mils?"),
        ("micron", "L", "", "mi[ck]ron[sy]?|micras?|mkm"),
        ("min", "T", "", r"min(?:s|ut\w{1,2})?"),
        ("hour", "T", "", "h|hrs?|hours?|stunden?|horas?|heures?|or[ae]"),
        ("day", "T", "", "d|days?|tage?"),
        ("degree", "R", "m|milli", r"deg(?:s|[ru]\w*)?|stopni\w*|grad(?:i|os?)?"),
        ("gon", "R", "m", "gon|grad"),
        ("turn", "turns", "", "r|u|tr|rot|obr|ot"),
        ("turn", "R", "", "revs?|revolutions?|turns?|umdr(?:ehung(?:en)?)?|tours?|giri|vueltas?"),
        ("arcsec", "R", "", r"(?:arc|bogen)se[ck](?:[ou]nd\w{1,2})?"),
        ("arcmin", "R", "", r"(?:arc|bogen)min(?:ut\w{1,2})?"),
        ("kgf", "F", "", "kgf|kp"),
        ("lbf", "F", "k", "lbf"),
        ("kip", "F", "", "kips?"),
        ("dyn", "F", "", "dyn(?:es?)?"),
        ("gf", "F", "", "gf|pond"),
        ("Mgf", "F", "", "tf"),
        ("A", "I", "[kum]", r"a(?:mps?|mpere\w*|rms|eff|pk)?"),
        ("", "other", "[kum]", _OTHER_UNITS),
    )
)
"""Units in machines' data: what pint calls them, their dimension, prefixes, and how people write
them. Those without a name for pint are of other quantities; turns as in U/min only in a ratio."""
_DIMENSIONS = {"m": "L", "m/s": "L/T", "N": "F", "s": "T", "rad": "R", "rad/s": "R/T", "N m": "FL",
               "A": "I", "N/A": "F/I", "N m/A": "FL/I"}  # fmt: skip
_COUNTS = re.compile(
    r"counts?|cnts?|cts|[cp]ps|adc|inc|incr(?:ements?)?|ink(?:r\w*)?|puls\w*|impuls\w*|pls|ticks?"
    r"|(?:micro|u)?steps|lsb|digits?|erpm|qc"
)
"""Words for numbers of an encoder, a motor or a clock, of which only the owner knows the size."""
_SCALED = re.compile(
    r"(?i)/\s*10+(?!\d)|(?:/|[\s(\[]x)\s*(?:10+\b|1?e[-+]?\d)|[*\xd7·]\s*\d[\d.,]*|\d[\d.,]*\s*[*\xd7]"
    r"|[\s_]x10+(?=[^\W\d_])|_x100+(?!\w)"
    r"|\b(?:tenth|hundredth|thousandth|zehntel|hundertstel|tausendstel)s?\b"
    r"|\b(?:d[eé]cim|dixi[eè]m|cent[ei][sè][im]|mill?[eiè][sè][im])\w+"
)
_SCALED_BEFORE = re.compile(
    r"(?i)(?:[x\xd7]\s*10+|10+(?=\s*[*\xd7·])|100+|1e[-+]?\d+|10(?:\^|\*\*)[-+]?\d+)[\s*\xd7·]+(?=[^\W\d_])"
)
"""What says that numbers are multiples of a unit, and what says so before a name."""
_OTHERS = {
    "an acceleration": re.compile(r"acc(?:el\w*)?$|beschl|accél|acel"),
    "a current": re.compile(r"current|is?[qd]$|(?:\w*motor)?strom|corrente|corriente|courant"),
    "a power": re.compile(r"power|leistung|puissance|poten[zc]"),
}
_FORCE = re.compile(r"forc|fuerz|forz|torq|moment|coup|copp|effort|\w*(?:kraft|moment)")
"""Starts of words for quantities that are often taken for others, and for forces."""
_SQUARED = re.compile(r"(?i)(?<![^\W\d_])(?:[cdm]?m|rad|deg)[\W_]?s\W{0,2}[2²](?!\d)")
"""Units of an acceleration, as ms2."""
_LATIN = {
    **{"мк": "u", "см": "cm", "кгс": "kgf", "тс": "tf", "град": "deg", "об": "r", "ью": "ew"},
    **{"ミリ": "milli", "マイクロ": "micro", "メートル": "m", "ニュートン": "N"},
    **{"転": "rot", "分": "min"},
    **dict(zip("毫微千秒米牛", "muksmN", strict=True)),
    **dict(zip("мскнгдчриалетыуо", "mskngdhrialetyuo", strict=True)),
}
_SIGNS = str.maketrans({"µ": "u", '"': "inch", "°": "deg", "%": " % ", "‰": " % ", "^": ""})
_USUAL = str.maketrans({"μ": "µ", "\u2212": "-", "\u2215": "/"})
_OTHER_LETTERS = re.compile("|".join(_LATIN), re.IGNORECASE)
"""Units in other letters than Latin ones, the longer first."""
_BRACKETED = re.compile(r"[\[(<{]\s*([^\[\](){}<>]*[^\[\](){}<>\s])\s*[\])>}]")
_MARK = re.compile(r"\s*[/,]\s*|\s+(?:in|en|em)\s+")
_PER = r"(?:per|pro|por|par)(?![^\W\d_])"
"""Word for a ratio."""
_MARKS = " _-.,;:/#"
"""What is between words."""
_START = re.compile(
    r"(?<![^\W_])(?=[^\W_])|(?<=[^\W\d_A-Z])(?=[A-Z])|(?<=\d)(?=[^\W\d_])"
    r"|(?<=[^\x00-\u03ff])(?=[a-zA-Zµ])|(?=[°毫微]|ミリ|マイクロ)|(?<=[^\W\d_])(?=mm$|kN$)"
)
"""Where a word starts: after a mark, in PosMM or posmm, after a number or Chinese letters."""
_FACTOR = re.compile(
    r"(?i)[x\xd7]?\s*(?:10(?:\^|\*\*|(?=[-+]))(?P<power>[-+]?\d+)"
    r"|(?P<number>\d+(?:[.,]\d+)?(?:e[-+]?\d+)?|e[-+]?\d+))(?=[\s*·]*[^\W\d_])"
)
"""A number, or a power of ten, before a unit."""
_DOUBTFUL, _DOUBTFUL_ALONE = ("in", "min", "h", "d"), ("cm", "dm")
"""Units that may be other words at the end of a name, or where they are all of it."""
_DOUBTFUL_LAST = (*_DOUBTFUL, "yd", "dyn")
"""Those at the end, and others: the desired y, a dynamic force."""
_WEIGHTS = {"g": 9.80665e-3, "t": 9806.65, "to": 9806.65, "т": 9806.65}
"""Weights, N, of units of mass that may be other words behind a force."""
_INDEX = re.compile(r"(?<=[^\W\d_]{2})(?:1|(?<!s)\d\d?)$")
"""The number of a channel behind a unit, as in mm1; s2 is squared."""
_LONGEST = 200
"""Characters of a name in which a unit is looked for."""
_SAMPLING = re.compile(
    r"(?i)sampl|abtast|échantil|muestr|campion|zyklus|^\W*(?:interval|period|dt\b)"
)
"""Words for the sampling of a table."""


class Unit(NamedTuple):
    """A unit that a column may have."""

    text: str
    """As it is in the table; empty for none."""
    factor: float
    """What converts numbers to the SI unit; NaN if it is no unit of the quantity."""
    target: str
    """SI unit."""


@cache
def units_in(name: str, given: str, target: str) -> Sequence[Unit]:
    """Return the unit of a column: none, one, or several if it has several readings.

    `given` is its cell in a line of units, or empty; `target` the SI unit of the quantity for
    linear motion; a unit of the same quantity of rotary motion is one, too.
    """
    name, given = _usual(name).replace("()", ""), _usual(given)
    multiple = _BRACKETED.sub(lambda text: "" if any(_read(text[1], target)) else text[0], name)
    scaled, tens = _SCALED.search(f"{multiple};{given}"), name.removesuffix("_x10")
    before = _SCALED_BEFORE.match(multiple)
    if before and not _parsed(multiple[before.end() :]):  # 1000 x [m], but not 10 um
        scaled = before
    if scaled or (tens != name and any(_last(tens, target))):  # rpm_x10, but not pos_x10
        bracketed = (text for text in _BRACKETED.findall(name) if _SCALED.search(text))
        return [Unit(next(bracketed, scaled[0].strip() if scaled else name), nan, target)]
    plain = _BRACKETED.sub(" ", name).strip()
    stated, last = [*_stated(name, plain, given, target)], [*_last(plain, target)]
    known, words = ([unit for unit in units if not isnan(unit.factor)] for units in (stated, last))
    readings = known or words or [*stated, *last][:1]
    return [*{unit.factor: unit for unit in reversed(readings)}.values()][::-1]


def force_per_ampere(constant: str, pitch: float | None, *, rotary: bool) -> float:
    """Return the force of 1 A, N, of a rotary axis the torque, N m.

    The constant of a linear motor is in N/A. One in N m/A turns a rotary axis, or a screw with a
    pitch, m: the work of a turn, pitch F = 2 pi K I, gives the force. Raises InvalidInputError
    if the unit of the constant does not fit to them.
    """
    given = f"force_constant = {shown(constant)}"
    readings = [reading for unit in ("N/A", "N m/A") for reading in _read(constant, unit)]
    if not readings or not readings[0].factor:
        raise InvalidInputError(
            f"{given} is invalid: must be a number above 0 with its unit, as 50N/A of a linear "
            "motor, or 0.35Nm/A of a motor that turns a screw or a rotary axis"
        )
    ((_, factor, unit), *_) = readings
    refusals = {
        "N/A": "N/A is of a linear motor, which has no pitch and turns no rotary axis; N m/A, a "
        "motor with a screw, may be meant",
        "N m/A": "N m/A is of a motor that turns either a screw, whose pitch is needed, or a "
        "rotary axis, which has none; N/A, a linear motor, may be meant",
    }
    if pitch is not None and rotary:
        raise InvalidInputError(f"pitch = {pitch} m is refused: a rotary axis has no screw")
    if (pitch is not None) + rotary != (unit == "N m/A"):
        raise InvalidInputError(f"{given} is refused: {refusals[unit]}")
    return factor if pitch is None else tau * factor / pitch


def are_units(cells: Sequence[str]) -> bool:
    """Return whether the cells of a line are units, but for those that say so or are empty."""
    units = [_usual(cell).strip("[]()") for cell in cells]
    units = [unit for unit in units if unit.lower() not in NO_UNITS]
    first = [unit.partition(" ")[0] for unit in units]
    known = sum(
        bool(_parsed(unit) or _counts(unit))
        for unit in first
        if len(unit) > 1 or unit in "msNAVKgh%"
    )
    return 2 * known > len(units)


def other_quantity(name: str) -> str | None:
    """Return what a column is by its name, if it is "an acceleration", "a current" or "a power"."""
    if _SQUARED.search(name):
        return "an acceleration"
    words = re.findall(r"[^\W\d_]+", name.casefold())
    if any(map(_FORCE.match, words)):  # the current torque
        return None
    return next((what for what, start in _OTHERS.items() if any(map(start.match, words))), None)


def without_unit(name: str) -> str:
    """Return the name of a column without the unit in brackets or after a mark, or nothing."""
    name = _usual(name)
    if match := re.fullmatch(rf"(.+?)\s*{_BRACKETED.pattern}\s*", name):
        return match[1]
    return next(
        (name[: mark.start()] for mark in _MARK.finditer(name) if _parsed(name[mark.end() :])), ""
    )


def joined_units(cells: Sequence[str], width: int) -> list[str]:
    """Return names, of which the separator has cut units off, as `x [mm]`, if they are too many."""
    names = [*cells]
    for place in range(len(names) - 1, 0, -1):
        before, unit = names[place - 1 : place + 1]
        if len(names) > width and _parsed(unit.strip("[]()")):
            names[place - 1 : place + 1] = [f"{before}{', ' if unit[0].isalpha() else ' '}{unit}"]
    return names


def period_in(line: str) -> tuple[float, float] | None:
    """Return the period of rows that a line of text tells, s and in its own unit, or None."""
    line = line[: 5 * _LONGEST]
    if not _SAMPLING.search(line):
        return None
    number, unit = r"(?P<number>\d[\d.,]*(?:e-?\d+)?)", r"(?P<unit>[^\W\d_]+)"
    for pattern in (rf"[\[(]\s*{unit}\s*[\])][\s,;:=\"]*{number}", rf"{number}[\s;,\"]*{unit}"):
        for match in re.finditer(pattern, line):
            value = float(match["number"].rstrip(",.").replace(",", "."))
            for name, dimension in _parsed(match["unit"]):
                if dimension == "T" and name not in ("min", "hour", "day"):
                    return value * _factor(name, "s"), value
                if name.endswith("turn/s") and value:
                    return tau / (value * _factor(name, "rad/s")), nan
    return None


def _stated(name: str, plain: str, given: str, target: str) -> Iterator[Unit]:
    """Yield the units in the line of units, or in a name in brackets or after a mark."""
    cell, bracketed = given.strip().strip("[]()"), _BRACKETED.findall(name)
    marked = [plain[mark.end() :] for mark in _MARK.finditer(plain)]
    for text in filter(None, [cell, *bracketed, *marked, *re.findall("%$", plain)]):
        whole = re.sub(r"(?i)^(?:in|en|em)\s+", "", text)
        words = re.split(r"[\s,;]+", whole)
        words = [word for word in words if word.strip(".").casefold() not in _DOUBTFUL]
        tried = [whole, *words[:1]] if re.search(r"\d", text) else [whole, *words[-1:], *words[:1]]
        if readings := next(filter(None, ([*_read(attempt, target)] for attempt in tried)), []):
            yield from readings
        elif text.lower() not in (*NO_UNITS, *_DOUBTFUL):
            letters = len(re.findall(r"[^\W\d_]", text))
            unit = _parsed(text.lstrip("0123456789.,")) or any(map(_parsed, words)) or _counts(text)
            certain = text == cell or f"[{text}]" in name.replace(" ", "")
            certain &= letters > 1 or (text, target) == ("t", "N")  # tonnes
            if certain or (unit and (letters > 1 or text not in marked)):
                yield Unit(text, nan, target)


def _last(name: str, target: str) -> Iterator[Unit]:
    """Yield what the last words of a name may be, or words between, or counts."""
    name = _INDEX.sub("", name)
    starts = [match.start() for match in _START.finditer(name)]
    for start in starts[-4:]:
        text, before = name[start:], name[:start]
        text = text.lower() if text in ("Ms", "Mm", "Us", "Um") else text  # as in timeMs
        rest = text[3:] if re.match(rf"(?i)in[\W_](?!{_PER})", text) else ""
        if readings := [*_doubted(rest, target)] or [*_doubted(text, target, alone=not before)]:
            if re.match(r"(?i)per(?![^\W_])", text) and _counts(before):
                break
            yield from readings
            return
    ends = [*starts[1:], len(name)]
    words = [name[start:end].strip(_MARKS) for start, end in zip(starts, ends, strict=False)]
    whole = {dimension for start in starts[-3:-1] for _, dimension in _parsed(name[start:])}
    between = [] if whole & {*_DIMENSIONS.values()} else [*_between(name, starts, target)]
    yield from between
    if target == "N" and not between and words[1:] and words[-1] in _WEIGHTS:
        yield from (Unit(words[-1], _WEIGHTS[words[-1]], "N"), Unit("", 1.0, "N"))
    yield from (Unit(word, nan, target) for word in words if _counts(word))
    for start in starts[-2:]:
        word, parsed = name[start:], _parsed(name[start:])
        long = len(word) > 1 and word.casefold() not in _DOUBTFUL and parsed
        if (long and ("", "other") in parsed) or (start and (long or word == "V")):
            yield Unit(word, nan, target)


def _between(name: str, starts: Sequence[int], target: str) -> Iterator[Unit]:
    """Yield what words may be that others follow; mm_s there is no unit of length."""
    first = int(re.match(r"[^\W_][\W_]+[^\W_]", name) is not None)
    while first < len(starts) - 1:
        for end in range(min(first + 3, len(starts) - 1), first, -1):
            text = name[starts[first] : starts[end]].strip(_MARKS)
            parsed = _parsed(text.lstrip("0123456789."))
            known = {dimension for _, dimension in parsed} & {*_DIMENSIONS.values()}
            if known and len(text) > 1 and text.casefold() != "in":
                readings = [*_doubted(text, target)]
                yield from readings or [Unit(text, nan, target)] * (end > first + 1)
                first = end - 1
                break
        first += 1


def _doubted(text: str, target: str, *, alone: bool = False) -> Iterator[Unit]:
    """Yield the readings of words of a name, or of all of it, as a unit or something else."""
    yield from _read(text, target)
    if text[:1].isdigit():  # a number of units, or of the column
        yield from _read(text.lstrip("0123456789."), target)
    doubtful = _DOUBTFUL_LAST + _DOUBTFUL_ALONE if alone else _DOUBTFUL_LAST
    if text.casefold() in doubtful and any(_read(text, target)):
        yield Unit("", 1.0, target)


def _counts(text: str) -> bool:
    words = re.findall(r"[^\W\d_]+", text.casefold())
    return any(map(_COUNTS.fullmatch, words))


def _read(text: str, target: str) -> Iterator[Unit]:
    """Yield the readings of a text, with or without a number, as a unit of a quantity."""
    unit, scale = text, 1.0
    if factor := _FACTOR.match(text):
        number = factor["number"] or f"e{factor['power']}"
        unit = text[factor.end() :].strip(" *·")
        scale = float(re.sub("(?i)^e", "1e", number.replace(",", ".")))
    for si_unit in dict.fromkeys((target, ROTARY.get(target, target))):
        for name, dimension in _parsed(unit):
            if dimension == _DIMENSIONS[si_unit]:
                yield Unit(text, scale * _factor(name, si_unit), si_unit)


@cache
def _factor(unit: str, target: str) -> float:
    """Return by what numbers of a unit are multiplied for another one; a turn has 2 pi rad."""
    if unit == target:
        return 1.0
    if "turn" in unit:
        return tau * number_of("unit", f"1 {unit}", target.replace("rad", "turn"))
    return number_of("unit", f"1 {unit}", target)


@cache
def _parsed(text: str) -> tuple[tuple[str, str], ...]:
    """Return the readings of a text as a unit: what pint calls it, and its dimension."""
    plain = normalize("NFD", _OTHER_LETTERS.sub(_latin, text.replace("Å", "angstrom")))
    plain = re.sub("[\u0300-\u036f]", "", plain).translate(_SIGNS)
    plain = plain.replace("ms-1", "m/s")  # as in v_ms-1, and not 1/ms
    plain = re.sub("(?<=[a-z])P(?:er|ro|or|ar)(?=[A-Z])", "/", plain)
    plain = re.sub(rf"(?i)(?<![^\W\d_]){_PER}", "/", plain)
    if len(plain) > 40 or not re.fullmatch(r"[\w\s/.*·⋅%-]+", plain):
        return ()
    sides: list[list[str]] = [[], []]
    below, words = 0, re.findall(r"[^\W\d_]+|%|/|-1|\d+", plain)
    for number, word in enumerate(words):
        if word == "/":
            below = 1
        elif word == "-1" and sides[0]:
            sides[1].append(sides[0].pop())
        elif not (word == "1" and not number and len(words) > 1):
            sides[below].append(word)
    over, under = ([_spelled(factor) for factor in side] for side in sides)
    if not 1 <= len(over) + len(under) <= 3:
        return ()
    readings = [*_composed(over, under)]
    if len(over) == 2 and not under:
        readings += _composed(over[:1], [[unit for unit in over[1] if unit[0] != "day"]])
    return tuple(readings)


def _composed(
    over: Sequence[list[tuple[str, str]]], under: Sequence[list[tuple[str, str]]]
) -> Iterator[tuple[str, str]]:
    """Yield the ratios of products of units; of turns, where nothing is above."""
    for ratio in product(product(*over), product(*under)):
        above, below = ("".join(sorted(dimension for _, dimension in side)) for side in ratio)
        unit = " ".join(name for name, _ in ratio[0]) + "".join(f"/{name}" for name, _ in ratio[1])
        if not under and above != "turns":
            yield unit, above
        elif under:
            yield unit if over else f"turn{unit}", f"{above.replace('turns', 'R') or 'R'}/{below}"
        if not over and unit == "/s":
            yield "rad/s", "R/T"


@cache
def _usual(text: str) -> str:
    """Return a text with usual characters for those of full width, exponents, and units of one."""
    text = re.sub("[⁻¹²³⁰⁴-⁹]+", lambda exponent: f"^{exponent[0]}", text[:_LONGEST])
    text = normalize("NFKC", text.replace("″", '"')).translate(_USUAL)
    text = re.sub(rf"(?i)\b({_ANY_LONG})[ -](?=[ms])", r"\1", text)
    return re.sub(r"(?<=[\W_])µ(?!\w)", "µm", text)


def _latin(letters: re.Match[str]) -> str:
    """Return Latin letters of a unit in place of Cyrillic ones."""
    latin = _LATIN[letters[0].lower()]
    return latin if letters[0].islower() else latin.upper()


@cache
def _spelled(word: str) -> list[tuple[str, str]]:
    """Return what a word may be among units: what pint calls it, and its dimension."""
    lower = word.casefold()
    readings: list[tuple[str, str]] = []
    for name, dimension, pattern in _SPELLINGS:
        if match := pattern.fullmatch(lower):
            prefix = _LONG.get(match[1] or "", match[1] or "")
            readings.append((prefix + name, dimension))
            if prefix + name == "mN" and word != "mN":
                readings.append(("MN", dimension))
    others = {"Grad": "gon", "Nm": "nm"}  # which the capital letter excludes
    return [reading for reading in readings if reading[0] != others.get(word)]
