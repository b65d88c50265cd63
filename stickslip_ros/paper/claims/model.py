"""Sections 1 and 2 up to eq. 5: the model."""

from math import isclose, sqrt

import numpy as np

from stickslip_ros.paper.claims.claim import Computations, Evidence, Formula, Number, Observation
from stickslip_ros.paper.claims.paper_values import (
    DAMPING,
    FASTER,
    STATES,
    cycles,
    exact_onset,
    hopf_point,
    listed,
    only_rest_at,
    rates,
    slip_friction,
    time_dependent,
    trace,
)
from stickslip_ros.paper.figures import STRIBECK, unit_drive
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Stribeck
from stickslip_ros.physics.model.functions import zero_between

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

_FASTEST = 2.0
"""Largest relative speed at which the friction law is evaluated."""


def _kinetic(speed: float) -> float:
    return float(-STRIBECK.coefficient(speed, 1.0))


def _smallest_kinetic() -> tuple[float, float]:
    """Return the smallest kinetic coefficient, and its relative speed."""
    # Without damping the trace is the friction's slope at the belt's speed.
    speed = zero_between(lambda v: trace(v, 0.0), 1e-3, _FASTEST)
    return _kinetic(speed), speed


computes["normal-vibration"] = lambda _: Observation(
    "depends on time" if time_dependent() else "constant normal force",
    time_dependent(),
    remark="In eq. 1 to 5 only the state changes with time, and it contains no normal motion. "
    "N is a constant that only sets the scales.",
)


@computes("eq-1")
def _(_: Evidence) -> Formula:
    drive = _SLIDE
    position, speed = STATES[0] * drive.length_scale, STATES[1] * drive.speed_scale
    friction = drive.normal_force * slip_friction(drive.friction, speed - drive.belt_speed)
    acceleration = (friction - drive.damping * speed - drive.stiffness * position) / drive.mass
    scale = drive.angular_frequency * drive.speed_scale
    return Formula(
        acceleration / scale,
        rates(drive, STATES[:2])[1],
        remark="Compared with the integrated dimensionless equations, scaled to SI units.",
    )


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
    return Formula(
        np.array([inertia, spring]) / _SLIDE.normal_force,
        [1.0, 1.0],
        remark="The coefficients of X'' and X, for a drive without a scale of one.",
    )


@computes("scaled-damping")
def _(_: Evidence) -> Formula:
    read = _SLIDE.damping * sqrt(_SLIDE.stiffness / _SLIDE.mass) / _SLIDE.stiffness
    return Formula(
        None,
        _SLIDE.damping_coefficient,
        {"With omega, which is not defined, read as omega_0": read},
        f"The coefficient of X' is c / sqrt(k m) = {_SLIDE.damping_coefficient:.4g} for the tested "
        "drive.",
    )


@computes("scaled-belt-speed")
def _(_: Evidence) -> Formula:
    length = _SLIDE.normal_force / _SLIDE.stiffness
    read = _SLIDE.belt_speed / (sqrt(_SLIDE.stiffness / _SLIDE.mass) * length)
    return Formula(
        None,
        _SLIDE.dimensionless.belt_speed,
        {"With L, which is not defined, read as N/k": read},
        "One symbol is used for the speed in m/s and for the dimensionless one.",
    )


computes["excitation-frequency"] = lambda _: Observation(
    "time-dependent" if time_dependent() else "autonomous",
    time_dependent(),
    remark="Omega is scaled but not used: the equations do not contain time.",
)


@computes("eq-3")
def _(_: Evidence) -> Formula:
    static, minimum, speed = STRIBECK.static, STRIBECK.minimum, STRIBECK.minimum_speed
    v = np.linspace(-1.0, 1.0, 40)
    drop = static - minimum
    printed = -static * np.sign(v) + 3.0 * drop * v / (2.0 * speed) - drop * v**3 / (2.0 * speed**3)
    # a v - b v^3 with a - 3 b v_m^2 = 0 and a v_m - b v_m^3 = mu_s - mu_m
    a, b = np.linalg.solve([[1.0, -3.0 * speed**2], [speed, -(speed**3)]], [0.0, drop])
    return Formula(
        printed,
        -static * np.sign(v) + a * v - b * v**3,
        remark="The odd cubic that starts at mu_s and has its smallest magnitude mu_m at v_m has "
        f"a = {a:.4g}, b = {b:.4g}.",
    )


