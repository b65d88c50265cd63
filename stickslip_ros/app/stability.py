"""`stickslip stability`: what theory says of a scenario, without running it."""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from math import copysign, isclose
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_picture,
    made_of,
    scenario_of,
    writing,
)
from stickslip_ros.app.output import (
    print_figures,
    print_json,
    print_table,
    progress_bar,
)
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.equations import SPEED, WashoutGains
from stickslip_ros.physics.theory.closed_forms import CubicLoop
from stickslip_ros.physics.theory.closed_loop import critical_gains
from stickslip_ros.physics.theory.hopf import HopfPoint, hopf_points
from stickslip_ros.physics.theory.hopf_cycles import limit_cycle_from_hopf
from stickslip_ros.physics.theory.limit_cycles import LimitCycle, limit_cycle_of_run, limit_cycles
from stickslip_ros.physics.theory.linear import Expansion, expand
from stickslip_ros.physics.theory.sampled import (
    LONGEST_DELAY,
    LinearSampledLoop,
    why_no_linear_loop,
)
from stickslip_ros.physics.theory.stability_map import CriticalGainCurves, StabilityMap
from stickslip_ros.physics.theory.sticking import sticking_onset
from stickslip_ros.plots.units import Units
from stickslip_ros.scenarios.files import Scenario

HELP = "equilibrium, Hopf speeds, limit cycles and critical gains of a scenario, by theory"

Section = dict[str, Any]
Notes = dict[str, str]
"""Why a quantity does not exist, or what it leaves out, by its place in the JSON."""

_NO_CONTROL = "the scenario has no controller"

_BALANCE = 1e-12
"""Slope of the friction less the damping, dimensionless, that is rounding."""

_DRAWN_RATES, _DRAWN_DELAY, _DRAWN_DELAYS = (0.1, 0.3, 1.0), 0.2, 41
"""Of the critical gain: rates, in the scenario's, the longest delay, in natural periods, and how
many delays."""

