"""Reference values for the claims, at the paper's parameters, and summaries of values in words.

Everything is dimensionless, for the unit drive of `figures`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_system import SLIP
from stickslip_ros.model.friction import FrictionLaw
from stickslip_ros.model.functions import zero_between
from stickslip_ros.model.hybrid import Mode
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.compiled_flow import flow_rates, parameter_values
from stickslip_ros.paper.claims.verdict import Formula, Number
from stickslip_ros.paper.figures import Portrait, unit_drive
from stickslip_ros.theory.critical_gains import CriticalGains, critical_gains
from stickslip_ros.theory.cycle_bounds import follow, release_position
from stickslip_ros.theory.hopf import HopfPoint, hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycle_of_run, limit_cycles
from stickslip_ros.theory.linear import Expansion, expand
from stickslip_ros.theory.shooting import LimitCycle
from stickslip_ros.theory.sticking import StickingOnset, sticking_onset

_T = TypeVar("_T")

DAMPING = 0.02
"""Coefficient 2 beta of X' in eq. 5 for the paper's beta of 0.01."""

TAKEN_DAMPING = 0.01
"""The value used in its place in eq. 8 and in all that follows from it: beta."""

TAKEN_FOR_DAMPING = f"With the damping {TAKEN_DAMPING:g} for {DAMPING:g}"
"""The correction that many of the paper's numbers need."""

PRINTED_HOPF_SPEED = 0.4944
"""v_b1, which eq. 11 uses."""

PRINTED_GAIN = -0.0395
"""Critical linear gain of eq. 21."""

STUDIED_SPEED = 0.49
"""The belt speed of section 4.1, which eq. 20 to 30 use."""

FILTER = Washout(corner_frequency=2.0, linear_gain=0.0, cubic_gain=0.0)
"""A washout filter with the cutoff frequency of eq. 20 and no gain."""

_ROUNDING = 1e-12
"""Deviation below which a speed equals that of the belt, as a share of it."""

BELT_SPEEDS = np.array([0.1, 0.25, 0.4, STUDIED_SPEED, 0.7, 1.0])
"""Belt speeds at which formulas are evaluated."""

SLOWER = (0.02, 0.05, 0.1)
"""Belt speeds down to a tenth of those of the figures."""

FASTER = (1.0, 2.0, 5.0, 10.0)
"""Belt speeds up to ten times those of the figures."""

STATES: FloatArray = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 40))
"""States X, Y, W at which formulas are evaluated."""


def known(value: _T | None) -> _T:
    """Return a value that exists for every drive of the claims."""
    assert value is not None
    return value


def expansion(
    belt_speed: float, damping: float = DAMPING, gains: Washout | None = None
) -> Expansion:
    """Return the derivatives of the right-hand side at the equilibrium."""
    return known(expand(unit_drive(belt_speed, damping=damping), gains))


def trace(belt_speed: float, damping: float = DAMPING) -> float:
    """Return p of eq. 8."""
    return trace_of(unit_drive(belt_speed, damping=damping))


def trace_of(drive: Drive) -> float:
    """Return p of any drive; above zero the equilibrium is unstable."""
    return float(np.trace(known(expand(drive)).jacobian))


@cache
def hopf_point(damping: float = DAMPING) -> HopfPoint:
    """Return the Hopf point over the belt speed."""
    (point,) = hopf_points(unit_drive(1.0, damping=damping))
    return point


def printed_trace(belt_speeds: FloatArray) -> FloatArray:
    """Return 0.44 - 1.8 v0^2, as in eq. 8."""
    return 0.44 - 1.8 * belt_speeds**2


def critical_beta(belt_speed: float) -> float:
    """Return the beta of eq. 5 above which the equilibrium is stable, p = 0."""
    return trace(belt_speed, 0.0) / 2.0


def for_both(compute: Callable[[float], _T]) -> tuple[_T, _T]:
    """Return the results for the damping of eq. 5 and for that of eq. 8."""
    return compute(DAMPING), compute(TAKEN_DAMPING)


def number_for_both(compute: Callable[[float], float], **values: Any) -> Number:
    """Return the number for the damping of eq. 5, corrected to that of eq. 8.

    The words of the row may contain the latter, `{taken}`.
    """
    here, taken = for_both(compute)
    return Number(here, {TAKEN_FOR_DAMPING: taken}, taken=taken, **values)


def formula_for_both(
    printed: FloatArray, true: Callable[[float], npt.ArrayLike], **values: Any
) -> Formula:
    """Return the formula for the damping of eq. 5, corrected to that of eq. 8."""
    here, taken = for_both(lambda damping: printed - np.asarray(true(damping)))
    return Formula(here, 0.0, {TAKEN_FOR_DAMPING: taken}, **values)


