"""Sections 1 and 2 up to eq. 5: the model."""

from math import isclose, sqrt

import numpy as np

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Stribeck
from stickslip_ros.model.functions import zero_between
from stickslip_ros.paper.claims.paper_values import (
    DAMPING,
    FASTER,
    STATES,
    cycles,
    exact_onset,
    hopf_point,
    only_rest_at,
    rates,
    slip_friction,
    time_dependent,
    trace,
)
from stickslip_ros.paper.claims.verdict import Computations, Evidence, Formula, Number, Observation
from stickslip_ros.paper.figures import STRIBECK, unit_drive

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


def _smallest_kinetic() -> tuple[float, float]:
    """Return the smallest kinetic coefficient, and its relative speed."""
    # Without damping the trace is the friction's slope at the belt's speed.
    speed = zero_between(lambda v: trace(v, 0.0), 1e-3, _LARGEST_SPEED)
    return _kinetic(speed), speed


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
    return Formula(acceleration / scale, rates(drive, STATES[:2])[1])


@computes("eq-2")
def _(_: Evidence) -> Formula:
    law = _SLIDE.dimensionless.friction
    coefficient = slip_friction(law, STATES[1] - _SLIDE.belt_speed / _SLIDE.speed_scale)
    return Formula(
        coefficient - _SLIDE.damping_coefficient * STATES[1] - STATES[0],
        rates(_SLIDE, STATES[:2])[1],
    )


@computes("scales")
def _(_: Evidence) -> Formula:
    time = 1.0 / sqrt(_SLIDE.stiffness / _SLIDE.mass)
    length = _SLIDE.normal_force / _SLIDE.stiffness
    inertia, spring = _SLIDE.mass * length / time**2, _SLIDE.stiffness * length
    return Formula(np.array([inertia, spring]) / _SLIDE.normal_force, [1.0, 1.0])


@computes("scaled-damping")
def _(_: Evidence) -> Formula:
    read = _SLIDE.damping * sqrt(_SLIDE.stiffness / _SLIDE.mass) / _SLIDE.stiffness
    return Formula(
        None,
        _SLIDE.damping_coefficient,
        {"With omega, which is not defined, read as omega_0": read},
        slide=_SLIDE.damping_coefficient,
    )


@computes("scaled-belt-speed")
def _(_: Evidence) -> Formula:
    length = _SLIDE.normal_force / _SLIDE.stiffness
    read = _SLIDE.belt_speed / (sqrt(_SLIDE.stiffness / _SLIDE.mass) * length)
    return Formula(
        None, _SLIDE.dimensionless.belt_speed, {"With L, which is not defined, read as N/k": read}
    )


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
computes["smallest-coefficient"] = lambda _: Number(_smallest_kinetic()[0])
computes["smallest-at"] = lambda _: Number(_smallest_kinetic()[1])


@computes("names-of-coefficients")
def _(_: Evidence) -> Observation:
    break_away, (smallest, _speed) = _kinetic(0.0), _smallest_kinetic()
    return Observation(
        isclose(STRIBECK.static, smallest, rel_tol=1e-6),
        isclose(STRIBECK.static, break_away, rel_tol=1e-6)
        and isclose(STRIBECK.minimum, smallest, rel_tol=1e-6),
        break_away=break_away,
        smallest=smallest,
        law=STRIBECK,
    )


@computes("eq-3-range")
def _(evidence: Evidence) -> Observation:
    smallest_at = _smallest_kinetic()[1]
    end = zero_between(lambda v: _kinetic(v) - STRIBECK.static, smallest_at, _LARGEST_SPEED)
    # A slide that sticks reaches the belt's speed, and its speed spans twice the amplitude.
    fastest = 2.0 * (cycles(exact_onset() * (1.0 - 1e-6))[0].measures.velocity_amplitude or 0.0)
    highest = float(evidence.bifurcation(2).values.max())
    return Observation(
        end >= max(fastest, highest),
        end > smallest_at,
        end=end,
        at_twice=_kinetic(2.0 * smallest_at),
        highest=highest,
        fastest=fastest,
    )


computes["eq-4"] = lambda _: Formula(rates(unit_drive(0.4), STATES[:2])[0], STATES[1])


@computes("eq-5")
def _(_: Evidence) -> Formula:
    friction = slip_friction(STRIBECK, STATES[1] - 0.4)
    printed = [STATES[1], -DAMPING * STATES[1] - STATES[0] + friction]
    return Formula(printed, rates(unit_drive(0.4), STATES[:2]))


@computes("eq-5-origin")
def _(_: Evidence) -> Formula:
    law = slip_friction(STRIBECK, STATES[1] - 0.4)
    return Formula(
        law,
        rates(unit_drive(0.4), STATES[:2])[1],
        {
            "With eq. 2, which contains eq. 3, in place of eq. 3": law
            - DAMPING * STATES[1]
            - STATES[0]
        },
    )


@computes("eq-5-stick")
def _(evidence: Evidence) -> Observation:
    portrait = evidence.portraits(6).portraits[0]
    cycle = portrait.last_cycles
    reaction = cycle.position[cycle.stuck] + DAMPING * portrait.drive.belt_speed
    least, most = float(reaction.min()), float(reaction.max())
    limit = STRIBECK.static
    return Observation(
        max(abs(least), abs(most)) < 1e-9,
        max(abs(least), abs(most)) <= limit * (1.0 + 1e-9),
        least=least,
        most=most,
        portrait=portrait,
        limit=limit,
    )


@computes("rest-at-high-speed")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(2)
    fast = [
        (measures, drive)
        for measures, drive in zip(figure.measures, figure.drives, strict=True)
        if drive.belt_speed > 1.05 * hopf_point().belt_speed
    ]
    resting = [measures.regime is Regime.EQUILIBRIUM for measures, _ in fast]
    off = max(abs((m.midpoint or 0.0) / drive.equilibrium_position - 1.0) for m, drive in fast)
    return Observation(
        all(resting) and off < 1e-4 and only_rest_at(FASTER),
        resting=sum(resting),
        total=len(fast),
        hopf=hopf_point(),
        off=off,
    )
