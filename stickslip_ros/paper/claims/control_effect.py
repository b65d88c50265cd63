"""Sections 4 and 5 and the abstract: the effect of the control, Fig. 12 and 13, and all in all."""

from dataclasses import replace
from math import log

import numpy as np

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.control import Washout
from stickslip_ros.motion import Motion
from stickslip_ros.paper.claims.paper_values import (
    DAMPING,
    FASTER,
    FILTER,
    PRINTED_GAIN,
    SLOWER,
    STUDIED_SPEED,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    amplitude,
    amplitudes,
    border,
    controlled_amplitude,
    critical,
    cycles,
    expansion,
    falling,
    for_both,
    hopf_point,
    known,
    listed,
    trace,
    trace_of,
)
from stickslip_ros.paper.claims.verdict import Computations, Evidence, Number, Observation
from stickslip_ros.paper.figures import STRIBECK, unit_drive
from stickslip_ros.studies.settling import CYCLES
from stickslip_ros.theory.hopf import hopf_points

computes = Computations()

_FIG_12_SPEEDS = (0.48, 0.49, 0.492)


computes["fig-12-place"] = lambda _: Number(
    hopf_point().belt_speed, taken=hopf_point(TAKEN_DAMPING)
)


@computes("fig-12-sudden")
@computes("jump")
def _(_: Evidence) -> Observation:
    """Observe whether the amplitude jumps below the Hopf point."""
    speed = hopf_point().belt_speed
    distances = (4e-2, 4e-3, 4e-4, 4e-5)
    sizes = [amplitudes(speed - distance)[0] for distance in distances]
    exponent = log(sizes[-2] / sizes[-1]) / log(distances[-2] / distances[-1])
    squares = [size**2 / distance for size, distance in zip(sizes, distances, strict=True)]
    here, taken = for_both(
        lambda damping: [(amplitudes(v, damping) or [0.0])[0] for v in _FIG_12_SPEEDS]
    )
    return Observation(
        exponent < 0.1,
        here=here,
        squares=squares,
        distances=distances,
        exponent=exponent,
        fig_12_speeds=_FIG_12_SPEEDS,
        taken=taken,
    )


@computes("fig-12-unstable")
def _(evidence: Evidence) -> Observation:
    speeds = _FIG_12_SPEEDS[1:]
    here, taken = for_both(
        lambda damping: not any(expansion(speed, damping).stable for speed in speeds)
    )
    portraits = [
        p for p in evidence.portraits(12).portraits
        if p.drive.belt_speed == STUDIED_SPEED and p.drive.damping == DAMPING
    ]  # fmt: skip
    left = [p.measures.amplitude or 0.0 for p in portraits]
    ends = [float(p.trajectory.time[-1]) for p in portraits]
    return Observation(
        here,
        taken,
        here=[trace(speed) for speed in speeds],
        taken=[trace(v, TAKEN_DAMPING) for v in speeds],
        critical=hopf_point(TAKEN_DAMPING),
        left=left,
        ends=ends,
    )


@computes("fig-12-exchange")
def _(_: Evidence) -> Observation:
    falling_speeds = (*sorted(_FIG_12_SPEEDS, reverse=True), 0.4, 0.1, 0.02)
    found = [cycles(speed, TAKEN_DAMPING) for speed in falling_speeds]
    resting = [bool(expansion(speed, TAKEN_DAMPING).stable) for speed in falling_speeds]
    multipliers = [abs(cycle.multipliers[0]) for here in found for cycle in here]
    above = expansion(hopf_point(TAKEN_DAMPING).belt_speed + 1e-3, TAKEN_DAMPING).stable
    return Observation(
        multipliers[-1] > 1.0 and resting[-1],
        multipliers=multipliers,
        falling_speeds=falling_speeds,
        vibrating=resting.count(False),
        above="stable" if above else "unstable",
    )


@computes("fig-12-subcritical")
@computes("jump-subcritical")
def _(_: Evidence) -> Observation:
    """Observe whether unstable cycles surround a stable equilibrium anywhere nearby."""
    sigmas = for_both(lambda damping: hopf_point(damping).first_lyapunov_coefficient)
    speeds = (*SLOWER, 0.2, 0.4, 0.48, 0.488, STUDIED_SPEED, 0.492, 0.5, *FASTER)
    found = [cycle for speed in speeds for cycle in cycles(speed)]
    unstable = [cycle for cycle in found if not cycle.stable]
    return Observation(
        max(sigmas) > 0.0 or bool(unstable),
        sigmas=sigmas,
        total=len(unstable),
        count=len(found),
        speeds=speeds,
    )


