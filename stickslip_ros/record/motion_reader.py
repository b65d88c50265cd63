"""Motion and force in bags, and live topics, of machines other than ours."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from math import nan

import numpy as np

from stickslip_ros.arrays import FloatArray, IntArray
from stickslip_ros.errors import BagError, MessageError
from stickslip_ros.record.bag_layout import ANY_LAYOUT, BagLayout, NumberedTopic
from stickslip_ros.record.cdr import Layout, Messages, Refused, decode
from stickslip_ros.record.codec import (
    BELT,
    SLIDE,
    joint_layout,
    joint_names,
    joint_state_layout,
)
from stickslip_ros.record.faults import MOST_SHIFTS, Jumps, differences, lost_velocities, shift_note
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import printable, quantity, shown

_SEEN, _MOST_NAMES = 1000, 20
"""Messages of which the joints are looked at first; names of joints in a message to the user."""
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


class MotionReader:
    """Reads the joint states of a drive, block by block.

    Joint states of slide and belt, as our plant sends them, are read as they are. Of others the
    slide is the joint that was chosen, or the only one. Messages that do not name it are left out.
    Of messages of which only some have a velocity, those with one are used if they are half or
    more; else the velocity is that of the positions, as where there is none.
    """

    def __init__(
        self,
        topic: str,
        layout: BagLayout = ANY_LAYOUT,
        belt_speed: float | None = None,
        source: str = "",
        kind: str = "sensor_msgs/msg/JointState",
    ) -> None:
        """Take topic and source, for messages to the user, and the belt speed (m/s) of no belt.

        `kind` is the type of the messages, one of `STATE_TYPES`.
        """
        self._kind = kind
        self.own = True
        """Whether the joint states are those of our plant."""
        self.estimated = False
        """Whether velocities are those of the positions."""
        self.clock_offset: int | None = None
        """Log time less stamp of the first sample, ns."""
        self._topic, self._layout, self._belt_speed = topic, layout, belt_speed
        self._where = f"on {topic} of {source}" if source else f"on {topic}"
        self._source = NumberedTopic.parse(layout.states_topic or "").number
        self._joint = ""
        self._layout_of: Callable[[bytes], Layout] | None = None
        self._known: tuple[bool, bool] | None = None
        self._last: SampleColumns | None = None
        self._left_out = Counter[str]()
        self._shifts: list[tuple[int, float]] = []
        self._fault = ""
        self._samples = self._standing = self._zero = self._step = 0
        self._first_stamp: int | None = None
        self._last_stamp = -1
        self._belt = nan
        self._grid: tuple[int, int, int] | None = None

    @property
    def notes(self) -> list[str]:
        """Sentences on what was left out, and what is assumed."""
        if self.own or self._known is None:
            return []
        has_position, _ = self._known
        notes = [
            f"{number} joint states on {self._topic} {why} and are left out"
            for why, number in self._left_out.items()
        ]
        if len(self._shifts) <= MOST_SHIFTS:
            notes += [
                shift_note(size, f"{since / NANOSECONDS:.6g} s after the first sample")
                for since, size in self._shifts
            ]
        if not has_position:
            notes.append("the position is not recorded: it is the integral of the velocity")
        elif self._fault:
            notes.append(f"the velocity {self._fault}: it is the difference of the positions")
        elif self.estimated:
            notes.append("the velocity is not recorded: it is the difference of the positions")
        if self._belt_speed is None and self._layout.belt_joint is None:
            notes.append(
                "the belt velocity is not recorded: the belt counts as at rest, unless "
                "--belt-speed or --belt-joint gives it"
            )
        return [printable(each) for each in notes]

    def read(
        self, messages: Messages, log_time: IntArray | None = None
    ) -> tuple[SampleColumns, ForceColumns, Refused]:
        """Read messages; also return efforts that are forces.

        Raises BagError if the joint must be chosen, or is not there, if the stamps tell no times,
        or if two sources take turns.
        """
        if self._layout_of is None:
            self._choose(messages)
        layout_of = self._layout_of or joint_state_layout
        rows, stamp, values, refused = decode(*messages, layout_of, 7)
        if log_time is not None:
            if len(rows) and self.clock_offset is None:
                self.clock_offset = int(log_time[rows[0]] - stamp[0])
            if self._layout.time == "log":
                stamp = log_time[rows]
        samples = SampleColumns(stamp, *values)
        forces = ForceColumns(stamp[:0], values[0, :0])
        if self.own:
            self._check_stamps(samples.stamp)
            return samples, forces, refused
        with np.errstate(all="ignore"):  # values of others may overflow
            samples = self._of_the_joint(samples)
            self._check_stamps(samples.stamp)
            if self._layout.force == "effort":
                forces = ForceColumns(samples.stamp, samples.friction_force)
            return self._completed(samples), forces, refused

    def without_lost_velocities(self, samples: SampleColumns) -> SampleColumns:
        """Return all samples of another machine with velocities that agree with the positions."""
        if self._known != (True, True) or self.estimated:
            return samples
        valid = np.flatnonzero(samples.is_valid)
        time = (samples.stamp[valid] - samples.stamp[:1]) / NANOSECONDS
        position, own = samples.position[valid], samples.velocity[valid]
        fault, spikes = lost_velocities(time, position, own)
        velocity = samples.velocity.copy()
        if fault is not None:
            self.estimated, self._fault = True, fault
            velocity[valid] = differences(time, position)
        elif spikes.any():
            why = "have a velocity that jumps away and back, as the positions do not,"
            self._left_out[why] += int(np.count_nonzero(spikes))
            velocity[valid] = np.interp(time, time[~spikes], own[~spikes])
        return replace(samples, velocity=velocity)

    def _choose(self, messages: Messages) -> None:
        """Find the joint by the names in the first messages."""
        known: dict[str, None] = {}
        joint, belt, own = self._layout.joint, self._layout.belt_joint, False
        for begin, end in zip(messages.begin[:_SEEN], messages.end[:_SEEN], strict=True):
            try:
                names = joint_names(messages.data[begin:end], self._kind)
            except MessageError:
                continue
            own |= SLIDE in names and BELT in names and self._kind.startswith("sensor")
            known |= dict.fromkeys(names)
        if not known:
            return
        if own and joint is None and belt is None:
            if self._layout.force == "effort":
                raise BagError(
                    f"the effort {self._where} is the friction of our plant: the force is on "
                    "control_force, and --force effort is refused"
                )
            self._layout_of = joint_state_layout
            return
        others = [name for name in known if name != belt]
        if joint is None and len(others) != 1:
            raise self._several(others)
        self._joint = others[0] if joint is None else joint
        for option, name in (("joint", self._joint), ("belt_joint", belt)):
            if name is not None and name not in known:
                raise BagError(
                    printable(
                        f"{option} = {shown(name)} is refused: the joint states {self._where} "
                        f"are of the joints {_listed(known)}"
                    )
                )
        self.own = False
        self._layout_of = partial(joint_layout, joint=self._joint, belt=belt, kind=self._kind)
        if joint is None:
            self._layout_of = self._only_joint

    def _only_joint(self, data: bytes) -> Layout:
        """Return the layout of the only joint; refuse messages of others."""
        names, belt = joint_names(data, self._kind), self._layout.belt_joint
        if self._joint not in names and belt not in names:
            raise self._several([self._joint, *names])
        return joint_layout(data, self._joint, belt, self._kind)

    def _several(self, names: Iterable[str]) -> BagError:
        return BagError(
            printable(
                f"the joint states {self._where} are of the joints {_listed(names)}: --joint NAME "
                "must choose one"
            )
        )

    def _of_the_joint(self, samples: SampleColumns) -> SampleColumns:
        """Return the samples that tell of the joint."""
        if self._layout.belt_joint is not None:
            samples = self._with_held_belt(samples)
        position, velocity = np.isfinite(samples.position), np.isfinite(samples.velocity)
        if self._known is None and (position | velocity).any():
            both, positions = map(np.count_nonzero, (position & velocity, position))
            self._known = bool(positions), bool(2 * both >= positions)
            self._check_effort(samples.friction_force)
        has_position, has_velocity = self._known or (False, False)
        kept = position | velocity
        for why, lacking in (
            (f"tell nothing of {self._joint}", ~kept),
            ("have no position", kept & ~position & has_position),
            ("have no velocity", kept & ~velocity & has_velocity),
        ):
            if lacking.any():
                self._left_out[why] += int(np.count_nonzero(lacking))
                kept &= ~lacking
        return self._of_one_source(samples if kept.all() else samples[kept])

    def _with_held_belt(self, samples: SampleColumns) -> SampleColumns:
        """Return the samples with the newest velocity of a belt that has messages of its own."""
        belt = np.append(self._belt, samples.belt_velocity)
        newest = np.maximum.accumulate(np.where(np.isfinite(belt), np.arange(len(belt)), 0))
        if not np.isfinite(self._belt) and np.isfinite(belt).any():
            newest[newest == 0] = newest[newest > 0][0]
        belt = belt[newest]
        self._belt = float(belt[-1])
        return replace(samples, belt_velocity=belt[1:])

    def _check_effort(self, effort: FloatArray) -> None:
        if self._layout.force == "effort" and not np.isfinite(effort).any():
            raise BagError(
                f"the joint states {self._where} have no effort of {printable(self._joint)}: "
                "--force effort is refused; --force-topic names a topic of forces"
            )

    def _of_one_source(self, samples: SampleColumns) -> SampleColumns:
        """Return the samples of the source that was chosen; refuse two that take turns."""
        stamp = samples.stamp
        if self._source is not None:
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
            return samples[is_second if self._source > 1 else ~is_second]
        if len(stamp) < _FEWEST or np.isnan(samples.position).any():
            return samples
        steps = np.diff(samples.position)
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
        strange[1:-1] |= returns & (sizes[1:] > _JUMP * usual) & (usual > 0.0)
        if strange.any():
            why = "jump away from the motion and back, as of another source or a dropout,"
            self._left_out[why] += int(np.count_nonzero(strange))
        return samples[~strange]

    def _check_stamps(self, stamp: IntArray) -> None:
        """Refuse stamps that stand."""
        if self._first_stamp is None and len(stamp):
            self._first_stamp = int(stamp[0])
        if self._layout.time == "log" or len(stamp) == 0:
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
        if self.own and not unfilled:
            what += ", or those of several plants"
        count = self._zero if unfilled else self._standing
        raise BagError(
            f"stamps of the joint states {self._where} are {what}: {count} of {self._samples} are "
            f"{'0' if unfilled else 'those of the sample before'}; --time log takes the times at "
            "which the messages were recorded"
        )

    def _completed(self, samples: SampleColumns) -> SampleColumns:
        """Return the samples with a belt, and with velocities or positions from the others.

        A velocity that is not recorded is the difference to the position before it.
        """
        nothing = np.full(len(samples), nan)
        belt = np.full(len(samples), self._belt_speed or 0.0)
        if self._layout.belt_joint is not None:
            belt = samples.belt_velocity
        samples = replace(samples, friction_force=nothing, belt_velocity=belt)
        if len(samples) == 0 or self._known is None:
            return samples
        has_position, has_velocity = self._known
        whole = samples if self._last is None else self._last.followed_by(samples)
        steps = np.diff(whole.stamp) / NANOSECONDS
        if not has_position:
            mean = (whole.velocity[1:] + whole.velocity[:-1]) / 2.0
            start = 0.0 if self._last is None else float(self._last.position[0])
            position = start + np.cumsum(np.append([] if self._last else [0.0], mean * steps))
            samples = replace(samples, position=position)
        if not has_velocity:
            self.estimated = True
            velocity = np.diff(whole.position) / steps
            if self._last is None:
                velocity = np.append(velocity[:1] if len(velocity) else [0.0], velocity)
            samples = replace(samples, velocity=velocity)
        self._last = samples[-1:]
        return samples


def _listed(names: Iterable[str]) -> str:
    found = [*dict.fromkeys(names)]
    return ", ".join(found[:_MOST_NAMES]) + (", ..." if len(found) > _MOST_NAMES else "")
