"""Sections 3.2 to 3.5: the phase portraits, Fig. 6 to 11."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from math import sqrt

import numpy as np

from stickslip_ros.paper.claims.claim import Computations, Evidence, Number, Observation
from stickslip_ros.paper.claims.paper_values import (
    FASTER,
    PRINTED_HOPF_SPEED,
    SLOWER,
    VIBRATING,
    amplitude,
    approximate_onset,
    arrivals,
    belt_speeds,
    border,
    critical_beta,
    cycles,
    exact_onset,
    expansion,
    falling,
    hopf_point,
    listed,
    only_rest_at,
    overdamped_from,
    regimes,
    stays,
    stick_fractions,
    trace,
    trace_of,
)
from stickslip_ros.paper.figures import PRINTED_SLOPE, STRIBECK, TANGENT_SLOPE, unit_drive
from stickslip_ros.paper.portraits import Portrait
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import Coulomb, Linear, Stribeck
from stickslip_ros.physics.model.functions import zero_between
from stickslip_ros.physics.theory.hopf import hopf_points
from stickslip_ros.physics.theory.limit_cycles import limit_cycle_of_run, limit_cycles

computes = Computations()

_PRINTED_ONSET = 0.4372
"""The printed v_b0."""


def _stick_falls(portraits: Sequence[Portrait]) -> bool:
    return falling([fraction for fraction in stick_fractions(portraits) if fraction > 0.0])


def _of_speed(evidence: Evidence, low: float, high: float) -> list[Portrait]:
    """Return the motions of Fig. 6 whose belt speed is between `low` and `high`."""
    return [p for p in evidence.portraits(6).portraits if low < p.drive.belt_speed < high]


@computes("fig-6-rest")
def _(evidence: Evidence) -> Observation:
    above = _of_speed(evidence, hopf_point().belt_speed, 9.0)
    off = max(abs((p.least_relative_speed or 0.0) / p.drive.belt_speed - 1.0) for p in above)
    return Observation(
        f"v0 = {belt_speeds(above)}: at rest",
        set(regimes(above)) == {Regime.EQUILIBRIUM} and off < 1e-3 and only_rest_at(FASTER),
        remark=f"The relative speed deviates from the belt's by {off:.3%} at most. At v0 = "
        f"{listed(FASTER)} too the equilibrium is stable and shooting finds no limit cycle.",
    )


@computes("fig-6-settling")
def _(evidence: Evidence) -> Observation:
    above = _of_speed(evidence, hopf_point().belt_speed, 9.0)
    times = [portrait.settling_time or 0.0 for portrait in above]
    overdamped = overdamped_from()
    speeds = np.linspace(hopf_point().belt_speed, overdamped, 20).tolist()
    near, beyond = (
        [float(expansion(v).eigenvalues[0].real) for v in tried]
        for tried in (speeds, (overdamped, 1.5, 2.0))
    )
    rises = falling(times) and falling(near)
    return Observation(
        f"after {listed(times)}",
        rises and falling(beyond),
        rises,
        f"Only up to v0 = {overdamped:.4f}, where the drive becomes overdamped. The decay rate is "
        f"{-beyond[0]:.3f} there, {-beyond[1]:.3f} at 1.5 and {-beyond[2]:.3f} at 2. "
        f"Settling times of Fig. 6 for v0 = {belt_speeds(above)}.",
    )


@computes("fig-6-unstable")
def _(evidence: Evidence) -> Observation:
    below = _of_speed(evidence, 0.0, hopf_point().belt_speed)
    return Observation(
        f"v0 = {belt_speeds(below)} vibrate",
        set(regimes(below)) <= set(VIBRATING),
        remark=f"Amplitudes {listed([amplitude(portrait) for portrait in below])}.",
    )


@computes("fig-6-pure-slip")
def _(evidence: Evidence) -> Observation:
    between = _of_speed(evidence, exact_onset(), hopf_point().belt_speed)
    least = [portrait.least_relative_speed or 0.0 for portrait in between]
    return Observation(
        listed(least),
        set(regimes(between)) == {Regime.PURE_SLIP} and min(least) > 0.0,
        remark=f"At v0 = {belt_speeds(between)}.",
    )


@computes("fig-6-no-cycle")
def _(_: Evidence) -> Observation:
    found = cycles(0.45)
    return Observation(
        f"{len(found)} limit cycle at v0 = 0.45",
        not found,
        remark="There is a stable one with amplitude "
        f"{listed([cycle.measures.amplitude or 0.0 for cycle in found])}, period "
        f"{listed([cycle.period for cycle in found])} and Floquet multiplier "
        f"{listed([abs(cycle.multipliers[0]) for cycle in found])}. Section 2 predicts it too.",
    )


@computes("fig-6-stick-slip")
def _(evidence: Evidence) -> Observation:
    below = _of_speed(evidence, 0.0, exact_onset())
    fractions = stick_fractions(below)
    slower = [cycles(speed)[0].measures.stick_fraction or 0.0 for speed in SLOWER]
    return Observation(
        f"stick fractions {listed(fractions)}",
        set(regimes(below)) == {Regime.STICK_SLIP}
        and max(portrait.least_relative_speed or 0.0 for portrait in below) == 0.0
        and min(slower) > 0.0,
        remark=f"At v0 = {belt_speeds(below)}; by shooting "
        f"{listed(slower)} at v0 = {listed(SLOWER)}.",
    )


computes["vb0"] = lambda _: Number(
    exact_onset(),
    {"By averaging, an approximation": approximate_onset()},
    "At the computed speed the periodic orbit touches the belt's speed. The paper does not "
    "give the origin of its value.",
)


@computes("vb0-and-vb1")
def _(_: Evidence) -> Observation:
    def damping(speed: float, belt_speed: Callable[[float], float]) -> float:
        return zero_between(lambda damping: belt_speed(damping) - speed, 0.0, 0.1)

    of_hopf = damping(PRINTED_HOPF_SPEED, lambda d: hopf_point(d).belt_speed)
    of_onset = damping(_PRINTED_ONSET, approximate_onset)
    of_exact = damping(_PRINTED_ONSET, exact_onset)
    rounding = 2e-4  # of the printed speeds, times the slopes of the damping over them
    apart = min(abs(of_hopf - of_onset), abs(of_hopf - of_exact))
    return Observation(
        f"{of_hopf:.4f} and {of_onset:.4f}",
        apart < rounding,
        remark=f"Damping coefficients that give v_b1 = {PRINTED_HOPF_SPEED:g} and, by averaging, "
        f"v_b0 = {_PRINTED_ONSET:g}; for the motion itself the latter needs {of_exact:.4f}.",
    )


@computes("grazing")
def _(_: Evidence) -> Observation:
    speed = exact_onset()
    fractions = [
        cycles(speed * factor)[0].measures.stick_fraction or 0.0
        for factor in (1.0 - 1e-4, 1.0 + 1e-4)
    ]
    return Observation(
        f"v0 = {speed:.6f}",
        fractions[0] > 0.0 == fractions[1],
        remark=f"Limit cycles by shooting: at 0.9999 times this speed the stick fraction is "
        f"{fractions[0]:.4f}, at 1.0001 times it is {fractions[1]:.4f}.",
    )


@computes("damping-cures")
def _(evidence: Evidence) -> Observation:
    most = evidence.portraits(7).portraits[-1]
    critical = critical_beta(most.drive.belt_speed)
    return Observation(
        f"beta above {critical:.4g}",
        most.measures.regime is Regime.EQUILIBRIUM
        and critical < most.drive.damping_coefficient / 2.0,
        remark=f"At v0 = {most.drive.belt_speed:g}; with {most.case.label} the slide ends at rest.",
    )


@computes("critical-speed-of-damping")
def _(_: Evidence) -> Observation:
    betas = (0.0, 0.01, 0.05, 0.1)
    true = [hopf_point(2.0 * beta).belt_speed for beta in betas]
    once, twice = ([sqrt((0.45 - n * beta) / 1.8) for beta in betas] for n in (1.0, 2.0))
    return Observation(
        listed(true),
        bool(np.allclose(once, true, rtol=1e-9)),
        bool(np.allclose(twice, true, rtol=1e-9)),
        f"With 2 beta in place of beta in eq. 8, which gives {listed(once)} for beta = "
        f"{listed(betas)}.",
    )


computes["fig-7-stick"] = lambda evidence: _falling_stick_fractions(
    evidence.portraits(7).portraits, "of the motions that vibrate"
)


@computes("fig-10-stick")
def _(evidence: Evidence) -> Observation:
    portraits = _of_stiffnesses(evidence)
    stiffnesses = listed([portrait.drive.stiffness for portrait in portraits])
    return _falling_stick_fractions(portraits, f"stiffness {stiffnesses}")


def _falling_stick_fractions(portraits: Sequence[Portrait], which: str) -> Observation:
    return Observation(
        listed(stick_fractions(portraits)),
        _stick_falls(portraits),
        remark=f"At v0 = {portraits[0].drive.belt_speed:g}, {which}.",
    )


@computes("fig-7-order", 7)
@computes("fig-11-order", 11)
def _(evidence: Evidence, figure: int) -> Observation:
    portraits = evidence.portraits(figure).portraits
    stages = [stage for stage, _ in groupby(regimes(portraits))]
    labels = [f"{p.case.label}: {p.measures.regime}" for p in portraits]
    expected = [Regime.STICK_SLIP, Regime.PURE_SLIP, Regime.EQUILIBRIUM]
    return Observation("; ".join(labels), stages == expected)


computes["linear-slope"] = lambda _: Number(
    trace(1e-9, 0.0),
    remark="The computed value is the Stribeck law's slope at zero relative speed, "
    f"{trace(1e-9, 0.0) / PRINTED_SLOPE:.4g} times the printed one.",
)


@computes("fig-8")
def _(evidence: Evidence) -> Observation:
    portraits = evidence.portraits(8).portraits
    damped = [portrait for portrait in portraits if portrait.drive.damping > 0.0]
    undamped = [portrait for portrait in portraits if portrait.drive.damping == 0.0]
    ranges = [(p.measures.amplitude or 0.0) / p.drive.belt_speed for p in undamped]
    betas, speeds = (0.001, 1.0), (0.02, 0.2, 2.0)
    law = Coulomb(STRIBECK.static)
    drives = [unit_drive(v, damping=2.0 * beta, friction=law) for beta in betas for v in speeds]
    found = [cycle for drive in drives for cycle in limit_cycles(drive)]
    return Observation(
        f"{regimes(damped).count(Regime.EQUILIBRIUM)} of {len(damped)} dampings come to rest",
        set(regimes(damped)) == {Regime.EQUILIBRIUM} and not found,
        remark="Without damping the initial vibration neither grows nor decays: amplitude "
        f"{listed(ranges)} belt speeds. At v0 = {listed(speeds)} with beta = {listed(betas)} "
        f"shooting finds {len(found)} limit cycles.",
    )


@computes("fig-9-vibration")
def _(evidence: Evidence) -> Observation:
    # the tangent slope, and the printed one at two belt speeds
    tangent, printed, slow = evidence.portraits(9).panels
    least = [panel.portraits[0] for panel in (tangent, printed, slow)]
    vibrates = [portrait.measures.regime in VIBRATING for portrait in least]
    laws = [Linear(STRIBECK.static, slope) for slope in (PRINTED_SLOPE, TANGENT_SLOPE)]
    fastest = [
        border(lambda v, law=law: stays(unit_drive(v, friction=law)), 0.01, 2.0) for law in laws
    ]
    passes = least[1].time_beyond(10.0)
    return Observation(
        f"{least[1].measures.regime} with the printed slope",
        all(vibrates),
        vibrates[0] and vibrates[2],
        f"On a slow belt: with the printed slope below v0 = {fastest[0]:.3f}, with half of it, "
        f"that of the Stribeck law, below {fastest[1]:.3f}, at beta = 0.01 and from rest. On a "
        f"faster belt it diverges: at v0 = {least[1].drive.belt_speed:g} with the printed slope "
        f"the speed passes 10 at tau = {passes or 0.0:.1f}.",
    )


@computes("fig-9-stick")
def _(evidence: Evidence) -> Observation:
    panels = evidence.portraits(9).panels
    tangent, printed, slow = (stick_fractions(panel.portraits) for panel in panels)
    belt_speed = panels[1].portraits[0].drive.belt_speed

    def drive(beta: float) -> Drive:
        law = Linear(STRIBECK.static, PRINTED_SLOPE)
        return unit_drive(belt_speed, damping=2.0 * beta, friction=law)

    gentle = zero_between(lambda beta: arrivals(drive(beta))[0] + STRIBECK.static, 0.1, 0.3)
    bounded = border(lambda beta: not stays(drive(beta)), 0.0, gentle)
    betas = np.linspace(0.1, gentle, 4).tolist()
    runs = [limit_cycle_of_run(drive(beta), 0.0) for beta in betas]
    overrunning = [run.measures.stick_fraction or 0.0 for run in runs if run is not None]
    return Observation(
        f"{listed(printed)} with the printed slope",
        all(_stick_falls(panel.portraits) for panel in panels),
        all(_stick_falls(panel.portraits) for panel in (panels[0], panels[2])),
        "If the slide reaches the belt's speed slowly enough to stick immediately: with half the "
        f"slope, that of the Stribeck law, {listed(tangent)}; with the printed one at v0 = "
        f"{panels[2].portraits[0].drive.belt_speed:g} {listed(slow)}. At v0 = {belt_speed:g} this "
        f"holds above beta = {gentle:.4f}; below, it overtakes the belt before it sticks, and the "
        f"stick fraction rises with the damping: {listed(overrunning)} at beta = {listed(betas)}. "
        f"Up to beta = {bounded:.4f} the motion diverges.",
    )


@computes("falling-slope")
def _(evidence: Evidence) -> Observation:
    laws = (Coulomb(STRIBECK.static), Linear(STRIBECK.static, TANGENT_SLOPE))
    traces = [trace_of(unit_drive(0.2, friction=law)) for law in laws]
    flat = [p.measures.regime for p in evidence.portraits(8).portraits if p.drive.damping > 0.0]
    falls = evidence.portraits(9).panels[0].portraits[0].measures.regime
    return Observation(
        f"p = {traces[0]:.4g} without it, {traces[1]:.4g} with it",
        traces[0] < 0.0 < traces[1] and falls in VIBRATING and not set(flat) & set(VIBRATING),
        remark="Coulomb law and linear law with the tangent slope, beta = 0.01; the motions of "
        "Fig. 8 and 9 agree.",
    )


@computes("stiffness-stability")
def _(_: Evidence) -> Observation:
    stiffnesses = (0.5, 1.0, 2.0, 10.0, 50.0)
    speeds = [hopf_points(unit_drive(0.2, stiffness=k))[0].belt_speed for k in stiffnesses]
    return Observation(
        f"v_b1 = {listed(speeds)}",
        falling(speeds),
        remark=f"For stiffness {listed(stiffnesses)}: the Hopf speed does not depend on it, since "
        "the trace p does not. The same holds in SI units, where p is (N mu' - c)/m.",
    )


def _of_stiffnesses(evidence: Evidence) -> list[Portrait]:
    """Return the motions of Fig. 10 at v0 = 0.2."""
    usual, stiff, _ = evidence.portraits(10).panels
    return [*usual.portraits, *stiff.portraits]


@computes("fig-10-end")
def _(_: Evidence) -> Observation:
    def beyond_friction(stiffness: float, arrival: int) -> float:
        """Return the excess over friction of a slide that reaches the belt's speed."""
        return abs(arrivals(unit_drive(0.2, stiffness=stiffness))[arrival]) - STRIBECK.static

    overruns = zero_between(lambda stiffness: beyond_friction(stiffness, 0), 1.0, 100.0)
    never = zero_between(lambda stiffness: beyond_friction(stiffness, 1), 100.0, 10_000.0)
    stiffer = [never * factor for factor in (1.01, 10.0, 100.0)]
    found = [cycle for stiffness in stiffer for cycle in cycles(0.2, stiffness=stiffness)]
    less = [cycles(0.2, stiffness=never / factor)[0] for factor in (1.01, 10.0, 100.0)]
    return Observation(
        f"from stiffness {never:.4g} on",
        [cycle.measures.regime for cycle in found] == [Regime.PURE_SLIP] * len(stiffer)
        and all(cycle.stable for cycle in found)
        and all(cycle.measures.regime is Regime.STICK_SLIP for cycle in less),
        remark=f"Above stiffness {overruns:.4g} the slide reaches the belt's speed with a "
        "reaction that friction cannot hold, and overtakes the belt; it sticks when it returns "
        f"to the belt's speed, but above {never:.4g} friction cannot hold it then either. "
        "Shooting finds one stable cycle without sticking at stiffness "
        f"{listed(stiffer)}. Just below the onset of sticking less is sufficient, since that moves "
        f"from v0 = {exact_onset():.5f} at stiffness 1 to {exact_onset(stiffness=2.0):.5f} at 2 "
        f"and {exact_onset(stiffness=50.0):.5f} at 50.",
    )


