"""Stability of a scenario by theory, without a simulation of it."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import copysign, isclose, isinf, isnan
from typing import Any, TypeVar, cast

import numpy as np

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.actuator import IDEAL_ACTUATOR
from stickslip_ros.physics.model.control import ControlLaw
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import POSITION, SPEED
from stickslip_ros.physics.theory.bifurcation_branches import BifurcationBranches
from stickslip_ros.physics.theory.closed_forms import CubicLoop
from stickslip_ros.physics.theory.critical_gains import (
    critical_gains,
    limit_cycle_from_hopf,
    why_no_linear_gain,
)
from stickslip_ros.physics.theory.gain_intervals import gains_of, why_no_gains
from stickslip_ros.physics.theory.hopf import HopfPoint, hopf_points
from stickslip_ros.physics.theory.limit_cycles import LimitCycle, limit_cycle_of_run, limit_cycles
from stickslip_ros.physics.theory.linear import Expansion, expand
from stickslip_ros.physics.theory.linear_sampled_loop import (
    LONGEST_DELAY,
    LinearSampledLoop,
    not_linear,
    why_no_linear_loop,
)
from stickslip_ros.physics.theory.requirements import (
    AUTONOMOUS,
    SMOOTH,
    NotCoveredError,
    require,
)
from stickslip_ros.physics.theory.stability_map import CriticalGainCurves, StabilityMap
from stickslip_ros.physics.theory.sticking import sticking_onset
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.parameters import PlantParameters
from stickslip_ros.text import quantity

_Found = TypeVar("_Found")

Section = dict[str, Any]
Notes = dict[str, str]
"""Why a quantity does not exist, or what it omits, by its place in the sections."""

_NO_CONTROL = "the scenario has no controller"

_STICKING = ("onset_speed_approximate", "onset_speed", "speed_ranges", "searched_speeds")

_GAINS = ("critical_linear_gain", "first_lyapunov_coefficient", "critical_cubic_gain")

_BY_THIRD_DERIVATIVES = (
    "open_loop.first_lyapunov_coefficients",
    "closed_loop.first_lyapunov_coefficients",
    "closed_loop.first_lyapunov_coefficient",
    "closed_loop.critical_cubic_gain",
)
_SAMPLED_GAINS = ("critical_linear_gain", "stable_linear_gains")

_SAMPLED_LOOP = ("spectral_radius", "stable", "decay_rate", "settling_time", *_SAMPLED_GAINS)


def stability(scenario: Scenario) -> tuple[Section, Notes]:
    """Return the theoretical quantities of the scenario, in SI units, and notes on them.

    Raises InvalidInputError if belt or load follow a signal.
    """
    plant = scenario.plant
    drive = plant.as_drive()
    require("the theory of stability", drive, AUTONOMOUS)
    law = scenario.control_law
    notes: Notes = {}
    expansion = expand(drive)
    found: Section = {
        "equilibrium_position": drive.equilibrium_position if expansion else None,
        "open_loop": _open_loop(drive, expansion, notes),
        "sticking": _sticking(drive, notes),
        "closed_loop": _closed_loop(drive, law, notes),
        "sampled_loop": _sampled_loop(drive, law, plant, notes),
        "closed_forms": _closed_forms(drive, law),
    }
    for loop in ("open_loop", "closed_loop"):
        if found[loop]["stable"] is None and found[loop]["eigenvalues"]:
            notes[f"{loop}.stable"] = "it is neutral: a small deviation neither decays nor grows"
    omitted = _omitted(plant)
    if omitted and "sampled_loop" not in notes:
        notes["sampled_loop"] = "; ".join(omitted)
    if expansion is None:
        reach = float(max(drive.friction.limits)) * drive.length_scale
        shown = f"{reach:.4g}" if drive.is_dimensionless else quantity(reach, "m")
        reason = (
            "the belt is at rest, and friction holds the slide anywhere within mu_s N / k = "
            f"{shown}" + (" of bias_force / k" if drive.bias_force else "")
        )
        for place, value in _places(found):
            if value is None and not {place, place.split(".")[0]} & notes.keys():
                notes[place] = reason
    elif found["closed_forms"] is None:
        notes["closed_forms"] = "closed forms exist for the cubic Stribeck law only"
    kink = SMOOTH.lack(drive)
    if kink is not None:
        reason = f"the first Lyapunov coefficient needs {SMOOTH.need}: {kink}"
        for place in _BY_THIRD_DERIVATIVES:
            if not {place, place.split(".")[0]} & notes.keys():
                notes[place] = reason
    ideal = plant.sensor.exact and plant.actuator == IDEAL_ACTUATOR
    if not ideal and "closed_loop" not in notes:
        notes["closed_loop"] = "sensor and actuator are omitted: control is continuous here"
    return found, notes


def _omitted(plant: PlantParameters) -> list[str]:
    """Return sentences on what of the loop the linear theory leaves out."""
    sentences: list[str] = []
    if plant.force_jitter > 0.0:
        sentences.append("force_jitter is omitted: the delay of the force is constant here")
    sensor, actuator = plant.sensor, plant.actuator
    values = {
        "sensor.position_resolution": sensor.position_resolution,
        "sensor.position_noise": sensor.position_noise,
        "sensor.velocity_noise": sensor.velocity_noise,
        "actuator.limit": 0.0 if isinf(actuator.limit) else actuator.limit,
        "actuator.resolution": actuator.resolution,
    }
    names = [name for name, value in values.items() if value]
    if names:
        verb = "is" if len(names) == 1 else "are"
        sentences.append(f"{', '.join(names)} {verb} omitted: the loop is linear here")
    return sentences


def _covered(place: str, notes: Notes, otherwise: _Found, function: Callable[[], _Found]) -> _Found:
    """Return what a function returns; note it, and return `otherwise`, if it refuses the drive."""
    try:
        return function()
    except NotCoveredError as error:
        notes[place] = str(error)
        return otherwise


def _places(found: Section) -> Iterator[tuple[str, Any]]:
    """Yield the quantities with their places; within sections as section.name."""
    for section, value in found.items():
        if isinstance(value, dict):
            quantities = cast(Section, value)
            yield from ((f"{section}.{name}", each) for name, each in quantities.items())
        else:
            yield section, value


def _eigenvalues(drive: Drive, expansion: Expansion | None) -> Section:
    if expansion is None:
        return dict.fromkeys(("equilibrium_position", "eigenvalues", "stable"))
    values = expansion.eigenvalues * drive.angular_frequency
    return {
        "equilibrium_position": float(expansion.equilibrium[POSITION]) * drive.length_scale,
        "eigenvalues": [[float(value.real), float(value.imag)] for value in values],
        "stable": expansion.stable,
    }


def _open_loop(drive: Drive, expansion: Expansion | None, notes: Notes) -> Section:
    place = "open_loop.limit_cycles"
    points = hopf_points(drive)
    cycles = _covered(place, notes, [], lambda: limit_cycles(drive))
    if not points:
        notes["open_loop.hopf_speeds"] = _why_no_hopf_speed(drive)
    if not cycles and place not in notes:
        notes[place] = "no periodic motion was found, or the drive is too stiff to integrate"
    return {
        **_eigenvalues(drive, expansion),
        **_hopf_points(points),
        "limit_cycles": [_cycle(cycle) for cycle in cycles],
    }


def _why_no_hopf_speed(drive: Drive) -> str:
    moving = expand(replace(drive, belt_speed=drive.belt_speed or drive.speed_scale))
    assert moving is not None
    if abs(moving.jacobian[SPEED, SPEED]) < 1e-12:  # rounding only
        return "the slope of the friction and the damping balance: the equilibrium is neutral"
    return (
        "the slope of the friction and the damping balance at no belt speed; the equilibrium is "
        f"{'stable' if moving.stable else 'unstable'} at every one"
    )


def _hopf_points(points: list[HopfPoint]) -> Section:
    return {
        "hopf_speeds": [point.belt_speed for point in points],
        "hopf_angular_frequencies": [point.angular_frequency for point in points],
        "crossing_speeds": [point.crossing_speed for point in points],
        "first_lyapunov_coefficients": [_known(p.first_lyapunov_coefficient) for p in points],
    }


def _known(value: float) -> float | None:
    """Return None for nan."""
    return None if isnan(value) else value


def _sticking(drive: Drive, notes: Notes) -> Section:
    onset = _covered("sticking", notes, None, lambda: sticking_onset(drive))
    if onset is None:
        return dict.fromkeys(_STICKING)
    if onset.no_approximate is not None:
        notes["sticking.onset_speed_approximate"] = onset.no_approximate
    if onset.no_exact is not None:
        notes["sticking.onset_speed"] = onset.no_exact
    lowest, highest = onset.followed
    if not onset.ranges:
        notes["sticking.speed_ranges"] = (
            f"the slide sticks at no belt speed from {lowest:.4g} to {highest:.4g} m/s"
        )
    elif len(onset.ranges) > 1:
        notes["sticking.speed_ranges"] = (
            f"between the ranges the slide overtakes the belt; searched from {lowest:.4g} to "
            f"{highest:.4g} m/s"
        )
    return {
        "onset_speed_approximate": onset.approximate,
        "onset_speed": onset.exact,
        "speed_ranges": [list(ends) for ends in onset.ranges],
        "searched_speeds": [lowest, highest],
    }


def _closed_loop(drive: Drive, law: ControlLaw | None, notes: Notes) -> Section:
    control = None if law is None else law.continuous
    if law is None or control is None:
        notes["closed_loop"] = (
            _NO_CONTROL
            if law is None
            else f"the control law {law.name} has no equations for continuous control"
        )
        nothing = _eigenvalues(drive, None) | dict.fromkeys(_GAINS)
        return {**nothing, **_hopf_points([]), "limit_cycles": []}
    expansion = expand(drive, control)
    points = hopf_points(drive, control)
    if not points:
        notes["closed_loop.hopf_speeds"] = (
            "with these gains no pair of eigenvalues crosses the imaginary axis at any belt speed"
        )
    place = "closed_loop.limit_cycles"
    possible = _covered(
        place,
        notes,
        (),
        lambda: (
            limit_cycle_from_hopf(drive, control),
            limit_cycle_of_run(drive, 0.0, gains=control),
        ),
    )
    cycles = [cycle for cycle in possible if cycle is not None]
    if len(cycles) > 1 and isclose(cycles[0].position, cycles[1].position, rel_tol=1e-6):
        cycles.pop()
    if not cycles and place not in notes:
        started = " or from the Hopf point at the critical linear gain" if gains_of(law) else ""
        notes[place] = (
            f"none found from rest at zero displacement{started}; there is no search for others, "
            "and none in a very stiff loop"
        )
    return {
        **_eigenvalues(drive, expansion),
        **_critical_gains(drive, law, notes),
        **_hopf_points(points),
        "limit_cycles": [_cycle(cycle) for cycle in cycles],
    }


def _critical_gains(drive: Drive, law: ControlLaw, notes: Notes) -> Section:
    gains = gains_of(law)
    critical = None if gains is None else critical_gains(drive, gains)
    if critical is not None:
        values = critical.linear, _known(critical.first_lyapunov_coefficient), critical.cubic
        return dict(zip(_GAINS, values, strict=True))
    reason = why_no_gains(law) if gains is None else why_no_linear_gain(drive, gains)
    if reason is not None:
        notes |= dict.fromkeys((f"closed_loop.{name}" for name in _GAINS), reason)
    return dict.fromkeys(_GAINS)


def _sampled_loop(
    drive: Drive, law: ControlLaw | None, plant: PlantParameters, notes: Notes
) -> Section:
    rate, force_delay = plant.rate, plant.force_delay
    if law is None:
        notes["sampled_loop"] = _NO_CONTROL
        return dict.fromkeys(_SAMPLED_LOOP)
    loop = LinearSampledLoop.from_drive(drive, rate, force_delay, plant.sensor)
    if loop is None or law.linear_feedback(1.0 / rate) is None:
        reason = why_no_linear_loop(drive, rate, force_delay)
        notes["sampled_loop"] = reason or not_linear(law.name)
        return dict.fromkeys(_SAMPLED_LOOP)
    radius = loop.spectral_radius(law)
    if radius >= 1.0:
        notes["sampled_loop.settling_time"] = "a deviation from the equilibrium does not decay"
    values = radius, radius < 1.0, loop.decay_rate(law), loop.settling_time(law)
    return dict(zip(_SAMPLED_LOOP, (*values, *_sampled_gains(loop, law, notes)), strict=True))


def _sampled_gains(
    loop: LinearSampledLoop, law: ControlLaw, notes: Notes
) -> tuple[float | None, list[list[float]] | None]:
    """Return the critical linear gain and the stable intervals."""
    gains = gains_of(law)
    reason = why_no_gains(law)
    intervals = [] if gains is None else loop.stable_linear_gains(gains.corner_frequency)
    if gains is not None and not intervals:
        reason = (
            "no linear gain stabilises the equilibrium at this rate and delay with a cutoff "
            f"frequency of {gains.corner_frequency:g} rad/s"
        )
    if reason is not None:
        notes |= dict.fromkeys((f"sampled_loop.{name}" for name in _SAMPLED_GAINS), reason)
    if gains is None:
        return None, None
    critical = loop.critical_linear_gain(gains.corner_frequency)
    return critical, [[interval.low, interval.high] for interval in intervals]


def _closed_forms(drive: Drive, law: ControlLaw | None) -> Section | None:
    """Return the closed forms of the cubic Stribeck law, in the same units; omit missing ones."""
    cubic = CubicLoop.from_drive(drive)
    if cubic is None:
        return None
    speed, force = drive.speed_scale, drive.normal_force
    gains = gains_of(law)

    forms: Section = {
        "equilibrium_position": copysign(drive.length_scale, drive.belt_speed) * cubic.equilibrium
        + drive.bias_force / drive.stiffness,
        "first_lyapunov_coefficient": cubic.first_lyapunov_coefficient,
        "hopf_speed": _scaled(cubic.hopf_speed, speed),
        "crossing_speed": _scaled(cubic.crossing_speed, drive.angular_frequency / speed),
        "onset_speed_approximate": _scaled(cubic.sticking_onset, speed),
    }
    if gains is not None:
        dimensionless = gains.scaled(drive)
        corner = dimensionless.corner_frequency
        linear, cubic_gain = cubic.critical_linear_gain(corner), cubic.critical_cubic_gain(corner)
        forms |= {
            "critical_linear_gain": _scaled(linear, force / speed),
            "critical_lyapunov_coefficient": cubic.critical_lyapunov_coefficient(
                corner, dimensionless.cubic_gain
            ),
            "critical_cubic_gain": _scaled(cubic_gain, force / speed**3),
        }
    return {name: form for name, form in forms.items() if form is not None}


def _scaled(value: float | None, unit: float) -> float | None:
    return None if value is None else value * unit


def _cycle(cycle: LimitCycle) -> Section:
    return {
        "position": cycle.position,
        "stable": cycle.stable,
        "multipliers": [[value.real, value.imag] for value in cycle.multipliers],
        **cycle.measures.as_dict(),
        "period": cycle.period,  # the measures of the smallest cycles have none
        "frequency": 1.0 / cycle.period,
    }


def why_no_figure(scenario: Scenario) -> str | None:
    """Return why there is no figure; None if there is one.

    A map needs a linear sampled loop, the bifurcation diagram without control a drive that the
    search for limit cycles covers.
    """
    plant, law = scenario.plant, scenario.control_law
    if law is None:
        try:
            BifurcationBranches.check(plant.as_drive())
        except NotCoveredError as error:
            return str(error)
        return None
    no_loop = why_no_linear_loop(plant.as_drive(), plant.rate, plant.force_delay)
    return no_loop or why_no_gains(law)


def stability_map(scenario: Scenario) -> tuple[StabilityMap, CriticalGainCurves]:
    """Return the map of decay rates of the sampled loop, and the critical gains over the delay.

    Call it only with control, and if `why_no_figure` returns None.
    """
    plant = scenario.plant
    drive, gains = plant.as_drive(), gains_of(scenario.control_law)
    loop = LinearSampledLoop.from_drive(drive, plant.rate, plant.force_delay, plant.sensor)
    assert loop is not None
    assert gains is not None
    rates = plant.rate * np.array((0.1, 0.3, 1.0))
    latest = min(0.2 * drive.natural_period, LONGEST_DELAY / rates.max())
    delays = np.linspace(0.0, latest, 41)
    curves = CriticalGainCurves.over(drive, gains.corner_frequency, rates, delays, plant.sensor)
    return StabilityMap.around(loop, gains), curves


def bifurcation_branches(scenario: Scenario) -> BifurcationBranches:
    """Return equilibria and limit cycles without control over the belt speed.

    Call it only if `why_no_figure` returns None.
    """
    return BifurcationBranches.around(scenario.plant.as_drive())


def hopf_ratio(drive: Drive) -> float | None:
    """Return the belt speed over the nearest Hopf speed; None without one or at zero speed.

    A drive that the theory does not cover has none.
    """
    try:
        speeds = [point.belt_speed for point in hopf_points(drive)]
    except InvalidInputError:
        return None
    speed = abs(drive.belt_speed)
    if not speeds or speed == 0.0:
        return None
    return min((speed / each for each in speeds), key=lambda ratio: max(ratio, 1.0 / ratio))


def hopf_distance(drive: Drive) -> str:
    """Return a clause on the belt speed and the nearest Hopf speed, which reveals a wrong unit.

    It is empty without a Hopf speed.
    """
    ratio = hopf_ratio(drive)
    if ratio is None:
        return ""
    speed = abs(drive.belt_speed)
    own, nearest = (number_text(drive, each, "m/s") for each in (speed, speed / ratio))
    clause = f"{own} is {ratio:.4g} times the Hopf speed of {nearest}"
    return clause if drive.is_dimensionless else f"{clause} (belt speeds are in m/s)"


def number_text(drive: Drive, value: float, unit: str) -> str:
    """Return a number for a sentence: in its SI unit, which a dimensionless drive has not."""
    return f"{value:.4g}" if drive.is_dimensionless else f"{value:.4g} {unit}"
