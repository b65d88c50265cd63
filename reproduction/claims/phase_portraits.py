"""Sections 3.2 to 3.5: the phase portraits, Fig. 6 to 11."""

from collections.abc import Callable
from dataclasses import replace
from itertools import groupby
from math import sqrt

import numpy as np

from reproduction.claims.paper_values import (
    FASTER,
    OPEN,
    PRINTED_HOPF_SPEED,
    PRINTED_ONSET,
    SLOWER,
    Loop,
    at,
    border,
    critical_beta,
    falling,
    overdamped_from,
)
from reproduction.claims.verdict import Computations, Evidence, Number, Observation
from reproduction.figures import PRINTED_SLOPE, STRIBECK, TANGENT_SLOPE, Portraits
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.friction import Coulomb, Linear, Stribeck
from stickslip_ros.model.functions import zero_between

computes = Computations()

_TANGENT, _PRINTED = (Linear(STRIBECK.static, slope) for slope in (TANGENT_SLOPE, PRINTED_SLOPE))
"""The linear laws of Fig. 9."""


def _stick_falls(portraits: Portraits) -> bool:
    return falling([fraction for fraction in portraits.stick_fractions if fraction > 0.0])


def _above_hopf(evidence: Evidence) -> Portraits:
    """Return the motions of Fig. 6 with a stable equilibrium."""
    return evidence.portraits(6).portraits.between(OPEN.hopf.belt_speed, 9.0)


@computes("fig-6-rest")
def _(evidence: Evidence) -> Observation:
    above = _above_hopf(evidence)
    off = max(abs((p.least_relative_speed or 0.0) / p.drive.belt_speed - 1.0) for p in above)
    rest = {*above.regimes} == {Regime.EQUILIBRIUM} and all(at(v).only_rests for v in FASTER)
    return Observation(rest and off < 1e-3, above=above, off=off)


@computes("fig-6-settling")
def _(evidence: Evidence) -> Observation:
    above = _above_hopf(evidence)
    times = [portrait.settling_time or 0.0 for portrait in above]
    overdamped = overdamped_from()
    speeds = np.linspace(OPEN.hopf.belt_speed, overdamped, 20).tolist()
    near, beyond = (
        [-float(at(v).eigenvalues[0].real) for v in tried]
        for tried in (speeds, (overdamped, 1.5, 2.0))
    )
    rises = falling(times) and falling(near[::-1])
    return Observation(
        rises and falling(beyond[::-1]),
        rises,
        times=times,
        overdamped=overdamped,
        decay_rates=beyond,
        above=above,
    )


@computes("fig-6-unstable")
def _(evidence: Evidence) -> Observation:
    below = evidence.portraits(6).portraits.between(0.0, OPEN.hopf.belt_speed)
    return Observation(all(portrait.vibrates for portrait in below), below=below)


@computes("fig-6-pure-slip")
def _(evidence: Evidence) -> Observation:
    between = evidence.portraits(6).portraits.between(OPEN.exact_onset, OPEN.hopf.belt_speed)
    least = [portrait.least_relative_speed or 0.0 for portrait in between]
    slips = {*between.regimes} == {Regime.PURE_SLIP}
    return Observation(slips and min(least) > 0.0, least=least, between=between)


@computes("fig-6-no-cycle")
def _(_: Evidence) -> Observation:
    found = at(0.45).cycles
    periods = [cycle.period for cycle in found]
    return Observation(not found, count=len(found), loop=at(0.45), periods=periods)


@computes("fig-6-stick-slip")
def _(evidence: Evidence) -> Observation:
    below = evidence.portraits(6).portraits.between(0.0, OPEN.exact_onset)
    slower = [at(speed).stick_fraction for speed in SLOWER]
    touch = max(portrait.least_relative_speed or 0.0 for portrait in below) == 0.0
    sticks = {*below.regimes} == {Regime.STICK_SLIP}
    return Observation(sticks and touch and min(slower) > 0.0, below=below, slower=slower)


computes["vb0"] = lambda _: Number(
    OPEN.exact_onset, {"By averaging, an approximation": OPEN.approximate_onset}
)


@computes("vb0-and-vb1")
def _(_: Evidence) -> Observation:
    def damping(printed: float, belt_speed: Callable[[Loop], float]) -> float:
        """Return the damping with which the loop has the printed speed."""
        return zero_between(lambda damping: belt_speed(at(1.0, damping)) - printed, 0.0, 0.1)

    of_hopf = damping(PRINTED_HOPF_SPEED, lambda loop: loop.hopf.belt_speed)
    of_onset = damping(PRINTED_ONSET, lambda loop: loop.approximate_onset)
    of_exact = damping(PRINTED_ONSET, lambda loop: loop.exact_onset)
    rounding = 2e-4  # of the printed speeds, times the slopes of the damping over them
    apart = min(abs(of_hopf - of_onset), abs(of_hopf - of_exact))
    return Observation(apart < rounding, of_hopf=of_hopf, of_onset=of_onset, of_exact=of_exact)