@computes("fig-10-size")
def _(evidence: Evidence) -> Observation:
    portraits = _of_stiffnesses(evidence)
    sizes = [amplitude(portrait) for portrait in portraits]
    speeds = [portrait.measures.velocity_amplitude or 0.0 for portrait in portraits]
    return Observation(
        listed(sizes),
        falling(sizes) and falling(speeds),
        remark=f"Displacement amplitudes; speed amplitudes {listed(speeds)}.",
    )


@computes("fig-11-amplitude")
def _(evidence: Evidence) -> Observation:
    sizes = [amplitude(portrait) for portrait in evidence.portraits(11).portraits]
    at_rest = sizes.count(0.0)
    return Observation(
        listed(sizes),
        falling(sizes[: len(sizes) - at_rest]) and not any(sizes[len(sizes) - at_rest :]),
        remark=_of_minima(evidence),
    )


@computes("fig-11-stick")
def _(evidence: Evidence) -> Observation:
    portraits = evidence.portraits(11).portraits
    belt_speed, minima = 0.15, (0.1, 0.02, 0.001)

    def drive(minimum: float) -> Drive:
        return unit_drive(belt_speed, friction=replace(STRIBECK, minimum=minimum))

    fractions = [limit_cycles(drive(m))[0].measures.stick_fraction or 0.0 for m in minima]
    overruns = zero_between(lambda m: arrivals(drive(m))[0] + STRIBECK.static, 0.001, 0.1)
    return Observation(
        listed(stick_fractions(portraits)),
        _stick_falls(portraits) and falling(fractions[::-1]),
        _stick_falls(portraits),
        f"As long as the slide does not overtake the belt before it sticks. {_of_minima(evidence)} "
        f"At v0 = {belt_speed:g}, where it does so below mu_m = {overruns:.4f}, the fraction is "
        f"{listed(fractions)} for mu_m = {listed(minima)}.",
    )


def _of_minima(evidence: Evidence) -> str:
    minima = [
        portrait.drive.friction.minimum
        for portrait in evidence.portraits(11).portraits
        if isinstance(portrait.drive.friction, Stribeck)
    ]
    return f"At v0 = 0.4 for mu_m = {listed(minima)}: the gap shrinks."
