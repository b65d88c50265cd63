"""Section 4: the effect of the control, Fig. 12 and 13."""

from dataclasses import replace
from math import log

from stickslip_ros.paper.claims.claim import Computations, Evidence, Number, Observation
from stickslip_ros.paper.claims.paper_values import (
    DAMPING,
    FASTER,
    FILTER,
    PRINTED_GAIN,
    SLOWER,
    STUDIED_SPEED,
    TAKEN_DAMPING,
    TAKEN_FOR_DAMPING,
    VIBRATING,
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
)
from stickslip_ros.paper.figures import unit_drive
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.model.control import WashoutGains
from stickslip_ros.physics.motion import Motion
from stickslip_ros.physics.theory.hopf import hopf_points

computes = Computations()

_FIG_12_SPEEDS = (0.48, 0.49, 0.492)


computes["fig-12-place"] = lambda _: Number(
    hopf_point().belt_speed,
    remark="The Hopf speed for beta = 0.01 in eq. 5: the change there is the supercritical "
    f"Hopf point itself, which eq. 8 places at {hopf_point(TAKEN_DAMPING).belt_speed:.4f}.",
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
        listed(here),
        exponent < 0.1,
        remark="They fall to zero without a jump: amplitude squared over the distance to v_b1 is "
        f"{listed(squares)} at distances {listed(distances)}, and at the smallest the amplitude "
        f"varies with power {exponent:.3f} of it. Amplitudes of the limit cycles at v0 = "
        f"{listed(_FIG_12_SPEEDS)}; with the damping of eq. 8 {listed(taken)}.",
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
        f"p = {listed([trace(speed) for speed in speeds])}",
        here,
        taken,
        f"{TAKEN_FOR_DAMPING} p = {listed([trace(v, TAKEN_DAMPING) for v in speeds])}, up to v0 = "
        f"{hopf_point(TAKEN_DAMPING).belt_speed:.4f}. With that "
        f"of eq. 5 the motion at 0.49 decays slowly: amplitude {listed(left)} "
        f"after {listed(ends)}.",
    )


@computes("fig-12-exchange")
def _(_: Evidence) -> Observation:
    falling_speeds = (*sorted(_FIG_12_SPEEDS, reverse=True), 0.4, 0.1, 0.02)
    found = [cycles(speed, TAKEN_DAMPING) for speed in falling_speeds]
    resting = [bool(expansion(speed, TAKEN_DAMPING).stable) for speed in falling_speeds]
    multipliers = [abs(cycle.multipliers[0]) for here in found for cycle in here]
    above = expansion(hopf_point(TAKEN_DAMPING).belt_speed + 1e-3, TAKEN_DAMPING).stable
    return Observation(
        f"multipliers {listed(multipliers)}",
        multipliers[-1] > 1.0 and resting[-1],
        remark=f"At v0 = {listed(falling_speeds)} with the damping of eq. 8: the cycle is stable "
        f"and becomes more stable; {resting.count(False)} of the equilibria are unstable, while "
        f"above v_b1 it is {'stable' if above else 'unstable'}.",
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
        f"sigma = {listed(sigmas)}",
        max(sigmas) > 0.0 or bool(unstable),
        remark="For both dampings: supercritical, as in section 2. "
        f"{len(unstable)} of the {len(found)} limit cycles at v0 = {listed(speeds)} are unstable.",
    )


