"""The motion of a joint of another machine, with the faults of its drivers and sensors."""

from collections import Counter
from dataclasses import replace
from math import nan

import numpy as np

from stickslip_ros.arrays import BoolArray, IntArray
from stickslip_ros.errors import BagError
from stickslip_ros.record.bag_layout import BagLayout, numbered
from stickslip_ros.record.faults import (
    LARGEST_SHARE,
    MOST_SHIFTS,
    Jumps,
    differences,
    lost_velocities,
    shift_note,
)
from stickslip_ros.record.updates import updated
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import printable, quantity

_FEWEST = 100
"""Fewest samples that are judged."""
_STANDING_SHARE = 0.1
"""Share of the stamps that are those of the sample before, from which they are of no use."""
_ZERO_SHARE = 0.01
"""Share of stamps of 0, from which they are those of a publisher."""
_FINEST = 10_000
"""Smallest rounding of stamps, ns, that is one."""
_JUMP = 10.0
"""Ratio of the distance to the next sample and to the one after it, from which two sources take
turns."""


class MachineMotion:
    """The motion of a joint of another machine, read block by block.

    Of messages of which only some have a velocity, those with one are used if they are half or
    more; else the velocity is that of the positions, as where there is none.
    """

    def __init__(
        self, joint: str, topic: str, where: str, layout: BagLayout, belt_speed: float | None
    ) -> None:
        """Take joint, topic and place of the messages, and the belt speed (m/s) of no belt."""
        self._joint, self._topic, self._where = joint, topic, where
        self._layout, self._belt_speed = layout, belt_speed
        self._recorded: tuple[bool, bool] | None = None
        """Whether the messages have positions, and velocities, of the joint."""
        self._left_out = Counter[str]()
        self._sources = _Sources(joint, topic, where, layout)
        self._fault = ""
        """Why velocities are computed from the positions; empty if the recorded ones are used."""
        self._belt = nan
        self._last: SampleColumns | None = None

    @property
    def estimated(self) -> bool:
        """Whether velocities are those of the positions."""
        return self._fault != ""

    @property
    def notes(self) -> list[str]:
        """Sentences on what was left out, and what is assumed."""
        if self._recorded is None:
            return []
        notes = [
            f"{number} joint states on {self._topic} {why} and are left out"
            for why, number in self._left_out.items()
        ]
        notes += self._sources.notes
        if not self._recorded[0]:
            notes.append("the position is not recorded: it is the integral of the velocity")
        elif self._fault:
            notes.append(f"the velocity {self._fault}: it is the difference of the positions")
        if self._belt_speed is None and self._layout.belt_joint is None:
            notes.append(
                "the belt velocity is not recorded: the belt counts as at rest, unless "
                "--belt-speed or --belt-joint gives it"
            )
        return [printable(note) for note in notes]

    def read(self, samples: SampleColumns) -> tuple[SampleColumns, ForceColumns]:
        """Return decoded samples without those of no use, and the efforts that are forces.

        Raises BagError if there are no such efforts, and if two sources take turns.
        """
        with np.errstate(all="ignore"):  # values of others may overflow
            samples = self._with_values(samples)
            forces = ForceColumns(samples.stamp, samples.friction_force)
            if self._layout.force != "effort":
                forces = forces[:0]
            return self._completed(samples), forces

    def whole(self, samples: SampleColumns) -> SampleColumns:
        """Return those of all samples that update the position, with velocities that agree."""
        if self._recorded is None or not self._recorded[0]:
            return samples
        every, own = updated(samples.stamp, [samples.position])
        if every > 1:
            why = f"lie between updates of the position, which come every {every:.3g} messages,"
            self._left_out[why] += int(np.count_nonzero(~own))
            samples = samples[own]
        elif self.estimated:
            return samples
        valid = np.flatnonzero(samples.is_valid)
        time = (samples.stamp[valid] - samples.stamp[:1]) / NANOSECONDS
        position, recorded = samples.position[valid], samples.velocity[valid]
        velocity, spikes = samples.velocity.copy(), np.empty(0, np.bool_)
        if not self.estimated:
            fault, spikes = lost_velocities(time, position, recorded)
            self._fault = fault or ""
        if self.estimated:
            velocity[valid] = differences(time, position)
        elif spikes.any():
            why = "have a velocity that jumps away and back, as the positions do not,"
            self._left_out[why] += int(np.count_nonzero(spikes))
            velocity[valid] = np.interp(time, time[~spikes], recorded[~spikes])
        return replace(samples, velocity=velocity)

    def _with_values(self, samples: SampleColumns) -> SampleColumns:
        """Return the samples that have what the others have of the joint."""
        if self._layout.belt_joint is not None:
            samples = self._with_held_belt(samples)
        position, velocity = np.isfinite(samples.position), np.isfinite(samples.velocity)
        if self._recorded is None and (position | velocity).any():
            both, positions = map(np.count_nonzero, (position & velocity, position))
            self._recorded = bool(positions), bool(2 * both >= positions)
            if self._layout.force == "effort" and not np.isfinite(samples.friction_force).any():
                raise BagError(
                    f"the joint states {self._where} have no effort of {printable(self._joint)}: "
                    "--force effort is refused; --force-topic names a topic of forces"
                )
        has_position, has_velocity = self._recorded or (False, False)
        kept = position | velocity
        for why, lacking in (
            (f"tell nothing of {self._joint}", ~kept),
            ("have no position", kept & ~position & has_position),
            ("have no velocity", kept & ~velocity & has_velocity),
        ):
            if lacking.any():
                self._left_out[why] += int(np.count_nonzero(lacking))
                kept &= ~lacking
        samples, strays = self._sources.picked(samples if kept.all() else samples[kept])
        if strays:
            why = "jump away from the motion and back, as of another source or a dropout,"
            self._left_out[why] += strays
        return samples

    def _with_held_belt(self, samples: SampleColumns) -> SampleColumns:
        """Return the samples with the newest velocity of a belt that has messages of its own."""
        belt = np.append(self._belt, samples.belt_velocity)
        newest = np.maximum.accumulate(np.where(np.isfinite(belt), np.arange(len(belt)), 0))
        if not np.isfinite(self._belt) and np.isfinite(belt).any():
            newest[newest == 0] = newest[newest > 0][0]
        belt = belt[newest]
        self._belt = float(belt[-1])
        return replace(samples, belt_velocity=belt[1:])

    def _completed(self, samples: SampleColumns) -> SampleColumns:
        """Return the samples with a belt, and with velocities or positions from the others.

        A velocity that is not recorded is the difference to the position before it.
        """
        nothing = np.full(len(samples), nan)
        belt = np.full(len(samples), self._belt_speed or 0.0)
        if self._layout.belt_joint is not None:
            belt = samples.belt_velocity
        samples = replace(samples, friction_force=nothing, belt_velocity=belt)
        if len(samples) == 0 or self._recorded is None:
            return samples
        whole = samples if self._last is None else self._last.followed_by(samples)
        steps = np.diff(whole.stamp) / NANOSECONDS
        has_position, has_velocity = self._recorded
        if not has_position:
            mean = (whole.velocity[1:] + whole.velocity[:-1]) / 2.0
            start = 0.0 if self._last is None else float(self._last.position[0])
            position = start + np.cumsum(np.append([] if self._last else [0.0], mean * steps))
            samples = replace(samples, position=position)
        if not has_velocity:
            self._fault = "is not recorded"
            velocity = np.diff(whole.position) / steps
            if self._last is None:
                velocity = np.append(velocity[:1] if len(velocity) else [0.0], velocity)
            samples = replace(samples, velocity=velocity)
        self._last = samples[-1:]
        return samples