@computes("eq-18-cubic")
def _(evidence: Evidence) -> Observation:
    linear, cubic, _ = evidence.portraits(13).panels
    portraits = [linear.portraits[0], *cubic.portraits]
    sizes = [amplitude(portrait) for portrait in portraits]
    gains = [portrait.case.gains.cubic_gain for portrait in portraits if portrait.case.gains]
    strong = (0.0, -100.0, -1000.0)
    loops = ((0.4, 2.0), (0.4, 0.2), (0.4, 20.0), (0.45, 2.0), (0.2, 2.0))
    left = {
        (v, d): [controlled_amplitude(v, replace(FILTER, corner_frequency=d, cubic_gain=k2))
        for k2 in strong] for v, d in loops
    }  # fmt: skip
    shares = (
        f"{listed([size / found[0] for size in found[1:]])} at v0 = {v:g}, d = {d:g}"
        for (v, d), found in left.items()
    )
    return Observation(
        falling(sizes) and all(map(falling, left.values())),
        falling(sizes) and falling(left[0.4, 2.0]),
        sizes=sizes,
        gains=gains,
        strongest=gains[-1],
        reduction=1.0 - sizes[-1] / sizes[0],
        stronger=strong[1:],
        shares="; ".join(shares),
    )


@computes("eq-30-criterion")
def _(_: Evidence) -> Number:
    here, taken = for_both(lambda damping: known(critical(STUDIED_SPEED, damping).cubic))
    speeds, corners = (0.2, 0.4, STUDIED_SPEED), (0.02, 0.2, 2.0)
    others = (
        f"{listed([critical(v, DAMPING, d).cubic or 0.0 for v in speeds])} at d = {d:g}"
        for d in corners
    )
    slow, fast = (
        [_largest_cubic_gain(v, d, start) for v in speeds for d in (0.2, 2.0, 20.0)]
        for start in (-30.0, -900.0)
    )
    return Number(
        here,
        {TAKEN_FOR_DAMPING: taken},
        taken=taken,
        speeds=speeds,
        others="; ".join(others),
        slow_least=min(slow),
        slow_most=max(slow),
        fast_least=min(fast),
        fast_most=max(fast),
    )


def _largest_cubic_gain(belt_speed: float, corner_frequency: float, speed: float) -> float:
    """Return the cubic gain above which the motion with that initial speed diverges."""

    def stays(cubic: float) -> bool:
        gains = Washout(corner_frequency, 0.0, cubic)
        motion = Motion(unit_drive(belt_speed), 0.0, speed, gains)
        motion.control_state = (0.0,)
        motion.advance(100.0)
        return not motion.unbounded

    return border(stays, 0.0, 2.0)


@computes("eq-30-hopf")
def _(_: Evidence) -> Observation:
    gains = replace(FILTER, linear_gain=PRINTED_GAIN)
    here, taken = for_both(
        lambda damping: hopf_points(unit_drive(STUDIED_SPEED, damping=damping), gains)[-1]
    )
    directed = [p.supercritical and p.crossing_speed < 0.0 for p in (here, taken)]
    return Observation(
        directed[0] and abs(here.belt_speed - STUDIED_SPEED) < 1e-3,
        directed[1] and abs(taken.belt_speed - STUDIED_SPEED) < 1e-3,
        here=here,
        taken=taken,
    )


computes["before-control"] = lambda _: Observation(
    hopf_point().first_lyapunov_coefficient < 0.0, hopf=hopf_point()
)


@computes("after-control")
def _(_: Evidence) -> Observation:
    speeds = (0.03, 0.1, 0.2, 0.3, 0.4, STUDIED_SPEED)
    found, slow = (
        [critical(speed, DAMPING, d).first_lyapunov_coefficient for speed in speeds]
        for d in (FILTER.corner_frequency, 0.2)
    )
    return Observation(
        max(*found, *slow) < 0.0,
        found=found,
        speeds=speeds,
        slow_least=min(slow),
        slow_most=max(slow),
    )


