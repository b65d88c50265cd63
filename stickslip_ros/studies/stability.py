"""Stability of a scenario by theory, without a simulation of it."""

from dataclasses import replace
from math import inf, isclose, isnan
from operator import attrgetter
from typing import Any, NamedTuple, cast

import numpy as np

from stickslip_ros.model.actuator import IDEAL_ACTUATOR
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.model.drive import Drive, number_text
from stickslip_ros.model.drive_layout import POSITION, SPEED
from stickslip_ros.model.friction import Stribeck
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.studies.spread import Spread, check_spread, drawn, spread_text
from stickslip_ros.theory.critical_gains import (
    critical_gains,
    limit_cycle_from_hopf,
    why_no_linear_gain,
)
from stickslip_ros.theory.gain_intervals import gains_of, why_no_gains
from stickslip_ros.theory.hopf import HopfPoint, hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycle_of_run, limit_cycles
from stickslip_ros.theory.linear import Expansion, expand
from stickslip_ros.theory.linear_sampled_loop import (
    LinearSampledLoop,
    not_linear,
    settling_time,
    why_no_linear_loop,
)
from stickslip_ros.theory.requirements import AUTONOMOUS, ONE_DEGREE, SMOOTH, covered, require
from stickslip_ros.theory.shooting import LimitCycle
from stickslip_ros.theory.sticking import sticking_onset

Section = dict[str, Any]
Notes = dict[str, str]
"""Why a quantity does not exist, or what it omits, by its place in the sections."""

_DRIVES = 100
"""Drives that are drawn for an interval."""

_NO_CONTROL = "the scenario has no controller"

_STICKING = ("onset_speed_approximate", "onset_speed", "speed_ranges", "searched_speeds")

_GAINS = ("critical_linear_gain", "first_lyapunov_coefficient", "critical_cubic_gain")

_SAMPLED_GAINS = ("critical_linear_gain", "stable_linear_gains")

_SAMPLED_LOOP = ("spectral_radius", "stable", "decay_rate", "settling_time", *_SAMPLED_GAINS)


class _Noted(NamedTuple):
    """A quantity or a section of them, with a note."""

    value: Any
    note: str | None
    """Why it does not exist, or what it omits; None if there is nothing to say."""


def stability(scenario: Scenario, spread: Spread = 0.0) -> tuple[Section, Notes]:
    """Return the theoretical quantities of the scenario, in SI units, and notes on them.

    With a `spread` of the constants, the critical feed speed has an interval, too.
    Raises InvalidInputError if belt or load follow a signal.
    """
    plant = scenario.plant
    drive = plant.as_drive()
    require("the theory of stability", drive, AUTONOMOUS)
    law, (expansion, lack) = scenario.control_law, covered(lambda: expand(drive))
    position = drive.equilibrium_position if expansion else None
    section, notes = _separated(
        {
            "equilibrium_position": _Noted(position, lack or _held(drive)),
            "open_loop": _open_loop(drive, expansion, lack),
            "sticking": _sticking(drive),
            "closed_loop": _closed_loop(drive, law, plant),
            "sampled_loop": _sampled_loop(drive, law, plant),
        }
    )
    if spread:
        feed, notes["open_loop.critical_feed"] = _critical_feed(scenario, spread)
        section["open_loop"]["critical_feed"] = feed
    forms, more = _separated({"closed_forms": _closed_forms(drive, section)})
    return section | forms, notes | more


def _critical_feed(scenario: Scenario, spread: Spread) -> tuple[Section, str]:
    """Return the 95 % interval of the highest critical feed speed for a spread, and a note on it.

    It is that of drives whose constants are `drawn` as for a comparison; 0 stands for none.
    """
    check_spread(spread)
    varied = [scenario.changed(drawn(scenario, seed, spread)) for seed in range(_DRIVES)]
    points = [hopf_points(variant.plant.as_drive()) for variant in varied]
    speeds = [max((point.belt_speed for point in hopf), default=0.0) for hopf in points]
    ends, without = np.quantile(speeds, [0.025, 0.975]).tolist(), speeds.count(0.0)
    low, high = (number_text(scenario.plant.as_drive(), end, "m/s") for end in ends)
    note = (
        f"{low} to {high} in 95 % of {_DRIVES} drives with constants {spread_text(spread)}; "
        f"{without} of them have none"
    )
    return {"spread": spread, "drives": _DRIVES, "without": without, "interval": ends}, note


def _separated(section: Section) -> tuple[Section, Notes]:
    """Return the quantities without their notes, and the notes by place."""
    values, notes = Section(), Notes()
    for name, value in section.items():
        if isinstance(value, _Noted):
            value, note = value
            if note is not None:
                notes[name] = note
        if isinstance(value, dict):
            value, inner = _separated(cast(Section, value))
            notes |= {f"{name}.{place}": note for place, note in inner.items()}
        values[name] = value
    return values, notes


