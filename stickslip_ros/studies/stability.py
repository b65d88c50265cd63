"""Stability of a scenario by theory, without a simulation of it."""

from collections.abc import Iterator
from dataclasses import replace
from math import copysign, isclose
from typing import Any, cast

import numpy as np

from stickslip_ros.physics.model.control import WashoutGains
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.drive_system import SPEED
from stickslip_ros.physics.theory.closed_forms import CubicLoop
from stickslip_ros.physics.theory.critical_gains import critical_gains
from stickslip_ros.physics.theory.hopf import HopfPoint, hopf_points
from stickslip_ros.physics.theory.hopf_cycles import limit_cycle_from_hopf
from stickslip_ros.physics.theory.limit_cycles import LimitCycle, limit_cycle_of_run, limit_cycles
from stickslip_ros.physics.theory.linear import Expansion, expand
from stickslip_ros.physics.theory.linear_sampled_loop import (
    LONGEST_DELAY,
    LinearSampledLoop,
    why_no_linear_loop,
)
from stickslip_ros.physics.theory.stability_map import CriticalGainCurves, StabilityMap
from stickslip_ros.physics.theory.sticking import sticking_onset
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.text import quantity

Section = dict[str, Any]
Notes = dict[str, str]
"""Why a quantity does not exist, or what it omits, by its place in the sections."""

_NO_CONTROL = "the scenario has no controller"

_SAMPLED_LOOP = (
    "spectral_radius",
    "stable",
    "decay_rate",
    "settling_time",
    "critical_linear_gain",
    "stable_linear_gains",
)


def stability(scenario: Scenario) -> tuple[Section, Notes]:
    """Return the theoretical quantities of the scenario, in SI units, and notes on them."""
    plant = scenario.plant
    drive = plant.as_drive()
    gains = scenario.washout_controller.as_washout().gains if plant.expects_control else None
    notes: Notes = {}
    expansion = expand(drive)
    found: Section = {
        "equilibrium_position": drive.equilibrium_position if expansion else None,
        "open_loop": _open_loop(drive, expansion, notes),
        "sticking": _sticking(drive, notes),
        "closed_loop": _closed_loop(drive, gains, notes),
        "sampled_loop": _sampled_loop(drive, gains, plant.rate, plant.force_delay, notes),
        "closed_forms": _closed_forms(drive, gains),
    }
    if plant.force_jitter > 0.0 and "sampled_loop" not in notes:
        notes["sampled_loop"] = "force_jitter is omitted: the delay of the force is constant here"
    if expansion is None:
        reach = float(max(drive.friction.limits)) * drive.length_scale
        shown = f"{reach:.4g}" if drive.is_dimensionless else quantity(reach, "m")
        reason = (
            "the belt is at rest, and friction holds the slide anywhere within mu_s N / k = "
            f"{shown}"
        )
        for place, value in _places(found):
            if value is None and not {place, place.split(".")[0]} & notes.keys():
                notes[place] = reason
    elif found["closed_forms"] is None:
        notes["closed_forms"] = "closed forms exist for the cubic Stribeck law only"
    return found, notes


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
        return {"eigenvalues": None, "stable": None}
    values = expansion.eigenvalues * drive.angular_frequency
    return {
        "eigenvalues": [[float(value.real), float(value.imag)] for value in values],
        "stable": expansion.stable,
    }


def _open_loop(drive: Drive, expansion: Expansion | None, notes: Notes) -> Section:
    points, cycles = hopf_points(drive), limit_cycles(drive)
    if not points:
        notes["open_loop.hopf_speeds"] = _why_no_hopf_speed(drive)
    if not cycles:
        notes["open_loop.limit_cycles"] = (
            "no periodic motion was found, or the drive is too stiff to integrate"
        )
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
        "first_lyapunov_coefficients": [point.first_lyapunov_coefficient for point in points],
    }


def _sticking(drive: Drive, notes: Notes) -> Section:
    onset = sticking_onset(drive)
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
    }


