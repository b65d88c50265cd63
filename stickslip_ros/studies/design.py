"""Gains for a drive: those that damp it fastest within a force limit, tried out by simulation.

What is proposed comes from the linear sampled loop and from the vibration without control. It is
then tried on the drive itself, sampled, held and delayed as between the nodes.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from math import ceil, copysign, floor, inf, isinf, log10, sqrt
from typing import Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.loop.washout import WashoutParameters
from stickslip_ros.physics.measures.cycles import Regime
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.equations import SPEED, WashoutGains
from stickslip_ros.physics.theory.roots import zero_between
from stickslip_ros.physics.theory.sampled import (
    LinearSampledLoop,
    settling_time,
    why_no_linear_loop,
)
from stickslip_ros.progress import Progress
from stickslip_ros.scenarios.files import Scenario, parameter_file
from stickslip_ros.studies.hopf_distance import hopf_distance, hopf_ratio
from stickslip_ros.studies.trial import FILTER_SETTLED, Bench, Vibration

OWN_SPEED_RANGE = 0.1
"""Share of a scenario's belt speed by which the range goes below and above it by default."""

_SPEEDS, _PHASES = 5, 4
"""Belt speeds that are designed for and tried, and phases at which control comes on."""

_CORNER_FREQUENCIES = (0.02, 20.0)
"""Between which the best is looked for, in natural angular frequencies."""

_CUBIC_SHARES = (0.0, 0.125, 0.25, 0.5)
"""Cubic gains that are considered, in the friction law's own cubic coefficient.

With all of it the loop would escape to infinity from high speeds. A positive one softens the
control where the vibration is large, so that more linear gain fits under the force limit.
"""

_WORTH_IT = 1.05
"""Factor in decay rate for which a larger cubic gain is taken."""

_THROWN = (3.0, 30.0, 300.0)
"""Dimensionless speeds from which the slide is to come back."""

_ATTEMPTS, _RESERVE, _RETREAT = 8, 0.95, 0.8
"""How often a proposal is tried, what share of what is allowed the first one uses, and by what
factor the next one uses less."""

_LEAST_LIMIT, _LIMIT_SPACING = 1e-3, 1.015
"""Of the force limit that would do: where its search begins, in that without any limit, and up to
which ratio it goes on."""

_SLOWEST_DECAY = 0.01
"""In a natural period, of small deviations, with the force limit that would do: what decays more
slowly takes too long to be tried, and needs hardly less force."""

_LITTLE_GAIN, _LITTLE_DELAY, _LITTLE_SPEED = 1.1, 0.02, 1.05
"""What is next to no margin: a factor in the linear gain, a delay in natural periods, and a factor
from the Hopf speed."""

_SHARE_OF_VIBRATIONS = 0.1
"""Share of the work, about, that it is to find the vibrations without control."""

_COARSE, _FINE, _GRIDS, _ZOOM = (25, 41), (9, 9), 5, 0.3
"""Corner frequencies and gains of the first grid, and of the next ones that close in on the best;
how many grids in all, and the extent of each in that before."""


@dataclass(frozen=True)
class Task:
    """What gains are wanted for; SI units."""

    drive: Drive
    rate: float
    """Samples per second, Hz."""
    force_delay: float
    """From a sample to the start of its force, s."""
    force_limit: float
    """Largest force there may be, N."""
    belt_speeds: tuple[float, float]
    """Lowest and highest, m/s, above zero; the other direction mirrors them."""
    scenario: Scenario | None = field(default=None, compare=False, repr=False)
    """What sets the task, if a scenario does."""

    @classmethod
    def from_scenario(
        cls, scenario: Scenario, belt_speeds: tuple[float, float] | None = None
    ) -> Self:
        """Return the task that a scenario sets, by default within 10 % of its own belt speed.

        Raises InvalidInputError for speeds that are no range above zero.
        """
        plant = scenario.plant
        if belt_speeds is None:
            own = abs(plant.belt_speed)
            if own == 0.0:
                raise InvalidInputError(
                    "plant.belt_speed = 0: gains are for a moving belt, so its speeds must be given"
                )
            belt_speeds = (own * (1.0 - OWN_SPEED_RANGE), own * (1.0 + OWN_SPEED_RANGE))
        low, high = belt_speeds
        if not 0.0 < low <= high < inf:
            raise InvalidInputError(
                f"belt speeds {low:g} to {high:g} m/s: must be finite, above zero, the lower first"
            )
        limit = scenario.washout_controller.force_limit
        return cls(plant.as_drive(), plant.rate, plant.force_delay, limit, (low, high), scenario)

    def drives(self) -> list[Drive]:
        """Return the drive at speeds throughout the range."""
        low, high = self.belt_speeds
        speeds = np.linspace(low, high, _SPEEDS if low < high else 1)
        return [replace(self.drive, belt_speed=speed) for speed in speeds.tolist()]

    def shown(self, value: float, unit: str) -> str:
        """Return a value as remarks show it, without a unit where the drive is dimensionless."""
        return f"{value:.4g}" if self.drive.is_dimensionless else f"{value:.4g} {unit}"