computes["static-coefficient"] = lambda _: Number(
    _kinetic(0.0), remark="The magnitude of the law as the relative speed approaches zero."
)
computes["smallest-coefficient"] = lambda _: Number(
    _smallest_kinetic()[0], remark="Where heyoka's derivative of the law is zero."
)
computes["smallest-at"] = lambda _: Number(
    _smallest_kinetic()[1], remark="Where heyoka's derivative of the law is zero."
)


@computes("names-of-coefficients")
def _(_: Evidence) -> Observation:
    break_away, (smallest, _speed) = _kinetic(0.0), _smallest_kinetic()
    return Observation(
        f"static {break_away:.4g}, smallest kinetic {smallest:.4g}",
        isclose(STRIBECK.static, smallest, rel_tol=1e-6),
        isclose(STRIBECK.static, break_away, rel_tol=1e-6)
        and isclose(STRIBECK.minimum, smallest, rel_tol=1e-6),
        f"The opposite is true: the slide breaks away at mu_s = {STRIBECK.static:g}, and "
        f"mu_m = {STRIBECK.minimum:g} is the smallest coefficient while it slips.",
    )


@computes("eq-3-range")
def _(evidence: Evidence) -> Observation:
    smallest_at = _smallest_kinetic()[1]
    end = zero_between(lambda v: _kinetic(v) - STRIBECK.static, smallest_at, _FASTEST)
    # A slide that sticks reaches the belt's speed, and its speed spans twice the amplitude.
    fastest = 2.0 * (cycles(exact_onset() * (1.0 - 1e-6))[0].measures.velocity_amplitude or 0.0)
    highest = float(evidence.bifurcation(2).values.max())
    return Observation(
        f"up to a relative speed of {end:.4g}",
        end >= max(fastest, highest),
        end > smallest_at,
        f"Only below {end:.4g}, where it exceeds the static coefficient; at twice v_m it is "
        f"{_kinetic(2.0 * smallest_at):.4g} already. The belt of Fig. 2 reaches {highest:.4g}, "
        f"and the vibrations at the onset of sticking {fastest:.4g}.",
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
        f"{least:.4g} to {most:.4g} instead of 0",
        max(abs(least), abs(most)) < 1e-9,
        max(abs(least), abs(most)) <= limit * (1.0 + 1e-9),
        f"At v0 = {portrait.drive.belt_speed:g} a slide that sticks needs a friction of "
        f"{least:.4g} to {most:.4g}; with sgn(0) = 0 the system gives none. The missing "
        f"rule: the slide sticks while X + 2 beta v0 is within mu_s = {limit:g}.",
    )


@computes("rest-at-high-speed")
def _(evidence: Evidence) -> Observation:
    figure = evidence.bifurcation(2)
    fast = [
        (measures, drive)
        for measures, drive in zip(figure.diagram.measures, figure.diagram.drives, strict=True)
        if drive.belt_speed > 1.05 * hopf_point().belt_speed
    ]
    resting = [measures.regime is Regime.EQUILIBRIUM for measures, _ in fast]
    off = max(abs((m.midpoint or 0.0) / drive.equilibrium_position - 1.0) for m, drive in fast)
    return Observation(
        f"at {sum(resting)} of {len(fast)} belt speeds",
        all(resting) and off < 1e-4 and only_rest_at(FASTER),
        remark=f"All speeds of Fig. 2 that are 5 percent or more above the Hopf speed of "
        f"{hopf_point().belt_speed:.5g}; X deviates from mu(-v0) by {off:.4%} at most. At "
        f"v0 = {listed(FASTER)} too the equilibrium is stable and shooting finds no limit cycle.",
    )