@computes("grazing")
def _(_: Evidence) -> Observation:
    factors = (1.0 - 1e-4, 1.0 + 1e-4)
    fractions = [at(OPEN.exact_onset * factor).stick_fraction for factor in factors]
    return Observation(fractions[0] > 0.0 == fractions[1], fractions=fractions)


@computes("damping-cures")
def _(evidence: Evidence) -> Observation:
    most = evidence.portraits(7).portraits[-1]
    critical = critical_beta(most.drive.belt_speed)
    rests = most.measures.regime is Regime.EQUILIBRIUM
    enough = critical < most.drive.damping_coefficient / 2.0
    return Observation(rests and enough, critical=critical, most=most)


@computes("critical-speed-of-damping")
def _(_: Evidence) -> Observation:
    betas = (0.0, 0.01, 0.05, 0.1)
    true = [at(1.0, 2.0 * beta).hopf.belt_speed for beta in betas]
    once, twice = ([sqrt((0.45 - n * beta) / 1.8) for beta in betas] for n in (1.0, 2.0))
    same = [bool(np.allclose(printed, true, rtol=1e-9)) for printed in (once, twice)]
    return Observation(*same, true=true, once=once, betas=betas)


@computes("fig-7-stick", 7)
@computes("fig-10-stick", 10)
def _(evidence: Evidence, figure: int) -> Observation:
    portraits = evidence.portraits(7).portraits if figure == 7 else _of_stiffnesses(evidence)
    stiffnesses = [portrait.drive.stiffness for portrait in portraits]
    return Observation(_stick_falls(portraits), portraits=portraits, stiffnesses=stiffnesses)


@computes("fig-7-order", 7)
@computes("fig-11-order", 11)
def _(evidence: Evidence, figure: int) -> Observation:
    portraits = evidence.portraits(figure).portraits
    stages = [stage for stage, _ in groupby(portraits.regimes)]
    labels = [f"{p.case.label}: {p.measures.regime}" for p in portraits]
    expected = [Regime.STICK_SLIP, Regime.PURE_SLIP, Regime.EQUILIBRIUM]
    return Observation(stages == expected, outcome="; ".join(labels))


@computes("linear-slope")
def _(_: Evidence) -> Number:
    slope = at(1e-9, 0.0).trace
    return Number(slope, share=slope / PRINTED_SLOPE)


@computes("fig-8")
def _(evidence: Evidence) -> Observation:
    portraits = evidence.portraits(8).portraits
    damped = Portraits(portrait for portrait in portraits if portrait.drive.damping > 0.0)
    undamped = [portrait for portrait in portraits if portrait.drive.damping == 0.0]
    betas, speeds = (0.001, 1.0), (0.02, 0.2, 2.0)
    law = Coulomb(STRIBECK.static)
    loops = [at(v, 2.0 * beta, friction=law) for beta in betas for v in speeds]
    count = sum(len(loop.cycles) for loop in loops)
    return Observation(
        {*damped.regimes} == {Regime.EQUILIBRIUM} and not count,
        resting=damped.regimes.count(Regime.EQUILIBRIUM),
        total=len(damped),
        ranges=[portrait.amplitude / portrait.drive.belt_speed for portrait in undamped],
        speeds=speeds,
        betas=betas,
        count=count,
    )


@computes("fig-9-vibration")
def _(evidence: Evidence) -> Observation:
    # the tangent slope, and the printed one at two belt speeds
    tangent, printed, slow = (panel.portraits[0] for panel in evidence.portraits(9).panels)
    fastest = [
        border(lambda v, law=law: at(v, friction=law).bounded, 0.01, 2.0)
        for law in (_PRINTED, _TANGENT)
    ]
    bounded = tangent.vibrates and slow.vibrates
    return Observation(
        bounded and printed.vibrates,
        bounded,
        least=printed,
        fastest=fastest,
        passes=printed.time_beyond(10.0) or 0.0,
    )