@dataclass(frozen=True)
class Check:
    """What a proposal does at one belt speed, predicted and simulated; SI units."""

    belt_speed: float
    vibrates: bool
    """Whether there is a vibration without control, to be caught."""
    decay_rate: float
    """At which a small deviation dies out, 1/s."""
    predicted_settling_time: float
    """In which a small deviation falls to a hundredth, s."""
    settling_time: float | None
    """Simulated, until a hundredth of the vibration is left, at the worst phase; None without."""
    predicted_peak_force: float
    """When the control comes on at the worst phase of the vibration, N."""
    peak_force: float | None
    """Simulated, at the worst phase, N; None without vibration."""


@dataclass(frozen=True)
class Margins:
    """How far stable loops are from the instability of one of them: of all, the one next to it."""

    gain_down: float | None
    """Factor below one of the linear gain that makes one unstable; None: there is none."""
    gain_up: float | None
    """Factor above one that does; None: there is none."""
    delay: float | None
    """Further delay of the force that does, s; None: none within half a natural period, or as far
    as theory goes."""


@dataclass(frozen=True)
class Design:
    """Gains for a task, or why there are none."""

    task: Task
    controller: WashoutParameters | None = None
    """What is proposed; None if nothing does what is asked."""
    remark: str | None = None
    """Why there is no proposal, or what must be said of it."""
    slowest: LinearSampledLoop | None = None
    """The loop at the belt speed at which a small deviation dies out most slowly."""
    margins: Margins | None = None
    """Those of the loops of all speeds; None without control."""
    checks: tuple[Check, ...] = ()
    """In the order of the belt speeds."""

    @property
    def parameter_file(self) -> str | None:
        """The scenario of the task, complete, with what is proposed; without one its gains alone.

        Its belt speed is that of the scenario, or the one in the range that is next to it.
        """
        if self.controller is None:
            return None
        gains = asdict(self.controller)
        scenario = self.task.scenario
        if scenario is None:
            return parameter_file({"washout_controller": gains})
        (low, high), own = self.task.belt_speeds, scenario.plant.belt_speed
        proposed = {f"washout_controller.{name}": value for name, value in gains.items()}
        proposed["plant.belt_speed"] = copysign(min(max(abs(own), low), high), own)
        nodes = scenario.changed(proposed).as_dict()
        del nodes["analyzer"]["bag"]
        return parameter_file(nodes)


def design(task: Task, progress: Progress = lambda _: None) -> Design:
    """Return the gains that damp the slowest speed of the range fastest, and what they do.

    The force stays within the limit while the vibration is caught at any phase, the filter having
    forgotten its start. What fails in simulation is not proposed: the next attempt is more
    cautious, and after some the design says why there is none, and from which limit on there is.
    """
    drives = task.drives()
    reason = why_no_linear_loop(drives[0], task.rate, task.force_delay)
    if reason is not None:
        return Design(task, remark=reason)
    bench = Bench(drives[0], task.rate, task.force_delay)
    vibrations: list[Vibration] = []
    for number, drive in enumerate(drives, 1):
        vibrations.append(bench.vibration(drive))
        progress(_SHARE_OF_VIBRATIONS * number / len(drives))
        if vibrations[-1].regime is Regime.UNBOUNDED:
            reason = (
                "without control the motion runs away at a belt speed of "
                f"{task.shown(drive.belt_speed, 'm/s')}, so there is no limit cycle to catch it "
                "from"
            )
            return Design(task, remark=reason)
    candidates = _Candidates(task, vibrations)
    found = _propose(bench, candidates, progress)
    if found.controller is not None or isinf(task.force_limit):
        return found
    enough = _sufficient_limit(bench, candidates)
    if enough is None:
        return found
    remark = (
        f"{found.remark}; from a force limit of about {task.shown(enough, 'N')} on there is a "
        "proposal"
    )
    return replace(found, remark=remark)


