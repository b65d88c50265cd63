"""Sections 3.2 to 3.5: the phase portraits, Fig. 6 to 11."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from math import sqrt

import numpy as np

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Linear, Stribeck
from stickslip_ros.model.functions import zero_between
from stickslip_ros.paper.claims.paper_values import (
    FASTER,
    PRINTED_HOPF_SPEED,
    SLOWER,
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
    only_rest_at,
    overdamped_from,
    regimes,
    stays,
    stick_fractions,
    trace,
    trace_of,
)
from stickslip_ros.paper.claims.verdict import Computations, Evidence, Number, Observation
from stickslip_ros.paper.figures import PRINTED_SLOPE, STRIBECK, TANGENT_SLOPE, Portrait, unit_drive
from stickslip_ros.theory.hopf import hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycle_of_run, limit_cycles

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
        set(regimes(above)) == {Regime.EQUILIBRIUM} and off < 1e-3 and only_rest_at(FASTER),
        speeds=belt_speeds(above),
        off=off,
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
        rises and falling(beyond),
        rises,
        times=times,
        overdamped=overdamped,
        decay=-beyond[0],
        faster_decay=-beyond[1],
        fastest_decay=-beyond[2],
        speeds=belt_speeds(above),
    )


@computes("fig-6-unstable")
def _(evidence: Evidence) -> Observation:
    below = _of_speed(evidence, 0.0, hopf_point().belt_speed)
    return Observation(
        all(portrait.vibrates for portrait in below),
        speeds=belt_speeds(below),
        sizes=[amplitude(portrait) for portrait in below],
    )


@computes("fig-6-pure-slip")
def _(evidence: Evidence) -> Observation:
    between = _of_speed(evidence, exact_onset(), hopf_point().belt_speed)
    least = [portrait.least_relative_speed or 0.0 for portrait in between]
    return Observation(
        set(regimes(between)) == {Regime.PURE_SLIP} and min(least) > 0.0,
        least=least,
        speeds=belt_speeds(between),
    )


@computes("fig-6-no-cycle")
def _(_: Evidence) -> Observation:
    found = cycles(0.45)
    return Observation(
        not found,
        count=len(found),
        sizes=[cycle.measures.amplitude or 0.0 for cycle in found],
        periods=[cycle.period for cycle in found],
        multipliers=[abs(cycle.multipliers[0]) for cycle in found],
    )


@computes("fig-6-stick-slip")
def _(evidence: Evidence) -> Observation:
    below = _of_speed(evidence, 0.0, exact_onset())
    fractions = stick_fractions(below)
    slower = [cycles(speed)[0].measures.stick_fraction or 0.0 for speed in SLOWER]
    return Observation(
        set(regimes(below)) == {Regime.STICK_SLIP}
        and max(portrait.least_relative_speed or 0.0 for portrait in below) == 0.0
        and min(slower) > 0.0,
        fractions=fractions,
        speeds=belt_speeds(below),
        slower=slower,
    )


computes["vb0"] = lambda _: Number(
    exact_onset(), {"By averaging, an approximation": approximate_onset()}
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
        apart < rounding,
        of_hopf=of_hopf,
        of_onset=of_onset,
        printed_onset=_PRINTED_ONSET,
        of_exact=of_exact,
    )


@computes("grazing")
def _(_: Evidence) -> Observation:
    speed = exact_onset()
    fractions = [
        cycles(speed * factor)[0].measures.stick_fraction or 0.0
        for factor in (1.0 - 1e-4, 1.0 + 1e-4)
    ]
    return Observation(fractions[0] > 0.0 == fractions[1], speed=speed, fractions=fractions)


@computes("damping-cures")
def _(evidence: Evidence) -> Observation:
    most = evidence.portraits(7).portraits[-1]
    critical = critical_beta(most.drive.belt_speed)
    return Observation(
        most.measures.regime is Regime.EQUILIBRIUM
        and critical < most.drive.damping_coefficient / 2.0,
        critical=critical,
        most=most,
    )


@computes("critical-speed-of-damping")
def _(_: Evidence) -> Observation:
    betas = (0.0, 0.01, 0.05, 0.1)
    true = [hopf_point(2.0 * beta).belt_speed for beta in betas]
    once, twice = ([sqrt((0.45 - n * beta) / 1.8) for beta in betas] for n in (1.0, 2.0))
    return Observation(
        bool(np.allclose(once, true, rtol=1e-9)),
        bool(np.allclose(twice, true, rtol=1e-9)),
        true=true,
        once=once,
        betas=betas,
    )


@computes("fig-7-stick", 7)
@computes("fig-10-stick", 10)
def _(evidence: Evidence, figure: int) -> Observation:
    portraits = evidence.portraits(7).portraits if figure == 7 else _of_stiffnesses(evidence)
    return Observation(
        _stick_falls(portraits),
        fractions=stick_fractions(portraits),
        belt_speed=portraits[0].drive.belt_speed,
        stiffnesses=[portrait.drive.stiffness for portrait in portraits],
    )


@computes("fig-7-order", 7)
@computes("fig-11-order", 11)
def _(evidence: Evidence, figure: int) -> Observation:
    portraits = evidence.portraits(figure).portraits
    stages = [stage for stage, _ in groupby(regimes(portraits))]
    labels = [f"{p.case.label}: {p.measures.regime}" for p in portraits]
    expected = [Regime.STICK_SLIP, Regime.PURE_SLIP, Regime.EQUILIBRIUM]
    return Observation(stages == expected, outcome="; ".join(labels))


computes["linear-slope"] = lambda _: Number(
    trace(1e-9, 0.0), share=trace(1e-9, 0.0) / PRINTED_SLOPE
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
        set(regimes(damped)) == {Regime.EQUILIBRIUM} and not found,
        resting=regimes(damped).count(Regime.EQUILIBRIUM),
        total=len(damped),
        ranges=ranges,
        speeds=speeds,
        betas=betas,
        count=len(found),
    )


@computes("fig-9-vibration")
def _(evidence: Evidence) -> Observation:
    # the tangent slope, and the printed one at two belt speeds
    tangent, printed, slow = evidence.portraits(9).panels
    least = [panel.portraits[0] for panel in (tangent, printed, slow)]
    vibrates = [portrait.vibrates for portrait in least]
    laws = [Linear(STRIBECK.static, slope) for slope in (PRINTED_SLOPE, TANGENT_SLOPE)]
    fastest = [
        border(lambda v, law=law: stays(unit_drive(v, friction=law)), 0.01, 2.0) for law in laws
    ]
    passes = least[1].time_beyond(10.0)
    return Observation(
        all(vibrates),
        vibrates[0] and vibrates[2],
        least=least,
        fastest=fastest,
        passes=passes or 0.0,
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
        all(_stick_falls(panel.portraits) for panel in panels),
        all(_stick_falls(panel.portraits) for panel in (panels[0], panels[2])),
        printed=printed,
        tangent=tangent,
        panels=panels,
        slow=slow,
        belt_speed=belt_speed,
        gentle=gentle,
        overrunning=overrunning,
        betas=betas,
        bounded=bounded,
    )


@computes("falling-slope")
def _(evidence: Evidence) -> Observation:
    laws = (Coulomb(STRIBECK.static), Linear(STRIBECK.static, TANGENT_SLOPE))
    traces = [trace_of(unit_drive(0.2, friction=law)) for law in laws]
    flat = [p.vibrates for p in evidence.portraits(8).portraits if p.drive.damping > 0.0]
    falls = evidence.portraits(9).panels[0].portraits[0].vibrates
    return Observation(
        traces[0] < 0.0 < traces[1] and falls and not any(flat),
        traces=traces,
    )


@computes("stiffness-stability")
def _(_: Evidence) -> Observation:
    stiffnesses = (0.5, 1.0, 2.0, 10.0, 50.0)
    speeds = [hopf_points(unit_drive(0.2, stiffness=k))[0].belt_speed for k in stiffnesses]
    return Observation(falling(speeds), speeds=speeds, stiffnesses=stiffnesses)


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
        [cycle.measures.regime for cycle in found] == [Regime.PURE_SLIP] * len(stiffer)
        and all(cycle.stable for cycle in found)
        and all(cycle.measures.regime is Regime.STICK_SLIP for cycle in less),
        never=never,
        overruns=overruns,
        stiffer=stiffer,
        onset=exact_onset(),
        stiff_onset=exact_onset(stiffness=2.0),
        stiffest_onset=exact_onset(stiffness=50.0),
    )


@computes("fig-10-size")
def _(evidence: Evidence) -> Observation:
    portraits = _of_stiffnesses(evidence)
    sizes = [amplitude(portrait) for portrait in portraits]
    speeds = [portrait.measures.velocity_amplitude or 0.0 for portrait in portraits]
    return Observation(falling(sizes) and falling(speeds), sizes=sizes, speeds=speeds)


@computes("fig-11-amplitude")
def _(evidence: Evidence) -> Observation:
    sizes = [amplitude(portrait) for portrait in evidence.portraits(11).portraits]
    at_rest = sizes.count(0.0)
    return Observation(
        falling(sizes[: len(sizes) - at_rest]) and not any(sizes[len(sizes) - at_rest :]),
        sizes=sizes,
        gaps=_gaps(evidence),
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
        _stick_falls(portraits) and falling(fractions[::-1]),
        _stick_falls(portraits),
        found=stick_fractions(portraits),
        gaps=_gaps(evidence),
        fractions=fractions,
        minima=minima,
        belt_speed=belt_speed,
        overruns=overruns,
    )


def _gaps(evidence: Evidence) -> list[float]:
    """Return mu_m of the motions of Fig. 11."""
    drives = [portrait.drive for portrait in evidence.portraits(11).portraits]
    return [d.friction.minimum for d in drives if isinstance(d.friction, Stribeck)]
