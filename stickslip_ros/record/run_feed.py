"""Feed a meter with a part of a recorded run, and report what it measures."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from pathlib import Path
from sys import float_info
from typing import Any

import numpy as np

from stickslip_ros.arrays import BoolArray, IntArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import UNBOUNDED_BELT_SPEEDS, Regime
from stickslip_ros.measures.feed import last_feed, moving_part, relative_to_feed
from stickslip_ros.measures.following import Followed, followed
from stickslip_ros.measures.noise import FEWEST_SAMPLES
from stickslip_ros.measures.run_meter import RunAnalysis, RunMeter, RunObserver
from stickslip_ros.measures.run_report import report_of
from stickslip_ros.measures.sample_assumptions import SampleAssumptions
from stickslip_ros.measures.slips import SlipThreshold, slip_report, slips_in
from stickslip_ros.record.reader import RunBlock
from stickslip_ros.record.table_clock import LONGEST
from stickslip_ros.samples import ForceColumns, ReferenceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import quantity

_LEAST_STEPS, _LEAST_SAMPLES = 5.0, 15.0
"""Steps of the encoder in the amplitude, and samples per cycle, below which a stick may hide."""
_NOISES = 6.0
"""Least drop of a slip, in standard deviations of the noise, that is not noise."""
_MOST_EARLY = 1_000_000
"""Forces that wait for a joint state, from which these count from the first of them."""

Take = Callable[[SampleColumns | ForceColumns], None]


@dataclass(frozen=True)
class RunPart:
    """A part of a run between two instants, s from its beginning; the second is excluded."""

    start: float = 0.0
    """0 includes everything from the beginning."""
    end: float = inf

    def __post_init__(self) -> None:
        if not self.start < self.end:
            raise InvalidInputError(f"the part from {self.start} s to {self.end} s is empty")

    def __str__(self) -> str:
        before = "" if self.end == inf else f" and before {self.end:g} s"
        return f"from {self.start:g} s on{before}"

    def rows(self, stamp: IntArray, first: int) -> BoolArray:
        """Return which stamps, ns, are within the part of a run that begins at the first stamp."""
        start, end = (
            round(min(instant, LONGEST) * NANOSECONDS)
            for instant in (self.start if self.start > 0.0 else -LONGEST, self.end)
        )
        since = stamp - first
        return (since >= start) & (since < end)


class RunFeed:
    """Feeds a meter with a part of a run, block by block."""

    def __init__(
        self,
        meter: RunMeter,
        part: RunPart,
        observer: RunObserver | None,
        take: Take,
        slips: SlipThreshold | None,
        references: ReferenceColumns,
    ) -> None:
        self._meter, self._part = meter, part
        self._observer, self._take = observer, take
        self._slips = None if slips is None else _SlipSearch(slips)
        self.first: int | None = None
        """Stamp from which the instants count, ns, once it is known."""
        self.has_states = False
        """Whether there is a joint state."""
        self._other_machine = False
        self._feed_speed = 0.0
        self._notes: list[str] = []
        self._measured = 0
        self._references = references[np.argsort(references.stamp, kind="stable")]
        self._followers: list[SampleColumns] = []
        self._early: list[tuple[ForceColumns, ForceColumns]] = []

    def feed(self, block: RunBlock) -> None:
        """Measure a block; one of another machine is the whole run."""
        motion, (states, forces, dropped) = self._meter.motion, block[:3]
        if block.velocity_estimated and motion.reading.noisy is None:
            motion.reading = SampleAssumptions(noisy=True)
        self._other_machine = block.of_another_machine
        if len(states) > 0:
            self.has_states = True
            first = self._begin(int(states.stamp[0])) if self.first is None else self.first
            self._feed_states(states[self._part.rows(states.stamp, first)], first)
        if self.first is None:
            self._early.append((forces, dropped))
            if sum(len(early) for early, _ in self._early) > _MOST_EARLY:  # limits the memory
                self._begin_without_states()
        else:
            self._feed_forces(forces, dropped, self.first)

    def finish(self) -> None:
        """Measure what is still pending: the last forces, or all if there is no joint state."""
        self._begin_without_states()
        self._meter.finish()

    def report(self, path: Path, length: str) -> dict[str, Any]:
        """Return the measures and counts, and the slips if they were looked for."""
        if self._measured == 0:
            raise InvalidInputError(f"{path} holds no samples {self._part}")
        measured, slips = self._meter.motion.measured(length), None
        self._meter.followed = self._followed(length)
        report = report_of(self._meter, measured)
        notes = [*self._notes, *report["notes"]]
        if self._feed_speed:
            feed = quantity(self._feed_speed, length and f"{length}/s")
            advance = quantity(abs(self._feed_speed) * (report["period"] or 0.0), length)
            notes.append(
                f"the slide advances at {feed} on a guide at rest: the measures "
                f"are those of its position less this feed, {advance} in a cycle"
            )
        if self._other_machine and (doubt := self._doubt(report, length)):
            report = {**report, "regime": None, "stick_fraction": None}
            notes.append(doubt)
        if self._other_machine and report["regime"] == Regime.UNBOUNDED:
            notes.append(
                f"the slide is {UNBOUNDED_BELT_SPEEDS:g} times as fast as the belt, or faster: it "
                "diverges, or one of them is in another unit"
            )
        if report["stick_fraction"] is None and report["regime"] == Regime.STICK_SLIP:
            notes.append(
                "the stick fraction is not known: its error needs three whole cycles, and there "
                f"are {report['cycles']}"
            )
        if self._slips is not None:
            slips, slip_notes = self._slips.report(report["position_noise"], length)
            notes += slip_notes
        if self._observer is not None:
            self._observer.take_analysis(
                RunAnalysis(measured.mean_cycle, slips, self._meter.followed)
            )
        return {**report, "notes": notes, "slips": slips}

    def _followed(self, length: str) -> Followed | None:
        """Return how the slide follows the newest reference at each sample; None without any."""
        if not self._followers or self.first is None:
            return None
        stamp = np.concatenate([part.stamp for part in self._followers])
        newest = np.searchsorted(self._references.stamp, stamp, "right") - 1
        reference = np.where(newest < 0, np.nan, self._references.position[newest])
        position = np.concatenate([part.position for part in self._followers])
        return followed((stamp - self.first) / NANOSECONDS, reference, position, length)

    def _doubt(self, report: dict[str, Any], length: str) -> str | None:
        """Return why the regime of another machine is not known."""
        motion = self._meter.motion
        guide = motion.other_guide
        if guide is not None and report["regime"] in (None, Regime.PURE_SLIP, Regime.STICK_SLIP):
            velocity, share = guide
            unit = length and f"{length}/s"
            speed = f"a velocity of {quantity(velocity, unit)}" if velocity else "rest"
            return (
                f"relative to a guide at {speed} the slide rests {share:.0%} of the time, and "
                "relative to the belt it does not: with this belt velocity the regime is known"
            )
        unknown = report["regime"] is None and report["period"] is None and not motion.mixed
        if unknown and motion.samples >= FEWEST_SAMPLES:
            return (
                "the regime is not known: up to the end the slide neither stands, nor slides "
                "steadily, nor repeats one vibration"
            )
        if report["regime"] != Regime.PURE_SLIP:
            return None
        steps = report["amplitude"] / (motion.step or float_info.min)
        samples = report["period"] / report["duration"] * report["samples"]
        few = f"{steps:.2g} steps of the encoder in the amplitude" * (steps < _LEAST_STEPS)
        few = few or f"{samples:.2g} samples per cycle" * (samples < _LEAST_SAMPLES)
        return few and f"the regime is not known: {few} do not tell whether it sticks"

    def _moving_part(self, part: SampleColumns, first: int) -> SampleColumns:
        """Return the samples of the last feed, without the standstills before and after them."""
        rows = moving_part(part)
        other = last_feed(part[rows])
        moving = part[rows][other:]
        before, after = rows.start > 0 and not other, rows.stop < len(part)
        sides = " and ".join(["before"] * before + ["after"] * after)
        left = ["before, the feed differs"] * (other > 0)
        left += [f"{sides}, the position stands"] * bool(sides)
        if left:
            since, until = ((stamp - first) / NANOSECONDS for stamp in moving.stamp[[0, -1]])
            whole = (part.stamp[-1] - first) / NANOSECONDS
            self._notes.append(
                f"the measures are those from {since:.4g} s to {until:.4g} s of {whole:.4g} s: "
                + "; ".join(left)
            )
        return moving

    def _feed_states(self, part: SampleColumns, first: int) -> None:
        self._measured += len(part)
        if self._slips is not None:
            self._slips.feed(part, first)
        self._take(part)
        if len(self._references):
            self._followers.append(part)
        if self._other_machine:
            part, self._feed_speed = relative_to_feed(self._moving_part(part, first))
        self._meter.motion.feed(part)
        if self._observer is None:
            return
        time = (part.stamp - first) / NANOSECONDS
        self._observer.take_friction(time, part.friction_force)
        if part.has_motor:
            slide = part.position, part.velocity
            motor = part.motor_position, part.motor_velocity
            self._observer.take_motor(time, np.array([*slide, *motor]))

    def _begin_without_states(self) -> None:
        stamps = [forces.stamp[0] for forces, _ in self._early if len(forces.stamp) > 0]
        if stamps:
            self._begin(int(stamps[0]))

    def _begin(self, first: int) -> int:
        self.first = self._meter.motion.origin = first
        for forces, dropped in self._early:
            self._feed_forces(forces, dropped, first)
        self._early.clear()
        return first

    def _feed_forces(self, forces: ForceColumns, dropped: ForceColumns, first: int) -> None:
        forces = forces[self._part.rows(forces.stamp, first)]
        dropped = dropped[self._part.rows(dropped.stamp, first)]
        self._measured += len(forces)
        self._meter.feed_forces(forces, dropped)
        self._take(forces)


class _SlipSearch:
    def __init__(self, threshold: SlipThreshold) -> None:
        self._threshold = threshold
        self._times, self._positions = [np.empty(0)], [np.empty(0)]
        self._belt_speed, self._last_stamp = 0.0, -1

    def feed(self, samples: SampleColumns, first: int) -> None:
        """Add samples; those that are not valid, or not later than others, are left out."""
        samples = samples[samples.is_valid]
        if len(samples) == 0:
            return
        self._belt_speed = float(samples.belt_velocity[-1])
        samples = samples[np.diff(samples.stamp, prepend=self._last_stamp) > 0]
        self._times.append((samples.stamp - first) / NANOSECONDS)
        self._positions.append(samples.position * (-1.0 if self._belt_speed < 0.0 else 1.0))
        if len(samples):
            self._last_stamp = int(samples.stamp[-1])

    def report(self, noise: float | None, length: str) -> tuple[dict[str, Any], list[str]]:
        """Return the slips, drops or else rises of the position, and sentences on them."""
        time, position = np.concatenate(self._times), np.concatenate(self._positions)
        notes, least = list[str](), self._threshold.drop
        slips = slips_in(time, position, self._threshold)
        if not slips and (slips := slips_in(time, -position, self._threshold)):
            notes.append("the slips are rises of the position: drops there are none")
        if noise is not None and least < _NOISES * noise:
            notes.append(
                f"the least drop of a slip, {quantity(least, length)}, is within the noise of "
                f"the positions, {quantity(noise, length)}: some slips are noise"
            )
        return slip_report(slips, self._threshold, self._belt_speed), notes