@computes("eq-18-cubic")
def _(evidence: Evidence) -> Observation:
    linear, cubic, _ = evidence.portraits(13).panels
    portraits = [linear.portraits[0], *cubic.portraits]
    sizes = [amplitude(portrait) for portrait in portraits]
    gains = [portrait.case.gains.cubic for portrait in portraits if portrait.case.gains]
    strong = (0.0, -100.0, -1000.0)
    loops = ((0.4, 2.0), (0.4, 0.2), (0.4, 20.0), (0.45, 2.0), (0.2, 2.0))
    left = {
        (v, d): [controlled_amplitude(v, replace(FILTER, corner_frequency=d, cubic=k2))
        for k2 in strong] for v, d in loops
    }  # fmt: skip
    shares = (
        f"{listed([size / found[0] for size in found[1:]])} at v0 = {v:g}, d = {d:g}"
        for (v, d), found in left.items()
    )
    return Observation(
        listed(sizes),
        falling(sizes) and all(map(falling, left.values())),
        falling(sizes) and falling(left[0.4, 2.0]),
        "Only if the filter passes the vibration and sticking does not fix its amplitude. At "
        f"v0 = 0.4, d = 2, k1 = 0, k2 = {listed(gains)}: k2 = {gains[-1]:g} reduces the "
        f"amplitude by {1.0 - sizes[-1] / sizes[0]:.0%}. With k2 = {listed(strong[1:])} the "
        f"remaining shares are {'; '.join(shares)}.",
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
        f"{taken:.4g} with the damping of eq. 8: the filter passes little of the speed and shifts "
        f"its phase. At v0 = {listed(speeds)} it is {'; '.join(others)}: the printed bound is that "
        "of a filter with d near zero, which passes the speed unchanged. "
        "For large vibrations this bound, the cubic coefficient of the friction, applies to any "
        "filter: above k2 = "
        f"{min(slow):.3f} to {max(slow):.3f} the motion diverges from X' = -30, above "
        f"{min(fast):.3f} to {max(fast):.3f} from X' = -900 (these v0, d = 0.2 to 20, k1 = 0).",
    )


def _largest_cubic_gain(belt_speed: float, corner_frequency: float, speed: float) -> float:
    """Return the cubic gain above which the motion with that initial speed diverges."""

    def stays(cubic: float) -> bool:
        gains = WashoutGains(corner_frequency, 0.0, cubic)
        motion = Motion(unit_drive(belt_speed), 0.0, speed, gains)
        motion.control_state = (0.0,)
        motion.advance(100.0)
        return not motion.unbounded

    return border(stays, 0.0, 2.0)


@computes("eq-30-hopf")
def _(_: Evidence) -> Observation:
    gains = replace(FILTER, linear=PRINTED_GAIN)
    here, taken = for_both(
        lambda damping: hopf_points(unit_drive(STUDIED_SPEED, damping=damping), gains)[-1]
    )
    directed = [p.supercritical and p.crossing_speed < 0.0 for p in (here, taken)]
    return Observation(
        f"v = {here.belt_speed:.5f}",
        directed[0] and abs(here.belt_speed - STUDIED_SPEED) < 1e-3,
        directed[1] and abs(taken.belt_speed - STUDIED_SPEED) < 1e-3,
        f"{TAKEN_FOR_DAMPING} v = {taken.belt_speed:.5f}; sigma = "
        f"{taken.first_lyapunov_coefficient:.4f}, so stable cycles start below it.",
    )


computes["before-control"] = lambda _: Observation(
    f"sigma = {hopf_point().first_lyapunov_coefficient:.6g}",
    hopf_point().first_lyapunov_coefficient < 0.0,
    remark="As in section 2; the same section 4.2 then calls it subcritical.",
)


@computes("after-control")
def _(_: Evidence) -> Observation:
    speeds = (0.03, 0.1, 0.2, 0.3, 0.4, STUDIED_SPEED)
    found, slow = (
        [critical(speed, DAMPING, d).first_lyapunov_coefficient for speed in speeds]
        for d in (FILTER.corner_frequency, 0.2)
    )
    return Observation(
        f"sigma = {listed(found)}",
        max(*found, *slow) < 0.0,
        remark=f"At v0 = {listed(speeds)} and their critical gains, d = 2, k2 = 0; "
        f"{min(slow):.4f} to {max(slow):.4f} with d = 0.2.",
    )


