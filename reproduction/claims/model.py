"""Sections 1 and 2 up to eq. 5: the model."""

from math import isclose, sqrt

import numpy as np

from reproduction.claims.paper_values import (
    DAMPING,
    FASTER,
    OPEN,
    STATES,
    Loop,
    at,
    slip_friction,
    time_dependent,
)
from reproduction.claims.verdict import Computations, Evidence, Formula, Number, Observation
from reproduction.figures import STRIBECK
from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Stribeck
from stickslip_ros.model.functions import zero_between

computes = Computations()

_SLIDE = Drive(
    mass=3.0,
    damping=25.0,
    stiffness=5e3,
    normal_force=200.0,
    belt_speed=0.7,
    friction=Stribeck(STRIBECK.static, STRIBECK.minimum, 0.8),
)
"""A drive with no scale of one."""

_LARGEST_SPEED = 2.0
"""Largest relative speed at which the friction law is evaluated."""


def _kinetic(speed: float) -> float:
    return float(-STRIBECK.coefficient(speed, 1.0))


def _smallest_at() -> float:
    """Return the relative speed of the smallest kinetic coefficient."""
    # Without damping the trace is the friction's slope at the belt's speed.
    return zero_between(lambda v: at(v, 0.0).trace, 1e-3, _LARGEST_SPEED)


computes["normal-vibration"] = lambda _: Observation(
    time_dependent(), outcome="depends on time" if time_dependent() else "constant normal force"
)


@computes("eq-1")
def _(_: Evidence) -> Formula:
    drive = _SLIDE
    position, speed = STATES[0] * drive.length_scale, STATES[1] * drive.speed_scale
    friction = drive.normal_force * slip_friction(drive.friction, speed - drive.belt_speed)
    acceleration = (friction - drive.damping * speed - drive.stiffness * position) / drive.mass
    scale = drive.angular_frequency * drive.speed_scale
    return Formula(acceleration / scale, Loop(drive).rates(STATES[:2])[1])


@computes("eq-2")
def _(_: Evidence) -> Formula:
    law = _SLIDE.dimensionless.friction
    coefficient = slip_friction(law, STATES[1] - _SLIDE.belt_speed / _SLIDE.speed_scale)
    printed = coefficient - _SLIDE.damping_coefficient * STATES[1] - STATES[0]
    return Formula(printed, Loop(_SLIDE).rates(STATES[:2])[1])


@computes("scales")
def _(_: Evidence) -> Formula:
    time = 1.0 / sqrt(_SLIDE.stiffness / _SLIDE.mass)
    length = _SLIDE.normal_force / _SLIDE.stiffness
    inertia, spring = _SLIDE.mass * length / time**2, _SLIDE.stiffness * length
    return Formula(np.array([inertia, spring]) / _SLIDE.normal_force, [1.0, 1.0])


@computes("scaled-damping")
def _(_: Evidence) -> Formula:
    read = _SLIDE.damping * sqrt(_SLIDE.stiffness / _SLIDE.mass) / _SLIDE.stiffness
    corrections = {"With omega, which is not defined, read as omega_0": read}
    return Formula(None, _SLIDE.damping_coefficient, corrections, slide=_SLIDE)


@computes("scaled-belt-speed")
def _(_: Evidence) -> Formula:
    length = _SLIDE.normal_force / _SLIDE.stiffness
    read = _SLIDE.belt_speed / (sqrt(_SLIDE.stiffness / _SLIDE.mass) * length)
    corrections = {"With L, which is not defined, read as N/k": read}
    return Formula(None, _SLIDE.dimensionless.belt_speed, corrections)


computes["excitation-frequency"] = lambda _: Observation(
    time_dependent(), outcome="time-dependent" if time_dependent() else "autonomous"
)