def _closed_loop(drive: Drive, gains: WashoutGains | None, notes: Notes) -> Section:
    names = ("critical_linear_gain", "first_lyapunov_coefficient", "critical_cubic_gain")
    if gains is None:
        notes["closed_loop"] = _NO_CONTROL
        nothing = _eigenvalues(drive, None) | dict.fromkeys(names)
        return {**nothing, **_hopf_points([]), "limit_cycles": []}
    expansion = expand(drive, gains)
    critical = critical_gains(drive, gains)
    values = (None, None, None)
    if critical is not None:
        values = (critical.linear, critical.first_lyapunov_coefficient, critical.cubic)
    elif expansion is not None:
        notes |= dict.fromkeys(
            (f"closed_loop.{name}" for name in names), _why_no_gain(drive, gains)
        )
    points = hopf_points(drive, gains)
    if not points:
        notes["closed_loop.hopf_speeds"] = (
            "with these gains no pair of eigenvalues crosses the imaginary axis at any belt speed"
        )
    possible = limit_cycle_from_hopf(drive, gains), limit_cycle_of_run(drive, 0.0, gains=gains)
    cycles = [cycle for cycle in possible if cycle is not None]
    if len(cycles) > 1 and isclose(cycles[0].position, cycles[1].position, rel_tol=1e-6):
        cycles.pop()
    if not cycles:
        notes["closed_loop.limit_cycles"] = (
            "none found from rest at zero displacement or from the Hopf point at the critical "
            "linear gain; there is no search for others, and none in a very stiff loop"
        )
    return {
        **_eigenvalues(drive, expansion),
        **dict(zip(names, values, strict=True)),
        **_hopf_points(points),
        "limit_cycles": [_cycle(cycle) for cycle in cycles],
    }


def _why_no_gain(drive: Drive, gains: WashoutGains) -> str:
    expansion = expand(drive)
    assert expansion is not None
    product = expansion.jacobian[SPEED, SPEED] * gains.scaled(drive).corner_frequency
    return (
        "no linear gain stabilises the equilibrium: by the Routh-Hurwitz criterion p d must be "
        f"below 1 and is {product:.4g} (p the slope of friction less damping, d the cutoff "
        "frequency, dimensionless)"
    )


def _sampled_loop(
    drive: Drive, gains: WashoutGains | None, rate: float, force_delay: float, notes: Notes
) -> Section:
    loop = LinearSampledLoop.from_drive(drive, rate, force_delay)
    if gains is None or loop is None:
        reason = why_no_linear_loop(drive, rate, force_delay)
        notes["sampled_loop"] = _NO_CONTROL if gains is None else reason or ""
        return dict.fromkeys(_SAMPLED_LOOP)
    radius = loop.spectral_radius(gains)
    intervals = loop.stable_linear_gains(gains.corner_frequency)
    if not intervals:
        reason = (
            "no linear gain stabilises the equilibrium at this rate and delay with a cutoff "
            f"frequency of {gains.corner_frequency:g} rad/s"
        )
        for name in ("critical_linear_gain", "stable_linear_gains"):
            notes[f"sampled_loop.{name}"] = reason
    if radius >= 1.0:
        notes["sampled_loop.settling_time"] = "a deviation from the equilibrium grows"
    values = (
        radius,
        radius < 1.0,
        loop.decay_rate(gains),
        loop.settling_time(gains),
        loop.critical_linear_gain(gains.corner_frequency),
        [[interval.low, interval.high] for interval in intervals],
    )
    return dict(zip(_SAMPLED_LOOP, values, strict=True))


def _closed_forms(drive: Drive, gains: WashoutGains | None) -> Section | None:
    """Return the closed forms of the cubic Stribeck law, in the same units; omit missing ones."""
    cubic = CubicLoop.from_drive(drive)
    if cubic is None:
        return None
    speed, force = drive.speed_scale, drive.normal_force

    forms: Section = {
        "equilibrium_position": copysign(drive.length_scale, drive.belt_speed) * cubic.equilibrium,
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
                corner, dimensionless.cubic
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


def why_no_stability_map(scenario: Scenario) -> str | None:
    """Return why there is no linear sampled loop for a map; None if there is one."""
    plant = scenario.plant
    if not plant.expects_control:
        return _NO_CONTROL
    return why_no_linear_loop(plant.as_drive(), plant.rate, plant.force_delay)


def stability_map(scenario: Scenario) -> tuple[StabilityMap, CriticalGainCurves]:
    """Return the map of decay rates of the sampled loop, and the critical gains over the delay.

    Call it only if `why_no_stability_map` returns None.
    """
    plant = scenario.plant
    drive, gains = plant.as_drive(), scenario.washout_controller.as_washout().gains
    loop = LinearSampledLoop.from_drive(drive, plant.rate, plant.force_delay)
    assert loop is not None
    rates = plant.rate * np.array((0.1, 0.3, 1.0))
    latest = min(0.2 * drive.natural_period, LONGEST_DELAY / rates.max())
    delays = np.linspace(0.0, latest, 41)
    curves = CriticalGainCurves.over(drive, gains.corner_frequency, rates, delays)
    return StabilityMap.around(loop, gains), curves
