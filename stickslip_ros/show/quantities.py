"""Quantities by name in JSON, and their display: with SI units and a prefix, or without units."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import floor, isfinite, isinf, isnan, log10
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import CycleMeasures, Measures
from stickslip_ros.measures.following import Following
from stickslip_ros.measures.run_report import RunReport
from stickslip_ros.model.drive import Drive
from stickslip_ros.quantities import ROTARY, Quantity, quantities_of
from stickslip_ros.text import must_be_one_of, prefix_for, shown

_OF_CYCLES, _OF_RUN = quantities_of(Measures), quantities_of(RunReport)
_FIRST = (
    *("peak_force", "peak_applied_force", "resting_force", "resting_applied_force"),
    *("samples", "lost_samples", "late_forces", "dropped_forces", "missed_deadlines"),
)
"""Rows of the table of a run that have another order than in `RunReport`."""

MEASURES = {
    "regime": _OF_CYCLES["regime"],
    **_OF_CYCLES,
    "multipliers": Quantity("Floquet multipliers"),
    **{name: _OF_RUN[name] for name in _FIRST},
    "steps_per_second": Quantity("steps per second"),
    **quantities_of(Following),
    **_OF_RUN,
    "complete": Quantity("bag complete"),
    "bag": Quantity("bag"),
}
"""Measures and counts of a run, in the order of its table."""

FURTHER = {
    "direction": Quantity("direction in which it is carried on"),
    "attractor": Quantity("place in the attractors, from 0"),
}
"""Columns that a table of some studies has in addition to `COLUMNS` of `studies/columns.py`."""

COLOURS = ("regime", *quantities_of(CycleMeasures))
"""What the map of a sweep can show in colour."""

_LOOP = {
    "equilibrium_position": Quantity("equilibrium position", "m"),
    "eigenvalues": Quantity("eigenvalues", "1/s"),
    "stable": Quantity("stable"),
    "hopf_speeds": Quantity("critical feed speeds (Hopf)", "m/s"),
}
_HOPF_POINTS = {
    "crossing_speeds": Quantity("dRe(lambda)/dv there", "1/m"),
    "first_lyapunov_coefficients": Quantity("first Lyapunov coefficient"),
}
_CRITICAL_GAIN = {"critical_linear_gain": Quantity("critical linear gain", "N s/m")}
THEORY: Mapping[str, Mapping[str, Quantity]] = {
    "open_loop": {
        **_LOOP,
        "hopf_angular_frequencies": Quantity("angular frequency there", "rad/s"),
        **_HOPF_POINTS,
    },
    "sticking": {
        "onset_speed_approximate": Quantity("stick-slip onset speed, by averaging", "m/s"),
        "onset_speed": Quantity("stick-slip onset speed, exactly", "m/s"),
        "speed_ranges": Quantity("belt speeds that stick", "m/s"),
    },
    "closed_loop": {
        **_LOOP,
        **_HOPF_POINTS,
        **_CRITICAL_GAIN,
        "first_lyapunov_coefficient": Quantity("first Lyapunov coefficient there"),
        "critical_cubic_gain": Quantity("critical cubic gain", "N s^3/m^3"),
    },
    "sampled_loop": {
        "spectral_radius": Quantity("spectral radius"),
        "stable": _LOOP["stable"],
        "decay_rate": Quantity("decay rate", "1/s"),
        "settling_time": Quantity("1 % settling time", "s"),
        **_CRITICAL_GAIN,
        "stable_linear_gains": Quantity("stable linear gains", "N s/m"),
    },
}
"""Values of each section of `stability`."""

PREDICTIONS = {
    "force_error": Quantity("force error"),
    "free_run_error": Quantity("simulation error", "m"),
    "segment_error": Quantity("multi-step prediction error", "m"),
    "position_error": Quantity("closed loop, position error"),
    "closed_loop_force_error": Quantity("closed loop, force error"),
}
"""What a model predicts of a recording; without a unit it is a share."""

NOISE = 1e-9
"""Share of the largest value below which a value is rounding error and shown as 0."""

_TAKES_PREFIX = re.compile(r"(?!kg\b)[A-Za-z]+\b(?!\^)")
"""Start of a unit that a prefix can precede: no number, no power, and no kg, which has one."""

_SYMBOLS = {
    "displacement": ("x", "X"),
    "initial displacement": ("x(0)", "X(0)"),
    "turning points": ("x", "X"),
    "velocity": ("x'", "X'"),
    "initial velocity": ("x'(0)", "X'(0)"),
    "velocity relative to the belt": ("v_r", "v_r"),
    "belt speed": ("v", "v_0"),
    "control force": ("u", "U"),
    "cutoff frequency": ("d", "d"),
    "linear gain": ("k_1", "k_1"),
    "critical linear gain": (r"k_1^{\ast}", r"k_1^{\ast}"),
    "cubic gain": ("k_2", "k_2"),
    "friction coefficient": (r"\mu", r"\mu"),
    "mass": ("m", "m"),
    "damping": ("c", r"2\beta"),
    "stiffness": ("k", "k"),
    "normal force": ("N", "N"),
    "static friction coefficient": (r"\mu_s", r"\mu_s"),
    "minimum friction coefficient": (r"\mu_m", r"\mu_m"),
    "speed of minimum friction": ("v_m", "v_m"),
}
"""Symbols of docs/theory.md, in SI units and without units."""

GREEK = {"μ": r"\mu", "β": r"\beta", "γ": r"\gamma", "τ": r"\tau"}
"""Letters of symbols, and what they are in formulas."""

_PARAMETERS = {
    "plant.mass": "mass",
    "plant.damping": "damping",
    "plant.stiffness": "stiffness",
    "plant.normal_force": "normal force",
    "plant.belt_speed": "belt speed",
    "plant.rate": "sample rate",
    "plant.force_delay": "force delay",
    "plant.friction.static": "static friction coefficient",
    "plant.friction.minimum": "minimum friction coefficient",
    "plant.friction.minimum_speed": "speed of minimum friction",
    "washout_controller.corner_frequency": "cutoff frequency",
    "washout_controller.linear_gain": "linear gain",
    "washout_controller.cubic_gain": "cubic gain",
    "washout_controller.force_limit": "force limit",
    "washout_controller.start_after": "start after",
}
"""Names of parameters in figures and on the page."""

_SCALES = {"plant.mass", "plant.stiffness", "plant.normal_force"}


@dataclass(frozen=True)
class Units:
    """Units of quantities, SI or none, and their labels."""

    dimensionless: bool = False
    terse: bool = False
    """Whether labels omit that a quantity is dimensionless; a capital symbol says it, too."""
    rotary: bool = False
    """Whether displacements are angles, and forces torques."""

    @classmethod
    def for_drive(
        cls, drive: Drive | None, varied: Iterable[str] = (), *, rotary: bool = False
    ) -> Self:
        """Return the units of a drive; SI if one of its scales is among the parameters `varied`."""
        unit = drive is not None and drive.is_dimensionless
        return cls(dimensionless=unit and _SCALES.isdisjoint(varied), rotary=rotary)

    def shortened(self, *, terse: bool = True) -> Self:
        """Return the same units with terse labels."""
        return replace(self, terse=terse)

    def label(self, name: str, unit: str) -> str:
        """Return the label of an axis, such as "velocity (mm/s)"; without a unit the name alone."""
        if not unit or (self.terse and self.dimensionless):
            return name
        return f"{name} ({'dimensionless' if self.dimensionless else unit})"

    def named(self, quantity: str, *, short: bool = False) -> str:
        """Return a quantity, or a parameter, as a figure names it: with its symbol, if any.

        A `short` name is the symbol alone.
        """
        quantity = plain_name(quantity)
        if quantity not in _SYMBOLS:
            return quantity
        symbol = f"${_SYMBOLS[quantity][self.dimensionless]}$"
        return symbol if short else f"{quantity} {symbol}"

    def plain(self, quantity: str) -> str:
        """Return the same for text without formulas, such as "linear gain k1"."""
        quantity = plain_name(quantity)
        symbol = _SYMBOLS.get(quantity, ("", ""))[self.dimensionless]
        for letter, formula in GREEK.items():
            symbol = symbol.replace(formula, letter)
        return f"{quantity} {symbol.replace('_', '')}".rstrip()

    def axis(self, name: str, unit: str, *values: npt.ArrayLike) -> tuple[float, str]:
        """Return the divisor of the values (SI) on an axis, and its label, see `prefixed`."""
        scale, unit = self.prefixed(unit, *values)
        return scale, self.label(name, unit)

    def prefixed(self, unit: str, *values: npt.ArrayLike) -> tuple[float, str]:
        """Return the divisor of values (SI), and the unit of the quotients.

        Times of a second or more have no prefix, and numbers without unit have none.
        """
        arrays = [np.asarray(value, dtype=float) for value in values]
        largest = max((float(np.nanmax(np.abs(a), initial=0.0)) for a in arrays), default=0.0)
        if self.dimensionless or (unit == "s" and largest >= 1.0):
            return 1.0, unit
        unit = self.of_unit(unit)
        scale, prefix = _prefix_of(unit, largest)
        return scale, prefix + unit

    def of_unit(self, unit: str) -> str:
        """Return the unit to show; empty if all is dimensionless."""
        if self.dimensionless:
            return ""
        return ROTARY.get(unit, unit) if self.rotary else unit

    def text(self, value: float | None, unit: str, *, largest: float = 0.0) -> str:
        """Return a value (SI) as text with its unit."""
        return self.texts([value], unit, largest=largest)[0]

    def texts(
        self, values: Sequence[Any], unit: str, digits: int = 4, *, largest: float = 0.0
    ) -> list[str]:
        """Return values as texts with their unit, all with the prefix of the largest.

        A unit that starts with a number or a power, such as 1/s, gets no prefix, nor does kg; None
        is "-", and what is infinite "unbounded". A value below
        1e-9 of the largest, or of a given `largest`, is shown as 0.
        """
        unit = self.of_unit(unit)
        sizes = (abs(value) for value in values if isinstance(value, float) and isfinite(value))
        greatest = max(sizes, default=0.0)
        least = NOISE * max(greatest, largest)
        values = [0.0 if isinstance(v, float) and abs(v) < least else v for v in values]
        scale, prefix = _prefix_of(unit, greatest if greatest >= least else 0.0)
        return [_text(value, scale, f" {prefix}{unit}".rstrip(), digits) for value in values]

    def with_error(self, value: float, error: float, unit: str) -> str:
        """Return a value (SI) with the digits that its standard error tells: two of the error.

        An unknown error, and one that is rounding, is left out; a value of NaN is "-".
        """
        if isnan(value):
            return "-"
        if not error > NOISE * abs(value):
            return self.texts([value], unit, 3)[0]
        unit = self.of_unit(unit)
        scale, prefix = _prefix_of(unit, max(abs(value), error))
        digits = max(1 - floor(log10(error / scale)), 0)
        text = " ± ".join(f"{number / scale:.{digits}f}" for number in (value, error))
        return f"{text} {prefix}{unit}".rstrip()


def check_colour(colour: str, parameters: int) -> None:
    """Refuse what the figure of a sweep over so many parameters cannot show in colour."""
    if colour not in COLOURS:
        refusal = must_be_one_of(colour, COLOURS)
        raise InvalidInputError(f"colour = {shown(colour)} is invalid: {refusal}")
    if colour != "regime" and parameters < 2:
        raise InvalidInputError(f"colour = {colour}: is for maps, of two parameters")


def plain_name(quantity: str) -> str:
    """Return what figures call a parameter, NODE.PARAMETER; any other quantity as it is."""
    return _PARAMETERS.get(quantity, quantity)


def _prefix_of(unit: str, largest: float) -> tuple[float, str]:
    return prefix_for(largest) if _TAKES_PREFIX.match(unit) else (1.0, "")


def _text(value: Any, scale: float, unit: str, digits: int) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return str(value)
    return "unbounded" if isinf(value) else f"{value / scale:.{digits}g}{unit}"


SI = Units()