class _Sources:
    """One source of a topic on which two may take turns, and what jumps away from its motion."""

    def __init__(self, joint: str, topic: str, where: str, layout: BagLayout) -> None:
        self._joint, self._topic, self._where = joint, topic, where
        _, self._number = numbered(layout.states_topic)
        self._grid: tuple[int, int, int] | None = None
        self._first_stamp: int | None = None
        self._shifts: list[tuple[int, float]] = []

    @property
    def notes(self) -> list[str]:
        """Sentences on jumps from which the position does not come back."""
        return [
            shift_note(size, f"{since / NANOSECONDS:.6g} s after the first sample")
            for since, size in (self._shifts if len(self._shifts) <= MOST_SHIFTS else ())
        ]

    def picked(self, samples: SampleColumns) -> tuple[SampleColumns, int]:
        """Return the samples of the source, and how many others jumped away and back.

        Raises BagError if two sources take turns and none was chosen.
        """
        if self._number is not None:
            return self._chosen(samples, self._number), 0
        strays = 0
        if len(samples) >= _FEWEST and not np.isnan(samples.position).any():
            strange = self._strange(samples)
            strays = int(np.count_nonzero(strange))
            samples = samples[~strange]
        if self._first_stamp is None and len(samples):
            self._first_stamp = int(samples.stamp[0])
        return samples, strays

    def _chosen(self, samples: SampleColumns, number: int) -> SampleColumns:
        """Return the samples of the first or the second source, by the grid of the stamps."""
        stamp = samples.stamp
        if self._grid is None and len(stamp) > 2:
            self._grid = (
                int(stamp[0]),
                max(1, int(np.median(stamp[2:] - stamp[:-2]))),
                int(np.median(np.diff(stamp)[::2])),
            )
        if self._grid is None:
            return samples
        first, period, second = self._grid
        phase = (stamp - first) % period
        is_second = np.abs(phase - second) < np.minimum(phase, period - phase)
        return samples[is_second if number > 1 else ~is_second]

    def _strange(self, samples: SampleColumns) -> BoolArray:
        """Return which samples jump away and back; keep the jumps without a return."""
        stamp, steps = samples.stamp, np.diff(samples.position)
        sizes = np.abs(steps)
        returns = np.minimum(sizes[1:], sizes[:-1]) > _JUMP * np.abs(steps[1:] + steps[:-1])
        apart = float(np.median(sizes))
        if np.mean(returns) > 1.0 - _STANDING_SHARE and apart > 0.0:
            raise BagError(
                f"two sources take turns {self._where}: every other position of "
                f"{printable(self._joint)} is {apart:.4g} m away; --states-topic "
                f"'{self._topic}[1]' takes the first, [2] the second"
            )
        usual = np.quantile(sizes[sizes > 0.0], 0.25) if apart > 0.0 else 0.0
        jumps = Jumps(samples.position)
        strange = np.zeros(len(stamp), np.bool_)
        strange[jumps.dropouts()] = True
        first = int(stamp[0]) if self._first_stamp is None else self._first_stamp
        self._shifts += [(int(stamp[row]) - first, size) for row, size in jumps.shifts()]
        often = returns & (sizes[1:] > _JUMP * usual) & (usual > 0.0)
        if np.mean(often) > LARGEST_SHARE:  # too often for a sensor
            strange[1:-1] |= often
        return strange