@computes("control-at-049")
def _(_: Evidence) -> Observation:
    here, taken = for_both(lambda damping: amplitudes(STUDIED_SPEED, damping))
    gains = replace(FILTER, linear_gain=PRINTED_GAIN / 2.0)
    left = controlled_amplitude(STUDIED_SPEED, gains, TAKEN_DAMPING)
    resting = expansion(STUDIED_SPEED, TAKEN_DAMPING, replace(FILTER, linear_gain=-0.05)).stable
    return Observation(
        bool(here) and left < here[0],
        bool(taken) and left < taken[0],
        outcome=f"{listed(here)} without filter" if here else "no vibration without filter",
        taken=taken,
        left=left,
        ending="rests" if resting else "vibrates",
    )


@computes("subcritical-controlled")
def _(_: Evidence) -> Observation:
    before = hopf_point().first_lyapunov_coefficient
    after = critical(STUDIED_SPEED, DAMPING).first_lyapunov_coefficient
    return Observation(
        before > 0.0 > after,
        before=before,
        after=after,
        effect="; the filter only brings sigma nearer to zero" if abs(after) < abs(before) else "",
    )


@computes("fig-13-amplitude")
def _(evidence: Evidence) -> Observation:
    linear, cubic, slow = (
        [amplitude(portrait) for portrait in panel.portraits]
        for panel in evidence.portraits(13).panels
    )
    ratios = [max(sizes) / min(filter(None, sizes)) for sizes in (linear, cubic, slow)]
    return Observation(min(ratios) > 1.1, ratios=ratios, linear=linear, cubic=cubic, slow=slow)


@computes("fig-13-vanish")
def _(evidence: Evidence) -> Observation:
    linear, cubic, _ = evidence.portraits(13).panels
    ends = linear.portraits[-1].measures.regime
    strongest = cubic.portraits[-1]
    vibrates = sum(portrait.vibrates for portrait in cubic.portraits)
    starts = ((3.0, 0.0), (-3.0, 0.0), (0.0, 3.0), (0.0, -3.0))
    resting = [_comes_to_rest(k1, x, y) for k1 in (-1.0, -10.0) for x, y in starts]
    return Observation(
        ends is Regime.EQUILIBRIUM and all(resting),
        ends=ends,
        last=linear.portraits[-1],
        critical=critical(0.4, DAMPING),
        resting=sum(resting),
        total=len(resting),
        vibrates=vibrates,
        portraits=len(cubic.portraits),
        strongest=strongest,
        left=amplitude(strongest),
    )


def _comes_to_rest(linear: float, position: float, speed: float) -> bool:
    drive = unit_drive(0.4)
    motion = Motion(drive, position, speed, replace(FILTER, linear_gain=linear, cubic_gain=0.0))
    motion.advance(3000.0)
    off = abs(motion.position - drive.equilibrium_position) + abs(motion.velocity)
    return off < 1e-3 * drive.belt_speed


@computes("fig-13-design")
def _(_: Evidence) -> Observation:
    needed, slow = critical(0.4, DAMPING).linear, critical(0.4, DAMPING, 0.2).linear
    gains = replace(FILTER, linear_gain=PRINTED_GAIN)
    here, taken = for_both(lambda damping: bool(expansion(0.4, damping, gains).stable))
    without, left = controlled_amplitude(0.4, FILTER), controlled_amplitude(0.4, gains)
    return Observation(
        here,
        taken,
        needed=needed,
        times=needed / PRINTED_GAIN,
        left=left,
        without=without,
        slow=slow,
    )


_SETTLING_TRACE = 0.02
"""Trace below which the motions of a bifurcation diagram have not settled yet."""


@computes("critical-speed-confirmed")
def _(evidence: Evidence) -> Observation:
    figures = [evidence.bifurcation(number) for number in (2, 3, 4, 5)]
    agree = [
        vibrates == (p > 0.0)
        for figure in figures
        for vibrates, drive in zip(figure.vibrating, figure.drives, strict=True)
        if drive.belt_speed > 0.0 and abs(p := trace_of(drive)) > _SETTLING_TRACE
    ]
    return Observation(
        all(agree), agreeing=sum(agree), total=len(agree), settling_trace=_SETTLING_TRACE
    )