def _propose(bench: Bench, candidates: "_Candidates", progress: Progress) -> Design:
    """Return a proposal that was tried out, or why there is none."""
    task, drives = candidates.task, candidates.task.drives()
    strength, shares = _RESERVE, _CUBIC_SHARES
    failure: str | None = None
    for attempt in range(_ATTEMPTS):
        gains = candidates.best(strength, shares)
        if gains is None:
            return Design(task, remark=failure or candidates.why_none())
        controller = _controller(task, gains)

        left = (1.0 - _SHARE_OF_VIBRATIONS) * 0.5**attempt

        def done(share: float, left: float = left) -> None:
            progress(1.0 - left * (1.0 - 0.5 * share))

        failure = None
        checks: list[Check] = []
        while failure is None and len(checks) < len(drives):
            checks.append(_check(bench, candidates, len(checks), controller))
            failure = _failure(task, checks[-1])
            done(0.5 * len(checks) / len(drives))
        slowest = candidates.slowest(gains)
        remark, found = candidates.why_zero(), None
        little: str | None = None
        if failure is None and gains.linear != 0.0:
            found = margins(candidates.loops, gains)
            little = _little_margin(task, found)
            ends = [drive for drive in drives if drive in (drives[0], drives[-1], slowest.drive)]
            remark, failure = _from_high_speeds(
                task, bench, ends, controller, lambda share: done(0.5 + 0.5 * share)
            )
        if failure is None:
            progress(1.0)
            remark = "; ".join(filter(None, (remark, little))) or None
            return Design(task, controller, remark, slowest, found, tuple(checks))
        peak = max((check.peak_force or 0.0 for check in checks), default=0.0)
        if peak > task.force_limit:
            strength *= 0.97 * task.force_limit / peak
        elif gains.cubic != 0.0:
            shares = _CUBIC_SHARES[:1]
        else:
            strength *= _RETREAT
    return Design(task, remark=failure)


def _sufficient_limit(bench: Bench, candidates: "_Candidates") -> float | None:
    """Return the lowest force limit (N) with which there is a proposal, to a few per cent.

    None where even a force without limit does not do.
    """

    def simulated(limit: float) -> Design:
        return _propose(bench, candidates.limited(limit), lambda _: None)

    def tried(limit: float) -> bool:
        return simulated(limit).controller is not None

    def in_theory(limit: float) -> bool:
        limited = candidates.limited(limit)
        gains = limited.best(_RESERVE, _CUBIC_SHARES)
        return gains is not None and limited.slowest(gains).decay_rate(gains) > slowest

    def narrowed(does: Callable[[float], bool], low: float, high: float) -> tuple[float, float]:
        low = max(low, _LEAST_LIMIT * high)
        while high > _LIMIT_SPACING * low:
            middle = sqrt(low * high)
            low, high = (low, middle) if does(middle) else (middle, high)
        return low, _rounded(high, up=True)

    slowest = _SLOWEST_DECAY / candidates.task.drive.natural_period
    limit = least = candidates.task.force_limit
    # To try one limit takes longer than to narrow it down in theory.
    enough = candidates.free_peak_force() / _RESERVE
    if enough > limit:
        least, enough = narrowed(in_theory, limit, enough)
        if tried(enough):
            return enough
    free = simulated(inf)
    enough = max((check.peak_force or 0.0 for check in free.checks), default=0.0) / _RESERVE
    if enough <= limit:
        return None
    _, enough = narrowed(tried, least, enough)
    return enough if tried(enough) else None