def _held(drive: Drive) -> str | None:
    """Return why a drive has no single equilibrium; None if its belt moves."""
    if drive.belt_speed:
        return None
    reach = float(max(drive.friction.limits)) * (drive.normal_force / drive.stiffness)
    return (
        "the belt is at rest, and friction holds the slide anywhere within mu_s N / k = "
        + number_text(drive, reach, "m")
        + (" of bias_force / k" if drive.bias_force else "")
    )


def _nonsmooth(drive: Drive) -> str | None:
    """Return why a drive has no first Lyapunov coefficient; None if it may have one."""
    kink = SMOOTH.lack(drive)
    return kink and f"the first Lyapunov coefficient needs {SMOOTH.need}: {kink}"


def _omitted(plant: PlantParameters) -> str | None:
    """Return what of the loop the linear theory leaves out, in sentences."""
    sentences: list[str] = []
    if plant.force_jitter > 0.0:
        sentences.append("force_jitter is omitted: the delay of the force is constant here")
    rough = ("position_resolution", "position_noise", "velocity_noise")
    of_sensors = [f"{sensor}.{name}" for sensor in ("motor.sensor", "sensor") for name in rough]
    nonlinear = (*of_sensors, "actuator.limit", "actuator.resolution")
    names = [name for name in nonlinear if attrgetter(name)(plant) not in (0.0, inf)]
    if names:
        verb = "is" if len(names) == 1 else "are"
        sentences.append(f"{', '.join(names)} {verb} omitted: the loop is linear here")
    return "; ".join(sentences) or None


def _eigenvalues(drive: Drive, expansion: Expansion | None, reason: str | None) -> Section:
    if expansion is None:
        names = ("equilibrium_position", "eigenvalues", "stable")
        return dict.fromkeys(names, _Noted(None, reason))
    values, stable = expansion.eigenvalues * drive.angular_frequency, expansion.stable
    neutral = "it is neutral: a small deviation neither decays nor grows"
    return {
        "equilibrium_position": float(expansion.equilibrium[POSITION]) * drive.length_scale,
        "eigenvalues": values.astype(complex),
        "stable": _Noted(stable, neutral if stable is None else None),
    }