@computes("curvature-confirmed")
def _(_: Evidence) -> Observation:
    sigma = hopf_point().first_lyapunov_coefficient
    distances = (2e-2, 2e-3, 2e-4)
    found, expected = zip(*map(_multipliers, distances), strict=True)
    # The share by which a deviation falls in one cycle.
    ratios = [(1.0 - a) / (1.0 - b) for a, b in zip(found, expected, strict=True)]
    return Observation(
        (sigma < 0.0) == (max(found) < 1.0)
        and falling([abs(ratio - 1.0) for ratio in ratios])
        and abs(ratios[-1] - 1.0) < 1e-2,
        sigma=sigma,
        found=found,
        distances=distances,
        expected=expected,
    )


def _multipliers(distance: float) -> tuple[float, float]:
    """Return the Floquet multiplier of the cycle at this distance below v_b1, and that of sigma."""
    speed = hopf_point().belt_speed - distance
    (cycle,) = cycles(speed)
    # Near the cycle of r' = alpha r + sigma r^3 a deviation grows by exp(-2 alpha T).
    alpha = float(expansion(speed).eigenvalues[0].real)
    return abs(cycle.multipliers[0]), float(np.exp(-2.0 * alpha * cycle.period))


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
        trace(0.4) > 0.0 and stable == [True, True, True, False],
        p=trace(0.4),
        changed=", ".join(f"{p:.4g} by {name}" for name, p in traces.items()),
    )


@computes("what-inhibits")
def _(evidence: Evidence) -> Observation:
    ends = [evidence.bifurcation(number) for number in (2, 3, 5)]
    slow = int(np.searchsorted(evidence.bifurcation(2).values, 1.0 / 3.0))
    quiet = [ends[0].measures[-1], ends[1].measures[-1], ends[2].measures[0]]
    loud = [ends[0].measures[slow], ends[1].measures[0], ends[2].measures[-1]]
    return Observation(
        all(measures.regime in CYCLES for measures in loud)
        and not any(measures.regime in CYCLES for measures in quiet),
        outcome=", ".join(str(measures.regime) for measures in quiet),
        speed=ends[0].drives[slow].belt_speed,
        loud=", ".join(str(measures.regime) for measures in loud),
    )


@computes("amplitude-reduced")
def _(evidence: Evidence) -> Observation:
    sizes = [[amplitude(p) for p in panel.portraits] for panel in evidence.portraits(13).panels]
    without = sizes[0][0]
    largest = max(sizes[0][1:])
    slower, high = (
        controlled_amplitude(speed, gains) / controlled_amplitude(speed, FILTER) - 1.0
        for speed, gains in (
            (0.1, replace(FILTER, linear_gain=0.9 * critical(0.1, DAMPING).linear)),
            (0.4, replace(FILTER, corner_frequency=20.0, linear_gain=-10.0)),
        )
    )
    return Observation(
        all(falling([without, *values]) for values in (sizes[0][1:], sizes[1], sizes[2])),
        sizes[0][-1] < without and falling([without, *sizes[1]]),
        without=without,
        controlled=sizes[0][1:],
        change=largest / without - 1.0,
        sizes=sizes,
        slower=slower,
        high=high,
    )


@computes("topology")
def _(evidence: Evidence) -> Observation:
    linear, cubic, slow = evidence.portraits(13).panels
    portraits = [*linear.portraits[1:], *cubic.portraits, *slow.portraits]
    vibrating = [portrait.vibrates for portrait in portraits]
    return Observation(
        not any(vibrating),
        not all(vibrating),
        resting=vibrating.count(False),
        total=len(vibrating),
        critical=critical(0.4, DAMPING),
        slower=critical(0.4, DAMPING, 0.2),
        count=vibrating.count(True),
    )


@computes("more-effective")
def _(_: Evidence) -> Observation:
    # A force k1 y on the speed itself adds to p and keeps the equilibrium too, since y = 0 there.
    plain = -trace(0.4)
    corners = (FILTER.corner_frequency, 0.2, 0.02)
    washout = [critical(0.4, DAMPING, d).linear for d in corners]
    return Observation(
        min(map(abs, washout)) < abs(plain),
        washout=washout,
        plain=plain,
        usual=washout[0] / plain,
        slower=washout[1] / plain,
        slowest=washout[2] / plain,
    )