def _little_margin(task: Task, found: Margins) -> str | None:
    """Return what is to be said of loops that are next to instability; None where none is."""
    little: list[str] = []
    if found.gain_down is not None and found.gain_down > 1.0 / _LITTLE_GAIN:
        little.append(f"{found.gain_down:.3g} times the linear gain is unstable")
    if found.gain_up is not None and found.gain_up < _LITTLE_GAIN:
        little.append(f"{found.gain_up:.3g} times the linear gain is unstable")
    if found.delay is not None and found.delay < _LITTLE_DELAY * task.drive.natural_period:
        little.append(f"a further delay of {task.shown(found.delay, 's')} makes it unstable")
    return f"there is next to no margin: {', '.join(little)}" if little else None


def margins(loops: Sequence[LinearSampledLoop], gains: WashoutGains) -> Margins:
    """Return how far loops that are stable with these gains (SI units) are from instability."""
    factors = [
        end / gains.linear
        for loop in loops
        for interval in loop.stable_linear_gains(gains.corner_frequency)
        if interval.low < gains.linear < interval.high
        for end in interval
    ]
    delays = [delay for loop in loops if (delay := _delay_margin(loop, gains)) is not None]
    return Margins(
        gain_down=max((factor for factor in factors if 0.0 < factor < 1.0), default=None),
        gain_up=min((factor for factor in factors if factor > 1.0), default=None),
        delay=min(delays, default=None),
    )


def _delay_margin(loop: LinearSampledLoop, gains: WashoutGains) -> float | None:
    def decay_rate(further: float) -> float:
        return replace(loop, force_delay=loop.force_delay + further).decay_rate(gains)

    further = np.linspace(0.0, loop.drive.natural_period / 2.0, 33).tolist()
    for shorter, longer in pairwise(further):
        if why_no_linear_loop(loop.drive, loop.rate, loop.force_delay + longer) is not None:
            return None
        if decay_rate(longer) < 0.0:
            return zero_between(decay_rate, shorter, longer)
    return None