def overdamped_from() -> float:
    """Return the belt speed above which the eigenvalues are real, p = -2."""
    return zero_between(lambda speed: trace(speed) + 2.0, hopf_point().belt_speed, 2.0)


@cache
def onset(damping: float = DAMPING, stiffness: float = 1.0) -> StickingOnset:
    """Return the belt speed below which the slide sticks."""
    return sticking_onset(unit_drive(1.0, damping=damping, stiffness=stiffness))


def exact_onset(damping: float = DAMPING, stiffness: float = 1.0) -> float:
    """Return the stick-slip onset speed of the motion itself."""
    return known(onset(damping, stiffness).exact)


def approximate_onset(damping: float = DAMPING) -> float:
    """Return the stick-slip onset speed by averaging."""
    return known(onset(damping).approximate)


@cache
def cycles(
    belt_speed: float, damping: float = DAMPING, stiffness: float = 1.0
) -> tuple[LimitCycle, ...]:
    """Return all limit cycles of the open loop, stable or not."""
    return tuple(limit_cycles(unit_drive(belt_speed, damping=damping, stiffness=stiffness)))


def only_rest_at(belt_speeds: Sequence[float]) -> bool:
    """Return whether at each speed the equilibrium is stable and there is no limit cycle."""
    return all(expansion(speed).stable and not cycles(speed) for speed in belt_speeds)


@cache
def critical(belt_speed: float, damping: float, corner_frequency: float = 2.0) -> CriticalGains:
    """Return the critical gains of the loop without a cubic gain."""
    gains = replace(FILTER, corner_frequency=corner_frequency)
    return known(critical_gains(unit_drive(belt_speed, damping=damping), gains))


def controlled_amplitude(belt_speed: float, gains: Washout, damping: float = DAMPING) -> float:
    """Return the amplitude of the limit cycle that the motion from rest at X = 0 leads to."""
    cycle = limit_cycle_of_run(unit_drive(belt_speed, damping=damping), 0.0, control=gains)
    return 0.0 if cycle is None else cycle.measures.amplitude or 0.0


def arrivals(drive: Drive) -> list[float]:
    """Return the reactions k x + c v0 with which a slide reaches the belt's speed.

    They start after the release and end with the first one that friction can hold.
    """
    motion = RecordedMotion(drive, release_position(drive), drive.belt_speed)
    motion.take_breakpoints()
    *_, breakpoints = follow(motion)
    arrived = np.abs(breakpoints.velocity - drive.belt_speed) <= _ROUNDING * drive.belt_speed
    arrived &= np.logical_or.accumulate(breakpoints.velocity < 0.0) & ~breakpoints.sticking
    reactions = drive.stiffness * breakpoints.position[arrived] + drive.damping * drive.belt_speed
    held = np.flatnonzero(np.abs(reactions) <= drive.normal_force * drive.friction.static)
    return reactions[: int(held[0]) + 1 if len(held) > 0 else None].tolist()


def stays(drive: Drive) -> bool:
    """Return whether the motion from rest at X = 0 does not diverge."""
    motion = Motion(drive, 0.0, 0.0)
    motion.advance(600.0)  # a diverging motion has diverged by then
    return not motion.unbounded


def amplitudes(belt_speed: float, damping: float = DAMPING) -> list[float]:
    """Return the displacement amplitudes of the limit cycles."""
    found = [cycle.measures.amplitude for cycle in cycles(belt_speed, damping)]
    return [amplitude for amplitude in found if amplitude is not None]


def slip_friction(law: FrictionLaw, relative_speed: FloatArray) -> FloatArray:
    """Return the friction coefficients at relative speeds of either sign."""
    return law.coefficient(relative_speed, np.sign(relative_speed))


def rates(drive: Drive, states: FloatArray, gains: Washout | None = None) -> FloatArray:
    """Return the derivatives by time of dimensionless states (n, m) of a slipping slide.

    n is 2, or 3 with `gains` (SI), for eq. 5 and eq. 19.
    """
    system = drive_system(drive, gains)
    signs = np.sign(states[1] - system.drive.belt_speed)
    modes = [parameter_values(system, Mode(SLIP, (sign,)), (0.0,)) for sign in signs.tolist()]
    return flow_rates(system, SLIP).at(states, np.array(modes).T)[0]


def time_dependent() -> bool:
    """Return whether the equations depend on time explicitly."""
    return not drive_system(unit_drive(1.0)).autonomous


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
    return [each.measures.stick_fraction or 0.0 for each in portraits if each.vibrates]
