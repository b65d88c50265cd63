"""Sections 4 and 5 and the abstract: the effect of the control, Fig. 12 and 13, and all in all."""

from dataclasses import replace
from math import log

import numpy as np

from reproduction.claims.paper_values import (
    DAMPING,
    FASTER,
    FILTER,
    OPEN,
    PRINTED_GAIN,
    SLOWER,
    STUDIED_SPEED,
    TAKEN,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    Loop,
    at,
    border,
    critical,
    falling,
    for_both,
    known,
    listed,
)
from reproduction.claims.verdict import Computations, Evidence, Number, Observation
from reproduction.figures import STRIBECK, Portraits, unit_drive
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.control import Washout
from stickslip_ros.motion import Motion
from stickslip_ros.studies.settling import CYCLES

computes = Computations()

_FIG_12_SPEEDS = (0.48, 0.49, 0.492)


computes["fig-12-place"] = lambda _: Number(OPEN.hopf.belt_speed)


@computes("fig-12-sudden")
@computes("jump")
def _(_: Evidence) -> Observation:
    """Observe whether the amplitude jumps below the Hopf point."""
    distances = (4e-2, 4e-3, 4e-4, 4e-5)
    sizes = [at(OPEN.hopf.belt_speed - distance).amplitudes[0] for distance in distances]
    exponent = log(sizes[-2] / sizes[-1]) / log(distances[-2] / distances[-1])
    here, taken = for_both(
        lambda damping: [(at(v, damping).amplitudes or [0.0])[0] for v in _FIG_12_SPEEDS]
    )
    return Observation(
        exponent < 0.1,
        here=here,
        squares=[size**2 / distance for size, distance in zip(sizes, distances, strict=True)],
        distances=distances,
        exponent=exponent,
        fig_12_speeds=_FIG_12_SPEEDS,
        taken=taken,
    )


@computes("fig-12-unstable")
def _(evidence: Evidence) -> Observation:
    loops = for_both(lambda damping: [at(speed, damping) for speed in _FIG_12_SPEEDS[1:]])
    unstable = [not any(loop.stable for loop in each) for each in loops]
    here, taken = ([loop.trace for loop in each] for each in loops)
    portraits = [
        p for p in evidence.portraits(12).portraits
        if p.drive.belt_speed == STUDIED_SPEED and p.drive.damping == DAMPING
    ]  # fmt: skip
    left = [p.measures.amplitude or 0.0 for p in portraits]
    ends = [float(p.trajectory.time[-1]) for p in portraits]
    return Observation(*unstable, here=here, taken=taken, left=left, ends=ends)


@computes("fig-12-exchange")
def _(_: Evidence) -> Observation:
    falling_speeds = (*sorted(_FIG_12_SPEEDS, reverse=True), 0.4, 0.1, 0.02)
    loops = [at(speed, TAKEN_DAMPING) for speed in falling_speeds]
    multipliers = [multiplier for loop in loops for multiplier in loop.multipliers]
    above = at(TAKEN.hopf.belt_speed + 1e-3, TAKEN_DAMPING).stable
    return Observation(
        multipliers[-1] > 1.0 and loops[-1].stable,
        multipliers=multipliers,
        falling_speeds=falling_speeds,
        vibrating=sum(not loop.stable for loop in loops),
        above="stable" if above else "unstable",
    )


@computes("fig-12-subcritical")
@computes("jump-subcritical")
def _(_: Evidence) -> Observation:
    """Observe whether unstable cycles surround a stable equilibrium anywhere nearby."""
    sigmas = [loop.hopf.first_lyapunov_coefficient for loop in (OPEN, TAKEN)]
    speeds = (*SLOWER, 0.2, 0.4, 0.48, 0.488, STUDIED_SPEED, 0.492, 0.5, *FASTER)
    found = [cycle for speed in speeds for cycle in at(speed).cycles]
    unstable = sum(not cycle.stable for cycle in found)
    return Observation(
        max(sigmas) > 0.0 or unstable > 0,
        sigmas=sigmas,
        total=unstable,
        count=len(found),
        speeds=speeds,
    )