class StampCheck:
    """Refuses stamps that stand."""

    def __init__(self, where: str) -> None:
        """Take where the joint states are, for messages to the user."""
        self._where = where
        self._samples = self._standing = self._zero = self._step = 0
        self._last_stamp = -1

    def check(self, stamp: IntArray, *, ours: bool) -> None:
        """Raise BagError if the stamps so far tell no times; `ours` are those of our plant."""
        if len(stamp) == 0:
            return
        self._samples += len(stamp)
        self._standing += np.count_nonzero(np.diff(stamp, prepend=self._last_stamp) == 0)
        self._zero += np.count_nonzero(stamp == 0)
        self._step = int(np.gcd(self._step, np.gcd.reduce(stamp)))
        self._last_stamp = int(stamp[-1])
        few = _STANDING_SHARE * self._samples
        unfilled = self._zero > 1 + _ZERO_SHARE * self._samples
        if self._samples < _FEWEST or not (unfilled or self._standing > few):
            return
        if unfilled:
            what = "0, which nobody filled in"
        elif self._step % NANOSECONDS == 0:
            what = "of whole seconds"
        elif self._step >= _FINEST:
            what = f"rounded to {quantity(self._step / NANOSECONDS, 's')}"
        else:
            return
        if ours and not unfilled:
            what += ", or those of several plants"
        count = self._zero if unfilled else self._standing
        raise BagError(
            f"stamps of the joint states {self._where} are {what}: {count} of {self._samples} are "
            f"{'0' if unfilled else 'those of the sample before'}; --time log takes the times at "
            "which the messages were recorded"
        )