@computes("control-at-049")
def _(_: Evidence) -> Observation:
    here, taken = for_both(lambda damping: amplitudes(STUDIED_SPEED, damping))
    gains = replace(FILTER, linear=PRINTED_GAIN / 2.0)
    left = controlled_amplitude(STUDIED_SPEED, gains, TAKEN_DAMPING)
    resting = expansion(STUDIED_SPEED, TAKEN_DAMPING, replace(FILTER, linear=-0.05)).stable
    return Observation(
        f"{listed(here)} without filter" if here else "no vibration without filter",
        bool(here) and left < here[0],
        bool(taken) and left < taken[0],
        f"{TAKEN_FOR_DAMPING} the amplitude falls from {listed(taken)} to {left:.4g} with half the "
        f"critical gain; with k1 = -0.05 the slide {'rests' if resting else 'vibrates'}.",
    )


@computes("subcritical-controlled")
def _(_: Evidence) -> Observation:
    before = hopf_point().first_lyapunov_coefficient
    after = critical(STUDIED_SPEED, DAMPING).first_lyapunov_coefficient
    return Observation(
        f"sigma = {before:.4g} without, {after:.4g} with it",
        before > 0.0 > after,
        remark="There is none to remove; the filter only brings sigma nearer to zero."
        if abs(after) < abs(before)
        else "There is none to remove.",
    )


@computes("fig-13-amplitude")
def _(evidence: Evidence) -> Observation:
    linear, cubic, slow = (
        [amplitude(portrait) for portrait in panel.portraits]
        for panel in evidence.portraits(13).panels
    )
    ratios = [max(sizes) / min(filter(None, sizes)) for sizes in (linear, cubic, slow)]
    return Observation(
        f"by factors of {listed(ratios)}",
        min(ratios) > 1.1,
        remark=f"For the vibrating motions. Over k1 with d = 2: {listed(linear)}; over k2: "
        f"{listed(cubic)}; over k1 with d = 0.2: {listed(slow)}.",
    )


@computes("fig-13-vanish")
def _(evidence: Evidence) -> Observation:
    linear, cubic, _ = evidence.portraits(13).panels
    ends = linear.portraits[-1].measures.regime
    strongest = cubic.portraits[-1]
    vibrates = sum(portrait.measures.regime in VIBRATING for portrait in cubic.portraits)
    starts = ((3.0, 0.0), (-3.0, 0.0), (0.0, 3.0), (0.0, -3.0))
    resting = [_comes_to_rest(k1, x, y) for k1 in (-1.0, -10.0) for x, y in starts]
    return Observation(
        f"{ends} at {linear.portraits[-1].case.label}",
        ends is Regime.EQUILIBRIUM and all(resting),
        remark=f"k1 does, below {critical(0.4, DAMPING).linear:.4f}: with k1 = -1 and -10 the "
        f"slide settles at rest from {sum(resting)} of {len(resting)} starts up to 3 away. k2 "
        "alone cannot, because it does "
        f"not change the eigenvalues: {vibrates} of {len(cubic.portraits)} motions vibrate, with "
        f"k2 = {known(strongest.case.gains).cubic:g} at the amplitude {amplitude(strongest):.4f}.",
    )


def _comes_to_rest(linear: float, position: float, speed: float) -> bool:
    drive = unit_drive(0.4)
    motion = Motion(drive, position, speed, replace(FILTER, linear=linear, cubic=0.0))
    motion.advance(3000.0)
    off = abs(motion.position - drive.equilibrium_position) + abs(motion.velocity)
    return off < 1e-3 * drive.belt_speed


@computes("fig-13-design")
def _(_: Evidence) -> Observation:
    needed, slow = critical(0.4, DAMPING).linear, critical(0.4, DAMPING, 0.2).linear
    gains = replace(FILTER, linear=PRINTED_GAIN)
    here, taken = for_both(lambda damping: bool(expansion(0.4, damping, gains).stable))
    without, left = controlled_amplitude(0.4, FILTER), controlled_amplitude(0.4, gains)
    return Observation(
        f"k1 = {needed:.4f} is needed at v0 = 0.4",
        here,
        taken,
        f"That is {needed / PRINTED_GAIN:.0f} times the {PRINTED_GAIN:g} found for v0 = 0.49, "
        f"which leaves the amplitude {left:.4f} of {without:.4f}; with the "
        f"cutoff frequency d = 0.2 in place of 2, {slow:.4f} is sufficient.",
    )