class _Candidates:
    """What theory says of gains: from the linear loops of the range, and the vibrations there."""

    def __init__(self, task: Task, vibrations: Sequence[Vibration]) -> None:
        self.vibrations = vibrations
        self.loops = [
            loop
            for vibration in vibrations
            if (loop := LinearSampledLoop.from_drive(vibration.drive, task.rate, task.force_delay))
        ]
        self.task = task
        # The loops differ in one number, the slope of the friction: those at its ends tell all.
        slopes = [float(loop.jacobian[SPEED, SPEED]) for loop in self.loops]
        ends = sorted({int(np.argmin(slopes)), int(np.argmax(slopes))})
        self._extremes = [self.loops[index].coarsened() for index in ends]
        # Twice what brings the slide to rest without overshoot: beyond it nothing is won.
        unit = task.drive.normal_force / task.drive.speed_scale
        self._largest_gain = (4.0 + 2.0 * max(map(abs, slopes))) * unit
        self._cubic_coefficient = _cubic_coefficient(task.drive)
        self._peaks: dict[float, float] = {}

    def limited(self, force_limit: float) -> Self:
        """Return those for another force limit, N."""
        other = copy(self)
        other.task = replace(self.task, force_limit=force_limit)
        return other

    def free_peak_force(self) -> float:
        """Return the largest force, N, of the fastest gains without limit; 0 if none is stable."""
        gains = self.limited(inf).best(_RESERVE, _CUBIC_SHARES)
        if gains is None:
            return 0.0
        return max(vibration.peak_force(gains) for vibration in self.vibrations)

    def slowest(self, gains: WashoutGains) -> LinearSampledLoop:
        """Return the loop in which a small deviation dies out most slowly."""
        return min(self.loops, key=lambda loop: loop.decay_rate(gains))

    def best(self, strength: float, cubic_shares: Sequence[float]) -> WashoutGains | None:
        """Return the gains that damp fastest with the share `strength` of what is allowed.

        They have three digits, and are zero if nothing vibrates. None if none is stable.
        """
        if not any(vibration.vibrates for vibration in self.vibrations):
            none = WashoutGains(_rounded(self.task.drive.angular_frequency), 0.0, 0.0)
            if self.slowest(none).decay_rate(none) > 0.0:
                return none
        best, fastest = None, 0.0
        for share in cubic_shares:
            cubic = share * self._cubic_coefficient
            if share > 0.0 and (cubic == 0.0 or isinf(self.task.force_limit)):
                break
            gains = self._fastest(strength, cubic)
            decay_rate = self.slowest(gains).decay_rate(gains)
            if decay_rate > fastest * _WORTH_IT:
                best, fastest = gains, decay_rate
        return best

    def why_zero(self) -> str:
        """Return why zero gains may be proposed."""
        if any(vibration.vibrates for vibration in self.vibrations):
            return "no gains within the force limit damp faster than none"
        distances = {
            abs(log10(ratio)): hopf_distance(vibration.drive)
            for vibration in self.vibrations
            if (ratio := hopf_ratio(vibration.drive)) is not None
        }
        said = ["nothing vibrates without control at these belt speeds: the gains are zero"]
        if distances:
            nearest = min(distances)
            little = ", with next to no margin" if nearest < log10(_LITTLE_SPEED) else ""
            said.append(distances[nearest] + little)
        return "; ".join(said)

    def why_none(self) -> str:
        """Return why no gains are stable at all speeds within the force limit."""
        frequencies = self._corner_frequencies(17).tolist()
        if not any(map(self._can_be_stable, frequencies)):
            return (
                "no linear gain makes the equilibrium stable at all these belt speeds, at this "
                "rate and delay"
            )
        return (
            f"the force limit of {self.task.shown(self.task.force_limit, 'N')} is too small for "
            "gains that make the equilibrium stable at all these belt speeds and catch the "
            "vibration"
        )

    def _can_be_stable(self, corner_frequency: float) -> bool:
        """Return whether some linear gain is stable at all speeds."""
        sets = [loop.stable_linear_gains(corner_frequency) for loop in self._extremes]
        return any(
            max(one.low, other.low) < min(one.high, other.high)
            for one in sets[0]
            for other in sets[-1]
        )

    def _fastest(self, strength: float, cubic: float) -> WashoutGains:
        """Return the fastest gains: the best of a grid that closes in on them."""
        # A softening cubic gain is one beside a negative linear gain.
        limits = np.array(
            [np.log(self._corner_frequencies(2)), [-1.0, 0.0 if cubic > 0.0 else 1.0]]
        )
        window, counts = limits, _COARSE
        best = WashoutGains(0.0, 0.0, 0.0)
        for _ in range(_GRIDS):
            logarithms, shares = (
                np.linspace(low, high, count)
                for (low, high), count in zip(window, counts, strict=True)
            )
            corners = np.exp(logarithms)
            largest = [self._largest(corner, strength, cubic) for corner in corners.tolist()]
            gains = np.outer(largest, shares)
            rates = np.min([loop.decay_rates(corners, gains) for loop in self._extremes], axis=0)
            row, column = np.unravel_index(int(np.argmax(rates)), rates.shape)
            best = WashoutGains(*map(_rounded, (corners[row], gains[row, column], cubic)))
            centre = np.array([[logarithms[row]], [shares[column]]])
            reach = _ZOOM / 2.0 * (window[:, 1:] - window[:, :1])
            window = np.clip(centre + reach * [-1.0, 1.0], limits[:, :1], limits[:, 1:])
            counts = _FINE
        return best

    def _corner_frequencies(self, count: int) -> FloatArray:
        """Return corner frequencies (rad/s), up to the rate: a faster filter passes nothing on."""
        omega = self.task.drive.angular_frequency
        low, high = (share * omega for share in _CORNER_FREQUENCIES)
        return np.geomspace(low, max(min(high, self.task.rate), 2.0 * low), count)

    def _peak(self, corner_frequency: float) -> float:
        """Return the largest filtered speed, m/s, of all vibrations."""
        if corner_frequency not in self._peaks:
            self._peaks[corner_frequency] = max(
                float(np.abs(vibration.filtered(corner_frequency)).max(initial=0.0))
                for vibration in self.vibrations
            )
        return self._peaks[corner_frequency]

    def _largest(self, corner_frequency: float, strength: float, cubic: float) -> float:
        """Return the magnitude of the linear gain that is allowed.

        With a softening cubic gain the force k v - k2 v^3 may be largest short of the peak.
        """
        peak, limit = self._peak(corner_frequency), strength * self.task.force_limit
        gain = limit / peak + cubic * peak**2 if peak > 0.0 else inf
        if gain < 3.0 * cubic * peak**2:
            gain = (6.75 * cubic * limit**2) ** (1.0 / 3.0)
        return min(gain, strength * self._largest_gain)


