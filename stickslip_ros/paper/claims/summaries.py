"""Summaries of values in words, and of phase portraits in numbers."""

from collections.abc import Callable, Sequence
from itertools import pairwise

from stickslip_ros.paper.portraits import Portrait
from stickslip_ros.physics.measures.cycle_measures import Regime

VIBRATING = (Regime.STICK_SLIP, Regime.PURE_SLIP)


def falling(values: Sequence[float]) -> bool:
    """Return whether each value is below the previous one."""
    return all(later < earlier for earlier, later in pairwise(values))


def border(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Return the border between `low`, where `holds` is true, and `high`, where it is false."""
    while high - low > 1e-4:
        middle = (low + high) / 2.0
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def listed(values: Sequence[float]) -> str:
    """Return the values as a list in words."""
    return ", ".join(f"{value:.4g}" for value in values)


def belt_speeds(portraits: Sequence[Portrait]) -> str:
    """Return the belt speeds of the motions as a list in words."""
    return listed([portrait.drive.belt_speed for portrait in portraits])


def regimes(portraits: Sequence[Portrait]) -> list[Regime | None]:
    """Return the final regime of each motion."""
    return [portrait.measures.regime for portrait in portraits]


def amplitude(portrait: Portrait) -> float:
    """Return the final displacement amplitude of a motion, zero at rest."""
    at_rest = portrait.measures.regime is Regime.EQUILIBRIUM
    return 0.0 if at_rest else portrait.measures.amplitude or 0.0


def stick_fractions(portraits: Sequence[Portrait]) -> list[float]:
    """Return the stick fractions of the vibrating motions."""
    return [
        portrait.measures.stick_fraction or 0.0
        for portrait in portraits
        if portrait.measures.regime in VIBRATING
    ]


def complex_number(value: complex) -> str:
    """Return the value in words."""
    return f"{value.real:.4f} {'-' if value.imag < 0.0 else '+'} {abs(value.imag):.4f} i"
