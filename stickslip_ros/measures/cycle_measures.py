"""The measures of cycles: amplitude, stick fraction, period, regime and how they change."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from enum import StrEnum
from math import hypot, isnan, nan
from typing import Annotated, Any, Generic, Self, TypeVar

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.drift import Drift
from stickslip_ros.quantities import Quantity
from stickslip_ros.text import quantity

EQUILIBRIUM_SPEED = 1e-3
"""Speed amplitude, in belt speeds, below which the slide counts as at rest in equilibrium."""

STICKING_SHARE = 0.85
"""Highest speed, in belt speeds, from which a motion under noise may stick."""

UNBOUNDED_BELT_SPEEDS = 1e3
"""Speed of the slide, in belt speeds, above which a sampled motion counts as unbounded."""

STEADY_CHANGE_UNDER_NOISE = 0.01
"""Largest change of the amplitude over the measured cycles of a steady motion under noise, as a
share of it."""

LEAST_CYCLES = 3
"""Number of cycles needed to decide whether a motion is steady."""

STALE_PERIODS = 3.0
"""A motion without a turning point for this many of its last periods has stopped cycling."""


class Regime(StrEnum):
    """Kind of motion.

    `stick_slip` cycles have a stick phase and `pure_slip` cycles do not; in `equilibrium` the slide
    is at rest on a moving belt, and `held` within the resolution of its sensor or actuator; `stuck`
    is a slide that sticks to a belt at rest; `unbounded` is a motion that diverges, `undersampled`
    one with too few samples per cycle to tell.
    """

    STICK_SLIP = "stick_slip"
    PURE_SLIP = "pure_slip"
    EQUILIBRIUM = "equilibrium"
    HELD = "held"
    STUCK = "stuck"
    UNBOUNDED = "unbounded"
    UNDERSAMPLED = "undersampled"

    @classmethod
    def label(cls, regime: str | None, cycles: int = 0) -> str:
        """Return the display text of a regime.

        Parameters
        ----------
        regime : str or None
            Value of a regime, or None.
        cycles : int
            Number of cycles that were measured.

        Returns
        -------
        str
            Text such as "stick-slip"; for None "no whole cycle" or, of measured cycles, "regime not
            known".
        """
        if regime is None:
            return "regime not known" if cycles else "no whole cycle"
        return _LABELS[cls(regime)]


RESTS = (Regime.EQUILIBRIUM, Regime.HELD, Regime.STUCK)
"""Regimes of a slide that does not vibrate."""

_LABELS = {
    Regime.STICK_SLIP: "stick-slip",
    Regime.PURE_SLIP: "pure slip",
    Regime.EQUILIBRIUM: "steady sliding",
    Regime.HELD: "steady sliding, to the resolution",
    Regime.STUCK: "stuck",
    Regime.UNBOUNDED: "unbounded",
    Regime.UNDERSAMPLED: "undersampled",
}


class Trend(StrEnum):
    """Change of a motion that is not steady: of its amplitude, or of position or force."""

    DECAYING = "decaying"
    GROWING = "growing"
    VARYING = "varying"
    DRIFTING = "drifting"


def trend_text(values: Mapping[str, Any], show: Callable[[float, str], str] = quantity) -> str:
    """Return the display text of the trend of measures by name, a drift with rates; or nothing."""
    trend, drift = values.get("trend"), values.get("drift")
    if trend != Trend.DRIFTING or not drift:
        return trend or ""
    units = {"force": "N/s"}
    rates = [f"{name} {show(rate, units.get(name, 'm/s'))}" for name, rate in drift.items()]
    return ", ".join([trend, *rates])


_Value = TypeVar("_Value")

_NO_CYCLE = "before the first cycle"
_NO_PERIOD = "without cycles: at rest, unbounded and undersampled"


@dataclass(frozen=True)
class CycleMeasures(Generic[_Value]):
    """Measures of a cycle: of one, of means over some, or of many as columns; SI units."""

    amplitude: Annotated[_Value, Quantity("amplitude", "m", _NO_CYCLE)]
    """Half of the peak-to-peak displacement, m."""
    velocity_amplitude: Annotated[
        _Value, Quantity("velocity amplitude", "m/s", f"{_NO_CYCLE}, and at rest under noise")
    ]
    """Half of the peak-to-peak velocity, m/s."""
    midpoint: Annotated[_Value, Quantity("midpoint", "m", _NO_CYCLE)]
    """Middle of the displacement, m."""
    period: Annotated[_Value, Quantity("period", "s", _NO_PERIOD)]
    """Duration of a cycle, s."""
    frequency: Annotated[_Value, Quantity("frequency", "Hz", _NO_PERIOD)]
    """Cycles per second, Hz."""
    stick_fraction: Annotated[_Value, Quantity("stick fraction", "", _NO_CYCLE)]
    """Share of the time in which the slide sticks to the belt, 0 to 1."""


@dataclass(frozen=True)
class Cycle(CycleMeasures[float]):
    """One cycle, from one upward zero crossing of the velocity to the next.

    Under noise a single one may not tell its stick fraction: then that is NaN.
    """


@dataclass(frozen=True)
class Measures(CycleMeasures[float | None]):
    """Means over the last whole cycles; None is what does not exist.

    Period and frequency are None in equilibrium, stuck and unbounded. The regime is None while no
    cycle has been completed and the slide has not settled at rest.
    """

    cycles: Annotated[int, Quantity("cycles measured")]
    """Number of cycles in the means."""
    regime: Annotated[Regime | None, Quantity("regime", "", _NO_CYCLE)]
    """Kind of motion."""
    steady: bool | None = None
    """Whether the motion has settled; None if there is too little data.

    The amplitudes of the measured cycles, at least three, differ by a thousandth at most, as does
    their mean from the amplitude that they tend to, where that is known, and nothing drifts. A rest
    is steady once it has lasted for as many cycles as the window has, if small cycles around it do
    not grow. An unbounded motion is steady, too.
    """
    trend: Trend | None = None
    """How the motion changes; None unless `steady` is False."""
    errors: Mapping[str, float] | None = None
    """Standard error of each mean by the name of the measure; None below three cycles."""
    drift: Mapping[str, float] | None = None
    """Rate of each quantity that would change by a hundredth in one more such run: `position` and
    `amplitude`, m/s, and `force`, N/s; None without one."""

    def as_dict(self) -> dict[str, Any]:
        """Return the measures by name, ready for JSON.

        Returns
        -------
        dict
            Value of each attribute by its name.
        """
        return asdict(self)


@dataclass(frozen=True)
class CycleMeans:
    """Means over cycles, with standard errors."""

    cycle: Cycle
    """Measures of the mean cycle, SI units."""
    errors: Cycle | None
    """Their standard errors, SI units; None if they are not known."""
    sticks: bool | None
    """Whether the cycles stick; None if that is not known."""
    amplitudes: FloatArray
    """Amplitude of each cycle, m; shape (cycles,)."""

    @classmethod
    def over(cls, cycles: Sequence[Cycle], share: float = 0.0) -> Self:
        """Return the means over single cycles, which stick if more than this share of them does.

        The error of a mean is the standard deviation of the cycles over the root of their number;
        below three it is not known. Whether they stick, half of them must tell, and those that do
        not tell may stick half as long as the others, or half longer.
        """
        values = np.array([[*vars(cycle).values()] for cycle in cycles])
        unknown = np.isnan(values[:, -1])
        known = values[~unknown, -1]
        values[unknown, -1] = known.mean() if len(known) else 0.0
        count, mean, errors = len(cycles), np.add.reduce(values) / len(cycles), None
        if count >= LEAST_CYCLES:  # as values.std(axis=0, ddof=1), in half of its time
            squares = (values - mean) ** 2
            scatter = np.sqrt(np.add.reduce(squares) / (count - 1)) / count**0.5
            if unknown.any():
                own = known.std(ddof=1) / len(known) ** 0.5 if len(known) >= LEAST_CYCLES else nan
                scatter[-1] = hypot(own, 0.5 * mean[-1] * unknown.mean())
            errors = Cycle(*scatter.tolist())
        sticks = bool(np.count_nonzero(known) > share * len(known))
        told = 2 * len(known) >= count
        return cls(Cycle(*mean.tolist()), errors, sticks if told else None, values[:, 0])

    def measures(self, resting: bool, steady: bool | None, trend: Trend | None) -> Measures:
        """Return the measures of a motion with this mean; one that is `resting` has no period."""
        count = len(self.amplitudes)
        if resting:
            regime = Regime.EQUILIBRIUM
            return without_cycles(self.cycle, regime, count, steady=steady, trend=trend)
        measures = Measures(
            **vars(self.cycle),
            cycles=count,
            regime=Regime.STICK_SLIP if self.sticks else Regime.PURE_SLIP,
            steady=steady,
            trend=trend,
            errors=self.errors and {n: e for n, e in vars(self.errors).items() if not isnan(e)},
        )
        return undecided(measures) if self.sticks is None else measures


def undecided(measures: Measures) -> Measures:
    """Return measures that do not say whether the slide sticks."""
    errors = measures.errors and {
        name: error for name, error in measures.errors.items() if name != "stick_fraction"
    }
    return replace(measures, regime=None, stick_fraction=None, errors=errors)


def with_drift(measures: Measures, drift: Drift) -> Measures:
    """Return the measures of a run with these trends."""
    unknown = measures.regime in (None, Regime.UNBOUNDED, Regime.UNDERSAMPLED)
    rates = {} if unknown else drift.rates(measures.period)
    if not rates:
        return measures
    trend = measures.trend or Trend.DRIFTING
    return replace(measures, steady=False, trend=trend, drift=rates)


def measures_of(report: Mapping[str, Any]) -> Measures:
    """Return the measures that a report has by name."""
    return Measures(**{measure.name: report[measure.name] for measure in fields(Measures)})


def without_cycles(
    motion: Cycle | None,
    regime: Regime | None,
    cycles: int = 0,
    *,
    steady: bool | None = None,
    trend: Trend | None = None,
) -> Measures:
    """Return the measures of a motion that has no period."""
    means: dict[str, Any] = dict.fromkeys(field.name for field in fields(Cycle))
    means |= {} if motion is None else vars(motion)
    means |= {"period": None, "frequency": None}
    return Measures(**means, cycles=cycles, regime=regime, steady=steady, trend=trend)
