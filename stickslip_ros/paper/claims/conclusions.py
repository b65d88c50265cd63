"""The abstract and section 5, which both summarize the results of the paper."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stickslip_ros.paper.claims.claim import Computations, Evidence, Observation
from stickslip_ros.paper.claims.paper_values import (
    DAMPING,
    FILTER,
    VIBRATING,
    amplitude,
    controlled_amplitude,
    critical,
    cycles,
    expansion,
    falling,
    hopf_point,
    listed,
    trace,
    trace_of,
)
from stickslip_ros.paper.figures import STRIBECK, unit_drive

computes = Computations()

_STILL_ON_ITS_WAY = 0.02
"""Trace below which the motions of a bifurcation diagram have not settled yet."""


@computes("critical-speed-confirmed")
def _(evidence: Evidence) -> Observation:
    figures = [evidence.bifurcation(number) for number in (2, 3, 4, 5)]
    agree = [
        (measures.regime in VIBRATING) == (p > 0.0)
        for figure in figures
        for measures, drive in zip(figure.diagram.measures, figure.diagram.drives, strict=True)
        if drive.belt_speed > 0.0 and abs(p := trace_of(drive)) > _STILL_ON_ITS_WAY
    ]
    return Observation(
        f"{sum(agree)} of {len(agree)} drives",
        all(agree),
        remark="Of Fig. 2 to 5: they vibrate if p > 0 and rest if p < 0; drives with p within "
        f"{_STILL_ON_ITS_WAY:g} of zero, which have not settled yet, are omitted. The p is that of "
        "the damping in eq. 5; eq. 8 has another.",
    )


@computes("curvature-confirmed")
def _(_: Evidence) -> Observation:
    sigma = hopf_point().first_lyapunov_coefficient
    distances = (2e-2, 2e-3, 2e-4)
    found, expected = zip(*map(_multipliers, distances), strict=True)
    # The share by which a deviation falls in one cycle.
    ratios = [(1.0 - a) / (1.0 - b) for a, b in zip(found, expected, strict=True)]
    return Observation(
        f"sigma = {sigma:.4g}, multipliers {_listed(found)}",
        (sigma < 0.0) == (max(found) < 1.0)
        and falling([abs(ratio - 1.0) for ratio in ratios])
        and abs(ratios[-1] - 1.0) < 1e-2,
        remark=f"At distances {listed(distances)} below v_b1, by shooting; sigma predicts "
        f"{_listed(expected)}.",
    )


def _multipliers(distance: float) -> tuple[float, float]:
    """Return the Floquet multiplier of the cycle at this distance below v_b1, and that of sigma."""
    speed = hopf_point().belt_speed - distance
    (cycle,) = cycles(speed)
    # Near the cycle of r' = alpha r + sigma r^3 a deviation grows by exp(-2 alpha T).
    alpha = float(expansion(speed).eigenvalues[0].real)
    return abs(cycle.multipliers[0]), float(np.exp(-2.0 * alpha * cycle.period))


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.5f}" for value in values)


@computes("main-factors")
def _(_: Evidence) -> Observation:
    base = unit_drive(0.4)
    changed = {
        "feed speed 0.6": replace(base, belt_speed=0.6),
        "beta 0.1": replace(base, damping=0.2),
        "mu_m 0.39": replace(base, friction=replace(STRIBECK, minimum=0.39)),
        "stiffness 50": replace(base, stiffness=50.0),
    }
    traces = {name: trace_of(drive) for name, drive in changed.items()}
    stable = [p < 0.0 for p in traces.values()]
    return Observation(
        f"p = {trace(0.4):.4g} at v0 = 0.4",
        trace(0.4) > 0.0 and stable == [True, True, True, False],
        remark="Changed to "
        + ", ".join(f"{p:.4g} by {name}" for name, p in traces.items())
        + ": the first three can end the vibration, the stiffness cannot.",
    )


@computes("what-inhibits")
def _(evidence: Evidence) -> Observation:
    ends = [evidence.bifurcation(number).diagram for number in (2, 3, 5)]
    slow = int(np.searchsorted(evidence.bifurcation(2).values, 1.0 / 3.0))
    quiet = [ends[0].measures[-1], ends[1].measures[-1], ends[2].measures[0]]
    loud = [ends[0].measures[slow], ends[1].measures[0], ends[2].measures[-1]]
    return Observation(
        ", ".join(str(measures.regime) for measures in quiet),
        all(measures.regime in VIBRATING for measures in loud)
        and not any(measures.regime in VIBRATING for measures in quiet),
        remark="At the ends of Fig. 2, 3 and 5; at v0 = "
        f"{ends[0].drives[slow].belt_speed:.3g}, at no damping and at the "
        f"largest ratio it is {', '.join(str(measures.regime) for measures in loud)}.",
    )


@computes("amplitude-reduced")
def _(evidence: Evidence) -> Observation:
    sizes = [[amplitude(p) for p in panel.portraits] for panel in evidence.portraits(13).panels]
    without = sizes[0][0]
    largest = max(sizes[0][1:])
    slower, high = (
        controlled_amplitude(speed, gains) / controlled_amplitude(speed, FILTER) - 1.0
        for speed, gains in (
            (0.1, replace(FILTER, linear=0.9 * critical(0.1, DAMPING).linear)),
            (0.4, replace(FILTER, corner_frequency=20.0, linear=-10.0)),
        )
    )
    return Observation(
        f"from {without:.4f} to {listed(sizes[0][1:])}",
        all(falling([without, *values]) for values in (sizes[0][1:], sizes[1], sizes[2])),
        sizes[0][-1] < without and falling([without, *sizes[1]]),
        "Not with every gain: with d = 2 and a small k1 it changes by "
        f"{largest / without - 1.0:+.2%}, although the speed amplitude falls. In Fig. 13: over k2 "
        f"{listed(sizes[1])}, over k1 with d = 0.2 {listed(sizes[2])}. At v0 = 0.1 nine tenths of "
        f"the critical gain change it by {slower:+.0%}; with d = 20, for which no gain is critical "
        f"at v0 = 0.4, k1 = -10 changes it by {high:+.0%}.",
    )


@computes("topology")
def _(evidence: Evidence) -> Observation:
    linear, cubic, slow = evidence.portraits(13).panels
    portraits = [*linear.portraits[1:], *cubic.portraits, *slow.portraits]
    vibrating = [portrait.measures.regime in VIBRATING for portrait in portraits]
    return Observation(
        f"{vibrating.count(False)} of {len(vibrating)} portraits",
        not any(vibrating),
        not all(vibrating),
        f"Only beyond the critical k1, {critical(0.4, DAMPING).linear:.4f} with d = 2 and "
        f"{critical(0.4, DAMPING, 0.2).linear:.4f} with d = 0.2, where there is no limit cycle. "
        f"In the other {vibrating.count(True)} an unstable equilibrium lies in a cycle as before.",
    )


@computes("more-effective")
def _(_: Evidence) -> Observation:
    # A force k1 y on the speed itself adds to p and keeps the equilibrium too, since y = 0 there.
    plain = -trace(0.4)
    corners = (FILTER.corner_frequency, 0.2, 0.02)
    washout = [critical(0.4, DAMPING, d).linear for d in corners]
    return Observation(
        f"k1 = {washout[0]:.4f} against {plain:.4f}",
        min(map(abs, washout)) < abs(plain),
        remark=f"The paper makes no comparison; a plain force k1 y needs {plain:.4f} at v0 = "
        f"0.4 and keeps the equilibrium too; the filter needs {washout[0] / plain:.3g} times "
        f"that with d = 2, {washout[1] / plain:.3g} times with d = 0.2 and "
        f"{washout[2] / plain:.5g} times with d = 0.02.",
    )