def _controller(task: Task, gains: WashoutGains) -> WashoutParameters:
    waits = FILTER_SETTLED / gains.corner_frequency if gains.linear != 0.0 else 0.0
    return WashoutParameters(
        corner_frequency=gains.corner_frequency,
        linear_gain=gains.linear,
        cubic_gain=gains.cubic,
        force_limit=task.force_limit,
        start_after=_rounded(waits, digits=2, up=True),
    )


def _check(
    bench: Bench, candidates: _Candidates, index: int, controller: WashoutParameters
) -> Check:
    """Return what the controller does at one of the speeds."""
    loop, vibration = candidates.loops[index], candidates.vibrations[index]
    gains = controller.gains
    decay_rate = loop.decay_rate(gains)
    predicted = settling_time(decay_rate)
    assert predicted is not None
    settling_times: list[float | None] = []
    peaks: list[float] = []
    if vibration.vibrates:
        patience = 5.0 * predicted + 20.0 * loop.drive.natural_period
        for outcome in bench.catch(vibration, controller, _PHASES, patience):
            settling_times.append(outcome.settling_time)
            peaks.append(outcome.peak_force)
            if outcome.settling_time is None:
                break
    settled = [time for time in settling_times if time is not None]
    return Check(
        belt_speed=loop.drive.belt_speed,
        vibrates=vibration.vibrates,
        decay_rate=decay_rate,
        predicted_settling_time=predicted,
        settling_time=max(settled) if settled and len(settled) == len(settling_times) else None,
        predicted_peak_force=vibration.peak_force(gains),
        peak_force=max(peaks, default=None),
    )


def _failure(task: Task, check: Check) -> str | None:
    """Return in what the simulated control fails, if it does."""
    speed = f"at a belt speed of {task.shown(check.belt_speed, 'm/s')}"
    if check.vibrates and check.settling_time is None:
        return f"{speed} the vibration does not die out, though a small one would"
    if check.peak_force is not None and check.peak_force > task.force_limit:
        return (
            f"{speed} the force reaches {task.shown(check.peak_force, 'N')}, above the limit of "
            f"{task.shown(task.force_limit, 'N')}"
        )
    return None


def _from_high_speeds(
    task: Task,
    bench: Bench,
    drives: Sequence[Drive],
    controller: WashoutParameters,
    done: Progress,
) -> tuple[str | None, str | None]:
    """Return what is to be said of motions that begin fast, and in what the controller fails."""

    def escapes(drive: Drive, speed: float, controller: WashoutParameters) -> bool:
        patience = 20.0 * drive.natural_period
        return any(outcome.grows for outcome in bench.throw(drive, controller, speed, patience))

    remark: str | None = None
    unlimited = replace(controller, force_limit=inf)
    throws = [(drive, share * drive.speed_scale) for drive in drives for share in _THROWN]
    for number, (drive, speed) in enumerate(throws, 1):
        if escapes(drive, speed, controller):
            slide = (
                f"thrown to {task.shown(speed, 'm/s')} off a belt at "
                f"{task.shown(drive.belt_speed, 'm/s')} the slide"
            )
            if controller.cubic_gain != 0.0 or escapes(drive, speed, unlimited):
                return None, f"{slide} does not come back"
            remark = remark or f"{slide} needs more force than the limit"
        done(number / len(throws))
    return remark, None


def _cubic_coefficient(drive: Drive) -> float:
    """Return by what the friction force falls with the cube of high speeds, N s^3/m^3, or zero."""
    law, high = drive.friction.scaled(drive.speed_scale), 1e6
    coefficient = -float(law.coefficient(high, 1.0)) / high**3
    return coefficient * drive.normal_force / drive.speed_scale**3 if coefficient > 1e-6 else 0.0


def _rounded(value: float, digits: int = 3, *, up: bool = False) -> float:
    """Return a value with so many significant digits, `up` or to the nearest."""
    if value == 0.0:
        return 0.0
    if up:
        unit = 10.0 ** (floor(log10(value)) + 1 - digits)
        value = ceil(value / unit) * unit
    return float(f"{value:.{digits}g}")