@computes("eq-3")
def _(_: Evidence) -> Formula:
    static, minimum, speed = STRIBECK.static, STRIBECK.minimum, STRIBECK.minimum_speed
    v = np.linspace(-1.0, 1.0, 40)
    drop = static - minimum
    printed = -static * np.sign(v) + 3.0 * drop * v / (2.0 * speed) - drop * v**3 / (2.0 * speed**3)
    # a v - b v^3 with a - 3 b v_m^2 = 0 and a v_m - b v_m^3 = mu_s - mu_m
    a, b = np.linalg.solve([[1.0, -3.0 * speed**2], [speed, -(speed**3)]], [0.0, drop])
    return Formula(printed, -static * np.sign(v) + a * v - b * v**3, a=a, b=b)


computes["static-coefficient"] = lambda _: Number(_kinetic(0.0))
computes["smallest-coefficient"] = lambda _: Number(_kinetic(_smallest_at()))
computes["smallest-at"] = lambda _: Number(_smallest_at())


@computes("names-of-coefficients")
def _(_: Evidence) -> Observation:
    break_away, smallest = _kinetic(0.0), _kinetic(_smallest_at())
    named = isclose(STRIBECK.static, smallest, rel_tol=1e-6)
    exchanged = isclose(STRIBECK.static, break_away, rel_tol=1e-6)
    exchanged &= isclose(STRIBECK.minimum, smallest, rel_tol=1e-6)
    return Observation(named, exchanged, break_away=break_away, smallest=smallest, law=STRIBECK)


@computes("eq-3-range")
def _(evidence: Evidence) -> Observation:
    smallest_at = _smallest_at()
    end = zero_between(lambda v: _kinetic(v) - STRIBECK.static, smallest_at, _LARGEST_SPEED)
    # A slide that sticks reaches the belt's speed, and its speed spans twice the amplitude.
    fastest = 2.0 * at(OPEN.exact_onset * (1.0 - 1e-6)).speed_amplitude
    highest = float(evidence.bifurcation(2).values.max())
    return Observation(
        end >= max(fastest, highest),
        end > smallest_at,
        end=end,
        at_twice=_kinetic(2.0 * smallest_at),
        highest=highest,
        fastest=fastest,
    )


computes["eq-4"] = lambda _: Formula(at(0.4).rates(STATES[:2])[0], STATES[1])


def _eq_5() -> FloatArray:
    """Return X2' of eq. 5 at the tested states."""
    friction = slip_friction(STRIBECK, STATES[1] - 0.4)
    return friction - DAMPING * STATES[1] - STATES[0]


computes["eq-5"] = lambda _: Formula([STATES[1], _eq_5()], at(0.4).rates(STATES[:2]))
computes["eq-5-origin"] = lambda _: Formula(
    slip_friction(STRIBECK, STATES[1] - 0.4),
    at(0.4).rates(STATES[:2])[1],
    {"With eq. 2, which contains eq. 3, in place of eq. 3": _eq_5()},
)


@computes("eq-5-stick")
def _(evidence: Evidence) -> Observation:
    portrait = evidence.portraits(6).portraits[0]
    cycle = portrait.last_cycles
    reaction = cycle.position[cycle.stuck] + DAMPING * portrait.drive.belt_speed
    needed, rounding = float(np.abs(reaction).max()), 1e-9
    return Observation(
        needed < rounding,
        needed <= STRIBECK.static * (1.0 + rounding),
        least=float(reaction.min()),
        most=float(reaction.max()),
        drive=portrait.drive,
    )


@computes("rest-at-high-speed")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(2)
    fast = figure.values > 1.05 * OPEN.hopf.belt_speed
    resting = figure.columns.regime[fast] == Regime.EQUILIBRIUM
    rest = np.array([drive.equilibrium_position for drive in figure.drives])[fast]
    off = np.abs(figure.columns.midpoint[fast] / rest - 1.0).max()
    return Observation(
        all(resting) and off < 1e-4 and all(at(speed).only_rests for speed in FASTER),
        resting=sum(resting),
        total=len(resting),
        off=float(off),
    )