_LABELS: dict[str, dict[str, tuple[str, str]]] = {
    "": {"equilibrium_position": ("equilibrium position", "m")},
    "open_loop": {
        "eigenvalues": ("eigenvalues", "1/s"),
        "stable": ("stable", ""),
        "hopf_speeds": ("Hopf speeds", "m/s"),
        "hopf_angular_frequencies": ("angular frequency there", "rad/s"),
        "crossing_speeds": ("crossing speed of the eigenvalues", "1/m"),
        "first_lyapunov_coefficients": ("first Lyapunov coefficient", ""),
    },
    "sticking": {
        "onset_speed_approximate": ("onset of sticking, by averaging", "m/s"),
        "onset_speed": ("onset of sticking, exactly", "m/s"),
        "speed_ranges": ("belt speeds that stick", "m/s"),
    },
    "closed_loop": {
        "eigenvalues": ("eigenvalues", "1/s"),
        "stable": ("stable", ""),
        "hopf_speeds": ("Hopf speeds", "m/s"),
        "crossing_speeds": ("crossing speed of the eigenvalues", "1/m"),
        "first_lyapunov_coefficients": ("first Lyapunov coefficient", ""),
        "critical_linear_gain": ("critical linear gain", "N s/m"),
        "first_lyapunov_coefficient": ("first Lyapunov coefficient there", ""),
        "critical_cubic_gain": ("critical cubic gain", "N s^3/m^3"),
    },
    "sampled_loop": {
        "spectral_radius": ("spectral radius", ""),
        "stable": ("stable", ""),
        "decay_rate": ("decay rate", "1/s"),
        "settling_time": ("settling time, to a hundredth", "s"),
        "critical_linear_gain": ("critical linear gain", "N s/m"),
        "stable_linear_gains": ("stable linear gains", "N s/m"),
    },
}
"""What the figures of each section are called in the table, and their unit."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario(parser)
    add_plot(
        parser,
        "where the sampled loop is stable and how fast it comes to rest, over corner frequency and "
        "linear gain, and the critical gain over the delay of the force",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    scenario = scenario_of(arguments)
    if arguments.plot is not None:
        check_picture(arguments.plot)
        reason = _why_no_map(scenario)
        if reason is not None:
            raise InvalidInputError(f"--plot {arguments.plot}: there is nothing to draw: {reason}")
    with progress_bar(f"theory of {scenario.name}", None):
        found, notes = stability(scenario)
    if arguments.plot is not None:
        with progress_bar("drawing", None):
            _draw(arguments.plot, scenario)
    if arguments.json:
        print_json({**found, "notes": notes, **made_of(scenario)})
    else:
        _print(scenario, found, notes)
    return 0


def stability(scenario: Scenario) -> tuple[Section, Notes]:
    """Return what theory says of the scenario, SI units, and notes on it."""
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
        notes["sampled_loop"] = "force_jitter is left out: the delay of the force is constant here"
    if expansion is None:
        reach = Units.of(drive).text(float(drive.friction.static) * drive.length_scale, "m")
        reason = (
            f"the belt rests, and friction holds the slide anywhere within mu_s N / k = {reach}"
        )
        for place, value in _places(found):
            if value is None and not {place, place.split(".")[0]} & notes.keys():
                notes[place] = reason
    elif found["closed_forms"] is None:
        notes["closed_forms"] = "there are closed forms for the cubic Stribeck law only"
    return found, notes


def _places(found: Section) -> Iterator[tuple[str, Any]]:
    """Yield the figures by their place, those of sections as section.name."""
    for section, value in found.items():
        if isinstance(value, dict):
            figures = cast(Section, value)
            yield from ((f"{section}.{name}", figure) for name, figure in figures.items())
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
            "no motion was found that repeats itself, or the drive is too stiff to be followed"
        )
    return {
        **_eigenvalues(drive, expansion),
        **_hopf_points(points),
        "limit_cycles": [_cycle(cycle) for cycle in cycles],
    }


def _why_no_hopf_speed(drive: Drive) -> str:
    moving = expand(replace(drive, belt_speed=drive.belt_speed or drive.speed_scale))
    assert moving is not None
    if abs(moving.jacobian[SPEED, SPEED]) < _BALANCE:
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
    for name, reason in (
        ("onset_speed_approximate", onset.no_approximate),
        ("onset_speed", onset.no_exact),
    ):
        if reason is not None:
            notes[f"sticking.{name}"] = reason
    lowest, highest = onset.followed
    if not onset.ranges:
        notes["sticking.speed_ranges"] = (
            f"it sticks at no belt speed from {lowest:.4g} to {highest:.4g} m/s"
        )
    elif len(onset.ranges) > 1:
        notes["sticking.speed_ranges"] = (
            f"between them the slide overtakes the belt; looked for from {lowest:.4g} to "
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
            "at no belt speed does a pair of eigenvalues cross the imaginary axis with these gains"
        )
    cycles = _closed_loop_cycles(drive, gains)
    if not cycles:
        notes["closed_loop.limit_cycles"] = (
            "none found from rest at zero displacement, nor from the Hopf point at the critical "
            "linear gain; others are not looked for, and a very stiff loop is not followed"
        )
    return {
        **_eigenvalues(drive, expansion),
        **dict(zip(names, values, strict=True)),
        **_hopf_points(points),
        "limit_cycles": [_cycle(cycle) for cycle in cycles],
    }


def _closed_loop_cycles(drive: Drive, gains: WashoutGains) -> list[LimitCycle]:
    """Return the limit cycles that can be come by, each once, the smallest first."""
    cycles = [limit_cycle_from_hopf(drive, gains), limit_cycle_of_run(drive, 0.0, gains=gains)]
    found = [cycle for cycle in cycles if cycle is not None]
    if len(found) > 1 and isclose(found[0].position, found[1].position, rel_tol=1e-6):
        found.pop()
    return found


def _why_no_gain(drive: Drive, gains: WashoutGains) -> str:
    expansion = expand(drive)
    assert expansion is not None
    product = expansion.jacobian[SPEED, SPEED] * gains.scaled(drive).corner_frequency
    return (
        "no linear gain stabilises the equilibrium: by Routh and Hurwitz p d must be below 1 and "
        f"is {product:.4g} (p the slope of friction less damping, d the corner frequency, "
        "dimensionless)"
    )


def _sampled_loop(
    drive: Drive, gains: WashoutGains | None, rate: float, force_delay: float, notes: Notes
) -> Section:
    loop = LinearSampledLoop.from_drive(drive, rate, force_delay)
    if gains is None or loop is None:
        reason = why_no_linear_loop(drive, rate, force_delay)
        notes["sampled_loop"] = _NO_CONTROL if gains is None else reason or ""
        return dict.fromkeys(_LABELS["sampled_loop"])
    radius = loop.spectral_radius(gains)
    intervals = loop.stable_linear_gains(gains.corner_frequency)
    if not intervals:
        reason = (
            "no linear gain stabilises the equilibrium at this rate and delay with a corner "
            f"frequency of {gains.corner_frequency:g} rad/s"
        )
        for name in ("critical_linear_gain", "stable_linear_gains"):
            notes[f"sampled_loop.{name}"] = reason
    if radius >= 1.0:
        notes["sampled_loop.settling_time"] = "a deviation from the equilibrium grows"
    return {
        "spectral_radius": radius,
        "stable": radius < 1.0,
        "decay_rate": loop.decay_rate(gains),
        "settling_time": loop.settling_time(gains),
        "critical_linear_gain": loop.critical_linear_gain(gains.corner_frequency),
        "stable_linear_gains": [[interval.low, interval.high] for interval in intervals],
    }


def _closed_forms(drive: Drive, gains: WashoutGains | None) -> Section | None:
    """Return what can be written down for the cubic Stribeck law, in the same units.

    What does not exist is left out.
    """
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
        "period": cycle.period,  # the measures have none for the smallest cycles
        "frequency": 1.0 / cycle.period,
    }


def _why_no_map(scenario: Scenario) -> str | None:
    plant = scenario.plant
    if not plant.expects_control:
        return _NO_CONTROL
    return why_no_linear_loop(plant.as_drive(), plant.rate, plant.force_delay)


def _draw(path: Path, scenario: Scenario) -> None:
    # Half as long again to import as everything else.
    from stickslip_ros.plots.stability_map import draw_stability_map

    plant = scenario.plant
    drive, gains = plant.as_drive(), scenario.washout_controller.as_washout().gains
    loop = LinearSampledLoop.from_drive(drive, plant.rate, plant.force_delay)
    assert loop is not None
    rates = plant.rate * np.array(_DRAWN_RATES)
    latest = min(_DRAWN_DELAY * drive.natural_period, LONGEST_DELAY / rates.max())
    delays = np.linspace(0.0, latest, _DRAWN_DELAYS)
    critical = CriticalGainCurves.over(drive, gains.corner_frequency, rates, delays)
    with writing("--plot", path):
        draw_stability_map(path, StabilityMap.around(loop, gains), critical)


def _print(scenario: Scenario, found: Section, notes: Notes) -> None:
    units = Units.of(scenario.plant.as_drive())
    rows: list[list[str]] = []
    for section, labels in _LABELS.items():
        figures = found[section] if section else found
        if section:
            rows.append([section.replace("_", " "), ""])
        for name, (label, unit) in labels.items():
            shown = _shown(name, figures[name], unit, units)
            rows.append([f"  {label}" if section else label, shown])
    print_table(f"{scenario.name}, by theory", ["", ""], rows)
    for loop in ("open_loop", "closed_loop"):
        cycles: list[Section] = found[loop]["limit_cycles"]
        if cycles:
            columns = {
                f"{number}, {'stable' if cycle['stable'] else 'unstable'}": {
                    **cycle, "multipliers": _complex(cycle["multipliers"], ""),
                }
                for number, cycle in enumerate(cycles, 1)
            }  # fmt: skip
            title = f"limit cycles, {loop.replace('_', ' ')}"
            print_figures(title, columns, dict.fromkeys(columns, units))
    for place, reason in notes.items():
        print(f"{place.replace('_', ' ').replace('.', ', ')}: {reason}")


def _shown(name: str, value: Any, unit: str, units: Units) -> str:
    """Return a figure, or a list of them, to be read."""
    if value is None or not isinstance(value, list):
        return units.texts([value], unit, digits=8 if name == "spectral_radius" else 4)[0]
    items = cast(list[Any], value)
    if name == "eigenvalues":
        return _complex(items, units.of_unit(unit))
    if name in ("stable_linear_gains", "speed_ranges"):
        return "; ".join(" to ".join(units.texts(ends, unit)) for ends in items) or "-"
    return ", ".join(units.texts(items, unit)) or "-"


def _complex(pairs: list[list[float]], unit: str) -> str:
    """Return complex numbers given as [real, imaginary], of a conjugate pair once."""
    texts = [
        f"{real:.4g} ± {imaginary:.4g}j" if imaginary else f"{real:.4g}"
        for real, imaginary in pairs
        if imaginary >= 0.0
    ]
    return f"{', '.join(texts)} {unit}".rstrip()
