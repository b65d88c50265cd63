"""The loop of the paper and what its equations tell of it, and constants, for the claims.

Everything is dimensionless, for the unit drive of `figures`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from reproduction.claims.verdict import Formula, Number
from reproduction.figures import STRIBECK, unit_drive
from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.drive_system import SLIP
from stickslip_ros.model.friction import FrictionLaw
from stickslip_ros.model.functions import zero_between
from stickslip_ros.model.hybrid import Mode
from stickslip_ros.model.plain_drive import drive_system
from stickslip_ros.motion import Motion, RecordedMotion
from stickslip_ros.motion.compiled_flow import flow_rates, parameter_values
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

PRINTED_ONSET = 0.4372
"""v_b0 of section 3.2."""

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


@dataclass(frozen=True)
class Loop:
    """A drive, open or with a washout filter, and what its equations tell."""

    drive: Drive
    gains: Washout | None = None

    @cached_property
    def expansion(self) -> Expansion:
        """Derivatives of the right-hand side at the equilibrium."""
        return known(expand(self.drive, self.gains))

    @property
    def stable(self) -> bool:
        """Whether the equilibrium is stable."""
        return bool(self.expansion.stable)

    @property
    def eigenvalues(self) -> npt.NDArray[np.complex128]:
        """Eigenvalues at the equilibrium, that of the pair with positive frequency first."""
        return self.expansion.eigenvalues

    @property
    def equilibrium(self) -> float:
        """Displacement at the equilibrium."""
        return float(self.expansion.equilibrium[0])

    @property
    def trace(self) -> float:
        """Trace of the Jacobian: without a filter p of eq. 8, unstable above zero."""
        return float(np.trace(self.expansion.jacobian))

    @cached_property
    def hopf(self) -> HopfPoint:
        """The last Hopf point over the belt speed."""
        return hopf_points(self.drive, self.gains)[-1]

    @cached_property
    def onset(self) -> StickingOnset:
        """The belt speed below which the slide sticks."""
        return sticking_onset(self.drive)

    @property
    def exact_onset(self) -> float:
        """The stick-slip onset speed of the motion itself."""
        return known(self.onset.exact)

    @property
    def approximate_onset(self) -> float:
        """The stick-slip onset speed by averaging."""
        return known(self.onset.approximate)

    @cached_property
    def cycles(self) -> tuple[LimitCycle, ...]:
        """All limit cycles of the open loop, stable or not."""
        return tuple(limit_cycles(self.drive))

    @property
    def amplitudes(self) -> list[float]:
        """Displacement amplitudes of the limit cycles."""
        return [cycle.measures.amplitude or 0.0 for cycle in self.cycles]

    @property
    def speed_amplitude(self) -> float:
        """Speed amplitude of the least limit cycle."""
        return self.cycles[0].measures.velocity_amplitude or 0.0

    @property
    def stick_fraction(self) -> float:
        """Stick fraction of the least limit cycle."""
        return self.cycles[0].measures.stick_fraction or 0.0

    @property
    def multipliers(self) -> list[float]:
        """Magnitude of the largest Floquet multiplier of each limit cycle."""
        return [abs(cycle.multipliers[0]) for cycle in self.cycles]

    @property
    def only_rests(self) -> bool:
        """Whether the equilibrium is stable and there is no limit cycle."""
        return self.stable and not self.cycles

    @property
    def from_rest(self) -> LimitCycle | None:
        """The limit cycle that the motion from rest at X = 0 leads to."""
        return limit_cycle_of_run(self.drive, 0.0, control=self.gains)

    @property
    def final_amplitude(self) -> float:
        """The amplitude of that cycle, zero if there is none."""
        cycle = self.from_rest
        return 0.0 if cycle is None else cycle.measures.amplitude or 0.0

    @property
    def bounded(self) -> bool:
        """Whether the motion from rest at X = 0 does not diverge."""
        motion = Motion(self.drive, 0.0, 0.0)
        motion.advance(600.0)  # a diverging motion has diverged by then
        return not motion.unbounded

    @property
    def arrivals(self) -> list[float]:
        """Reactions k x + c v0 with which a slide reaches the belt's speed.

        They start after the release and end with the first one that friction can hold.
        """
        drive = self.drive
        motion = RecordedMotion(drive, release_position(drive), drive.belt_speed)
        motion.take_breakpoints()
        *_, breakpoints = follow(motion)
        arrived = np.abs(breakpoints.velocity - drive.belt_speed) <= _ROUNDING * drive.belt_speed
        arrived &= np.logical_or.accumulate(breakpoints.velocity < 0.0) & ~breakpoints.sticking
        reactions = drive.stiffness * breakpoints.position[arrived]
        reactions += drive.damping * drive.belt_speed
        held = np.flatnonzero(np.abs(reactions) <= drive.normal_force * drive.friction.static)
        return reactions[: int(held[0]) + 1 if len(held) > 0 else None].tolist()

    def rates(self, states: FloatArray) -> FloatArray:
        """Return the derivatives by time of dimensionless states (n, m) of a slipping slide.

        n is 2, or 3 with a filter, for eq. 5 and eq. 19.
        """
        system = drive_system(self.drive, self.gains)
        signs = np.sign(states[1] - system.drive.belt_speed)
        modes = [parameter_values(system, Mode(SLIP, (sign,)), (0.0,)) for sign in signs.tolist()]
        return flow_rates(system, SLIP, states, np.array(modes).T)[0]


@cache
def at(
    belt_speed: float,
    damping: float = DAMPING,
    gains: Washout | None = None,
    *,
    stiffness: float = 1.0,
    friction: FrictionLaw = STRIBECK,
) -> Loop:
    """Return the loop of the unit drive at a belt speed, by default open."""
    drive = unit_drive(belt_speed, damping=damping, stiffness=stiffness, friction=friction)
    return Loop(drive, gains)


OPEN, TAKEN = at(1.0), at(1.0, TAKEN_DAMPING)
"""The open loops with the damping of eq. 5 and with that of eq. 8, for results over belt speeds."""


def printed_trace(belt_speeds: FloatArray) -> FloatArray:
    """Return 0.44 - 1.8 v0^2, as in eq. 8."""
    return 0.44 - 1.8 * belt_speeds**2


def critical_beta(belt_speed: float) -> float:
    """Return the beta of eq. 5 above which the equilibrium is stable, p = 0."""
    return at(belt_speed, 0.0).trace / 2.0


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
    return zero_between(lambda speed: at(speed).trace + 2.0, OPEN.hopf.belt_speed, 2.0)


@cache
def critical(
    belt_speed: float, damping: float = DAMPING, corner_frequency: float = 2.0
) -> CriticalGains:
    """Return the critical gains of the loop without a cubic gain."""
    gains = replace(FILTER, corner_frequency=corner_frequency)
    return known(critical_gains(unit_drive(belt_speed, damping=damping), gains))


def slip_friction(law: FrictionLaw, relative_speed: FloatArray) -> FloatArray:
    """Return the friction coefficients at relative speeds of either sign."""
    return law.coefficient(relative_speed, np.sign(relative_speed))


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