@computes("eq-18-cubic")
def _(evidence: Evidence) -> Observation:
    linear, cubic, _ = (panel.portraits for panel in evidence.portraits(13).panels)
    portraits = Portraits([linear[0], *cubic])
    sizes = portraits.amplitudes
    gains = [portrait.case.gains.cubic_gain for portrait in portraits if portrait.case.gains]
    strong = (0.0, -100.0, -1000.0)
    loops = ((0.4, 2.0), (0.4, 0.2), (0.4, 20.0), (0.45, 2.0), (0.2, 2.0))
    left = [[at(v, gains=Washout(d, 0.0, k2)).final_amplitude for k2 in strong] for v, d in loops]
    shares = (
        f"{listed([size / found[0] for size in found[1:]])} at v0 = {v:g}, d = {d:g}"
        for (v, d), found in zip(loops, left, strict=True)
    )
    return Observation(
        falling(sizes) and all(map(falling, left)),
        falling(sizes) and falling(left[0]),
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
        sorted(_largest_cubic_gain(v, d, start) for v in speeds for d in (0.2, 2.0, 20.0))
        for start in (-30.0, -900.0)
    )
    return Number(
        here,
        {TAKEN_FOR_DAMPING: taken},
        taken=taken,
        speeds=speeds,
        others="; ".join(others),
        slow=(slow[0], slow[-1]),
        fast=(fast[0], fast[-1]),
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
    points = for_both(lambda damping: at(STUDIED_SPEED, damping, gains).hopf)
    directed = [
        p.supercritical and p.crossing_speed < 0.0 and abs(p.belt_speed - STUDIED_SPEED) < 1e-3
        for p in points
    ]
    return Observation(*directed, here=points[0], taken=points[1])


computes["before-control"] = lambda _: Observation(OPEN.hopf.supercritical)


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
    here, taken = for_both(lambda damping: at(STUDIED_SPEED, damping).amplitudes)
    half, more = (
        at(STUDIED_SPEED, TAKEN_DAMPING, replace(FILTER, linear_gain=gain))
        for gain in (PRINTED_GAIN / 2.0, -0.05)
    )
    left = half.final_amplitude
    return Observation(
        bool(here) and left < here[0],
        bool(taken) and left < taken[0],
        outcome=f"{listed(here)} without filter" if here else "no vibration without filter",
        taken=taken,
        left=left,
        ending="rests" if more.stable else "vibrates",
    )


@computes("subcritical-controlled")
def _(_: Evidence) -> Observation:
    before = OPEN.hopf.first_lyapunov_coefficient
    after = critical(STUDIED_SPEED).first_lyapunov_coefficient
    effect = "; the filter only brings sigma nearer to zero" if abs(after) < abs(before) else ""
    return Observation(before > 0.0 > after, after=after, effect=effect)


@computes("fig-13-amplitude")
def _(evidence: Evidence) -> Observation:
    sizes = [panel.portraits.amplitudes for panel in evidence.portraits(13).panels]
    ratios = [max(each) / min(filter(None, each)) for each in sizes]
    return Observation(min(ratios) > 1.1, ratios=ratios, sizes=sizes)


@computes("fig-13-vanish")
def _(evidence: Evidence) -> Observation:
    linear, cubic, _ = (panel.portraits for panel in evidence.portraits(13).panels)
    starts = ((3.0, 0.0), (-3.0, 0.0), (0.0, 3.0), (0.0, -3.0))
    resting = [_comes_to_rest(k1, x, y) for k1 in (-1.0, -10.0) for x, y in starts]
    return Observation(
        linear[-1].measures.regime is Regime.EQUILIBRIUM and all(resting),
        last=linear[-1],
        critical=critical(0.4),
        resting=sum(resting),
        total=len(resting),
        vibrates=sum(portrait.vibrates for portrait in cubic),
        portraits=len(cubic),
        strongest=cubic[-1],
    )


def _comes_to_rest(linear: float, position: float, speed: float) -> bool:
    drive = unit_drive(0.4)
    motion = Motion(drive, position, speed, replace(FILTER, linear_gain=linear, cubic_gain=0.0))
    motion.advance(3000.0)
    off = abs(motion.position - drive.equilibrium_position) + abs(motion.velocity)
    return off < 1e-3 * drive.belt_speed


@computes("fig-13-design")
def _(_: Evidence) -> Observation:
    needed, gains = critical(0.4).linear, replace(FILTER, linear_gain=PRINTED_GAIN)
    stable = for_both(lambda damping: at(0.4, damping, gains).stable)
    return Observation(
        *stable,
        needed=needed,
        times=needed / PRINTED_GAIN,
        left=at(0.4, gains=gains),
        without=at(0.4, gains=FILTER),
        slow=critical(0.4, DAMPING, 0.2),
    )


_SETTLING_TRACE = 0.02
"""Trace below which the motions of a bifurcation diagram have not settled yet."""


@computes("critical-speed-confirmed")
def _(evidence: Evidence) -> Observation:
    figures = [evidence.bifurcation(number) for number in (2, 3, 4, 5)]
    agree = [
        vibrates == (p > 0.0)
        for figure in figures
        for vibrates, drive in zip(figure.vibrating.tolist(), figure.drives, strict=True)
        if drive.belt_speed > 0.0 and abs(p := Loop(drive).trace) > _SETTLING_TRACE
    ]
    return Observation(
        all(agree), agreeing=sum(agree), total=len(agree), settling_trace=_SETTLING_TRACE
    )


@computes("curvature-confirmed")
def _(_: Evidence) -> Observation:
    distances = (2e-2, 2e-3, 2e-4)
    loops = [at(OPEN.hopf.belt_speed - distance) for distance in distances]
    found = [loop.multipliers[0] for loop in loops]
    # Near the cycle of r' = alpha r + sigma r^3 a deviation grows by exp(-2 alpha T).
    growths = [float(loop.eigenvalues[0].real) * loop.cycles[0].period for loop in loops]
    expected = np.exp(-2.0 * np.array(growths)).tolist()
    # The share by which a deviation falls in one cycle.
    ratios = [(1.0 - a) / (1.0 - b) for a, b in zip(found, expected, strict=True)]
    return Observation(
        OPEN.hopf.supercritical == (max(found) < 1.0)
        and falling([abs(ratio - 1.0) for ratio in ratios])
        and abs(ratios[-1] - 1.0) < 1e-2,
        found=found,
        distances=distances,
        expected=expected,
    )


@computes("main-factors")
def _(_: Evidence) -> Observation:
    changed = {
        "feed speed 0.6": at(0.6),
        "beta 0.1": at(0.4, 0.2),
        "mu_m 0.39": at(0.4, friction=replace(STRIBECK, minimum=0.39)),
        "stiffness 50": at(0.4, stiffness=50.0),
    }
    stable = [loop.trace < 0.0 for loop in changed.values()]
    return Observation(
        at(0.4).trace > 0.0 and stable == [True, True, True, False],
        base=at(0.4),
        changed=", ".join(f"{loop.trace:.4g} by {name}" for name, loop in changed.items()),
    )


@computes("what-inhibits")
def _(evidence: Evidence) -> Observation:
    speeds, dampings, ratios = (evidence.bifurcation(number) for number in (2, 3, 5))
    slow = int(np.searchsorted(speeds.values, 1.0 / 3.0))
    quiet = [speeds.columns.regime[-1], dampings.columns.regime[-1], ratios.columns.regime[0]]
    loud = [speeds.columns.regime[slow], dampings.columns.regime[0], ratios.columns.regime[-1]]
    return Observation(
        all(regime in CYCLES for regime in loud) and not any(regime in CYCLES for regime in quiet),
        quiet=quiet,
        speed=float(speeds.values[slow]),
        loud=loud,
    )


@computes("amplitude-reduced")
def _(evidence: Evidence) -> Observation:
    linear, cubic, slow = (p.portraits.amplitudes for p in evidence.portraits(13).panels)
    without, *controlled = linear
    slower, high = (
        at(speed, gains=gains).final_amplitude / at(speed, gains=FILTER).final_amplitude - 1.0
        for speed, gains in (
            (0.1, replace(FILTER, linear_gain=0.9 * critical(0.1).linear)),
            (0.4, replace(FILTER, corner_frequency=20.0, linear_gain=-10.0)),
        )
    )
    return Observation(
        all(falling([without, *sizes]) for sizes in (controlled, cubic, slow)),
        controlled[-1] < without and falling([without, *cubic]),
        without=without,
        controlled=controlled,
        change=max(controlled) / without - 1.0,
        cubic=cubic,
        slow=slow,
        slower=slower,
        high=high,
    )


@computes("topology")
def _(evidence: Evidence) -> Observation:
    vibrating = [portrait.vibrates for portrait in evidence.portraits(13).portraits[1:]]
    return Observation(
        not any(vibrating),
        not all(vibrating),
        resting=vibrating.count(False),
        total=len(vibrating),
        critical=critical(0.4),
        slower=critical(0.4, DAMPING, 0.2),
        count=vibrating.count(True),
    )


@computes("more-effective")
def _(_: Evidence) -> Observation:
    # A force k1 y on the speed itself adds to p and keeps the equilibrium too, since y = 0 there.
    plain = -at(0.4).trace
    corners = (FILTER.corner_frequency, 0.2, 0.02)
    washout = [critical(0.4, DAMPING, d).linear for d in corners]
    ratios = [gain / plain for gain in washout]
    return Observation(
        min(map(abs, washout)) < abs(plain), washout=washout, plain=plain, ratios=ratios
    )