def _open_loop(drive: Drive, expansion: Expansion | None, lack: str | None) -> Section | _Noted:
    if lack is not None:
        nothing = _eigenvalues(drive, None, None) | _hopf_points([])
        return _Noted({**nothing, "limit_cycles": []}, lack)
    points = hopf_points(drive)
    cycles, reason = covered(lambda: limit_cycles(drive))
    if not cycles and reason is None:
        reason = "no periodic motion was found, or the drive is too stiff to integrate"
    return {
        **_eigenvalues(drive, expansion, _held(drive)),
        **_hopf_points(points, None if points else _why_no_hopf_speed(drive), _nonsmooth(drive)),
        "limit_cycles": _Noted([_cycle(cycle) for cycle in cycles or ()], reason),
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


def _hopf_points(
    points: list[HopfPoint], reason: str | None = None, nonsmooth: str | None = None
) -> Section:
    sigmas = [_known(point.first_lyapunov_coefficient) for point in points]
    return {
        "hopf_speeds": _Noted([point.belt_speed for point in points], reason),
        "hopf_angular_frequencies": [point.angular_frequency for point in points],
        "crossing_speeds": [point.crossing_speed for point in points],
        "first_lyapunov_coefficients": _Noted(sigmas, nonsmooth),
    }


def _known(value: float) -> float | None:
    """Return None for nan."""
    return None if isnan(value) else value


def _sticking(drive: Drive) -> Section | _Noted:
    onset, reason = covered(lambda: sticking_onset(drive))
    if onset is None:
        return _Noted(dict.fromkeys(_STICKING), reason)
    lowest, highest = onset.followed
    searched = None
    if not onset.ranges:
        searched = f"the slide sticks at no belt speed from {lowest:.4g} to {highest:.4g} m/s"
    elif len(onset.ranges) > 1:
        searched = (
            f"between the ranges the slide overtakes the belt; searched from {lowest:.4g} to "
            f"{highest:.4g} m/s"
        )
    return {
        "onset_speed_approximate": _Noted(onset.approximate, onset.no_approximate),
        "onset_speed": _Noted(onset.exact, onset.no_exact),
        "speed_ranges": _Noted([list(ends) for ends in onset.ranges], searched),
        "searched_speeds": [lowest, highest],
    }


def _closed_loop(drive: Drive, law: ControlLaw | None, plant: PlantParameters) -> _Noted:
    control = None if law is None else law.continuous
    lack = _NO_CONTROL
    if law is not None:
        lack = f"the control law {law.name} has no equations for continuous control"
    points: list[HopfPoint] | None = None
    if control is not None:
        points, lack = covered(lambda: hopf_points(drive, control))
    if law is None or control is None or points is None:
        nothing = _eigenvalues(drive, None, None) | dict.fromkeys(_GAINS) | _hopf_points([])
        return _Noted({**nothing, "limit_cycles": []}, lack)
    no_hopf_speed = (
        "with these gains no pair of eigenvalues crosses the imaginary axis at any belt speed"
    )
    possible, reason = covered(
        lambda: (
            limit_cycle_from_hopf(drive, control) if drive.motor is None else None,
            limit_cycle_of_run(drive, 0.0, control=control),
        )
    )
    cycles = [cycle for cycle in possible or () if cycle is not None]
    if len(cycles) > 1 and isclose(cycles[0].position, cycles[1].position, rel_tol=1e-6):
        cycles.pop()
    if not cycles and reason is None:
        started = " or from the bifurcation at the critical linear gain" if gains_of(law) else ""
        reason = (
            f"none found from rest at zero displacement{started}; there is no search for others, "
            "and none in a very stiff loop"
        )
    ideal = plant.exactly_measured and plant.actuator == IDEAL_ACTUATOR
    return _Noted(
        {
            **_eigenvalues(drive, expand(drive, control), _held(drive)),
            **_critical_gains(drive, law),
            **_hopf_points(points, None if points else no_hopf_speed, _nonsmooth(drive)),
            "limit_cycles": _Noted([_cycle(cycle) for cycle in cycles], reason),
        },
        None if ideal else "sensor and actuator are omitted: control is continuous here",
    )


def _critical_gains(drive: Drive, law: ControlLaw) -> Section:
    gains, nonsmooth = gains_of(law), _nonsmooth(drive)
    critical = None if gains is None else critical_gains(drive, gains)
    if critical is not None:
        sigma = _known(critical.first_lyapunov_coefficient)
        values = critical.linear, _Noted(sigma, nonsmooth), _Noted(critical.cubic, nonsmooth)
        return dict(zip(_GAINS, values, strict=True))
    reason = why_no_gains(law) if gains is None else why_no_linear_gain(drive, gains)
    return dict.fromkeys(_GAINS, _Noted(None, reason or _held(drive)))


def _sampled_loop(drive: Drive, law: ControlLaw | None, plant: PlantParameters) -> _Noted:
    if law is None:
        return _Noted(dict.fromkeys(_SAMPLED_LOOP), _NO_CONTROL)
    loop = LinearSampledLoop.from_drive(drive, *plant.linear_sampling)
    if loop is None or law.linear_feedback(1.0 / plant.control_rate) is None:
        reason = why_no_linear_loop(drive, *plant.linear_sampling)
        return _Noted(dict.fromkeys(_SAMPLED_LOOP), reason or not_linear(law.name))
    radius, lack = covered(lambda: loop.spectral_radius(law))
    if radius is None:
        return _Noted(dict.fromkeys(_SAMPLED_LOOP), lack)
    growing = "a deviation from the equilibrium does not decay" if radius >= 1.0 else None
    rate = loop.decay_rate(law)
    settling = _Noted(settling_time(rate), growing)
    values = radius, radius < 1.0, rate, settling, *_sampled_gains(loop, law)
    return _Noted(dict(zip(_SAMPLED_LOOP, values, strict=True)), _omitted(plant))


def _sampled_gains(loop: LinearSampledLoop, law: ControlLaw) -> tuple[_Noted, _Noted]:
    """Return the critical linear gain and the stable intervals."""
    gains = gains_of(law)
    if gains is None:
        nothing = _Noted(None, why_no_gains(law))
        return nothing, nothing
    intervals = loop.stable_linear_gains(gains.corner_frequency)
    reason = None
    if not intervals:
        reason = (
            "no linear gain stabilises the equilibrium at this rate and delay with a cutoff "
            f"frequency of {gains.corner_frequency:g} rad/s"
        )
    critical = loop.critical_linear_gain(gains.corner_frequency)
    stable = [[interval.low, interval.high] for interval in intervals]
    return _Noted(critical, reason), _Noted(stable, reason)


def _closed_forms(drive: Drive, section: Section) -> Section | _Noted:
    """Return the quantities with a closed form under the cubic Stribeck law, of those found."""
    _, lack = covered(lambda: require("the closed form", drive, *ONE_DEGREE))
    lack = lack or _held(drive)
    if lack is None and not isinstance(drive.friction, Stribeck):
        lack = "closed forms exist for the cubic Stribeck law only"
    if lack is not None:
        return _Noted(None, lack)
    opened, closed = section["open_loop"], section["closed_loop"]
    forms: Section = {
        "equilibrium_position": section["equilibrium_position"],
        **{
            name: next(iter(opened[f"{name}s"]), None)
            for name in ("first_lyapunov_coefficient", "hopf_speed", "crossing_speed")
        },
        "onset_speed_approximate": section["sticking"]["onset_speed_approximate"],
        "critical_linear_gain": closed["critical_linear_gain"],
        "critical_lyapunov_coefficient": closed["first_lyapunov_coefficient"],
        "critical_cubic_gain": closed["critical_cubic_gain"],
    }
    return {name: form for name, form in forms.items() if form is not None}


def _cycle(cycle: LimitCycle) -> Section:
    return {
        "position": cycle.position,
        "stable": cycle.stable,
        "multipliers": np.array(cycle.multipliers),
        **cycle.measures.as_dict(),
        "period": cycle.period,  # the measures of the smallest cycles have none
        "frequency": 1.0 / cycle.period,
    }