@computes("fig-9-stick")
def _(evidence: Evidence) -> Observation:
    tangent, printed, slow = (panel.portraits for panel in evidence.portraits(9).panels)

    def loop(beta: float) -> Loop:
        return at(printed[0].drive.belt_speed, 2.0 * beta, friction=_PRINTED)

    gentle = zero_between(lambda beta: loop(beta).arrivals[0] + STRIBECK.static, 0.1, 0.3)
    betas = np.linspace(0.1, gentle, 4).tolist()
    runs = [loop(beta).from_rest for beta in betas]
    falls = _stick_falls(tangent) and _stick_falls(slow)
    return Observation(
        falls and _stick_falls(printed),
        falls,
        tangent=tangent,
        printed=printed,
        slow=slow,
        gentle=gentle,
        overrunning=[run.measures.stick_fraction or 0.0 for run in runs if run is not None],
        betas=betas,
        bounded=border(lambda beta: not loop(beta).bounded, 0.0, gentle),
    )


@computes("falling-slope")
def _(evidence: Evidence) -> Observation:
    traces = [at(0.2, friction=law).trace for law in (Coulomb(STRIBECK.static), _TANGENT)]
    flat = [p.vibrates for p in evidence.portraits(8).portraits if p.drive.damping > 0.0]
    falls = evidence.portraits(9).portraits[0].vibrates
    return Observation(traces[0] < 0.0 < traces[1] and falls and not any(flat), traces=traces)


@computes("stiffness-stability")
def _(_: Evidence) -> Observation:
    stiffnesses = (0.5, 1.0, 2.0, 10.0, 50.0)
    speeds = [at(0.2, stiffness=stiffness).hopf.belt_speed for stiffness in stiffnesses]
    return Observation(falling(speeds), speeds=speeds, stiffnesses=stiffnesses)


def _of_stiffnesses(evidence: Evidence) -> Portraits:
    """Return the motions of Fig. 10 at v0 = 0.2."""
    usual, stiff, _ = evidence.portraits(10).panels
    return Portraits([*usual.portraits, *stiff.portraits])


@computes("fig-10-end")
def _(_: Evidence) -> Observation:
    def beyond_friction(stiffness: float, arrival: int) -> float:
        """Return the excess over friction of a slide that reaches the belt's speed."""
        return abs(at(0.2, stiffness=stiffness).arrivals[arrival]) - STRIBECK.static

    never = zero_between(lambda stiffness: beyond_friction(stiffness, 1), 100.0, 10_000.0)
    factors = (1.01, 10.0, 100.0)
    stiffer = [never * factor for factor in factors]
    found = [cycle for stiffness in stiffer for cycle in at(0.2, stiffness=stiffness).cycles]
    less = [at(0.2, stiffness=never / factor).cycles[0] for factor in factors]
    return Observation(
        [cycle.measures.regime for cycle in found] == [Regime.PURE_SLIP] * len(stiffer)
        and all(cycle.stable for cycle in found)
        and all(cycle.measures.regime is Regime.STICK_SLIP for cycle in less),
        never=never,
        overruns=zero_between(lambda stiffness: beyond_friction(stiffness, 0), 1.0, 100.0),
        stiffer=stiffer,
        stiff=at(1.0, stiffness=2.0),
        stiffest=at(1.0, stiffness=50.0),
    )


@computes("fig-10-size")
def _(evidence: Evidence) -> Observation:
    portraits = _of_stiffnesses(evidence)
    speeds = [portrait.measures.velocity_amplitude or 0.0 for portrait in portraits]
    falls = falling(portraits.amplitudes) and falling(speeds)
    return Observation(falls, portraits=portraits, speeds=speeds)


@computes("fig-11-amplitude")
def _(evidence: Evidence) -> Observation:
    sizes = evidence.portraits(11).portraits.amplitudes
    first_rest = len(sizes) - sizes.count(0.0)
    falls = falling(sizes[:first_rest]) and not any(sizes[first_rest:])
    return Observation(falls, sizes=sizes, gaps=_gaps(evidence))


@computes("fig-11-stick")
def _(evidence: Evidence) -> Observation:
    portraits = evidence.portraits(11).portraits
    belt_speed, minima = 0.15, (0.1, 0.02, 0.001)

    def loop(minimum: float) -> Loop:
        return at(belt_speed, friction=replace(STRIBECK, minimum=minimum))

    fractions = [loop(minimum).stick_fraction for minimum in minima]
    falls = _stick_falls(portraits)
    return Observation(
        falls and falling(fractions[::-1]),
        falls,
        portraits=portraits,
        gaps=_gaps(evidence),
        fractions=fractions,
        minima=minima,
        belt_speed=belt_speed,
        overruns=zero_between(lambda m: loop(m).arrivals[0] + STRIBECK.static, 0.001, 0.1),
    )


def _gaps(evidence: Evidence) -> list[float]:
    """Return mu_m of the motions of Fig. 11."""
    drives = [portrait.drive for portrait in evidence.portraits(11).portraits]
    return [d.friction.minimum for d in drives if isinstance(d.friction, Stribeck)]
