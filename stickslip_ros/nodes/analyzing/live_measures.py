"""Measures and timing of a run while it goes on, from its messages; no ROS graph."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from math import inf
from threading import Thread
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray

from stickslip_ros.arrays import IntArray
from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.measures.cycle_measures import Cycle, Regime
from stickslip_ros.measures.noise import import_for_noise
from stickslip_ros.measures.onset_watch import OnsetWatch
from stickslip_ros.measures.ring_down import RingDown
from stickslip_ros.measures.run_meter import RunMeter
from stickslip_ros.measures.run_report import report_of
from stickslip_ros.measures.sample_assumptions import SampleAssumptions
from stickslip_ros.measures.timing import Timing
from stickslip_ros.model.drive import Drive
from stickslip_ros.nodes.analyzing.incoming import Message
from stickslip_ros.nodes.base.clients import NEXT_TRANSITION
from stickslip_ros.nodes.base.managed import FIRST_STAMP, STATE, DroppedMessages
from stickslip_ros.record.bag_layout import BagLayout
from stickslip_ros.record.cdr import Messages, Refused, joined
from stickslip_ros.record.codec import force_layouts, wrenches_in
from stickslip_ros.record.motion_reader import MotionReader
from stickslip_ros.record.reader import read_forces
from stickslip_ros.record.topics import CONTROL_FORCE, DROPPED_FORCE, JOINT_STATES, Topic
from stickslip_ros.samples import NO_FORCES, NO_SAMPLES, ForceColumns
from stickslip_ros.scenarios.parameters import AnalyzerParameters
from stickslip_ros.text import number_in, quantity


class LiveMeasures:
    """Keeps messages until they are measured, in blocks: cycles, ring-downs and forces."""

    def __init__(self, parameters: AnalyzerParameters, dropped: DroppedMessages) -> None:
        """Measure as the parameters say; messages that cannot be read count as `dropped`."""
        self.meter = RunMeter(parameters.window, reading=parameters.reading_of({}))
        self.watch = OnsetWatch()
        self.cycles = 0
        """Number of cycles so far."""
        self.length = "m"
        """Unit of positions in texts; empty for a dimensionless drive."""
        self._parameters, self._dropped = parameters, dropped
        joint, belt_joint = parameters.joint or None, parameters.belt_joint or None
        by_effort = parameters.force_type == "effort"
        layout = BagLayout(joint, belt_joint, force="effort" if by_effort else "topic")
        self._motion = MotionReader(JOINT_STATES.name, layout, parameters.belt_speed)
        self._read_forces = _read_wrenches
        if not by_effort and parameters.force_type != CONTROL_FORCE.type_name:
            layouts = force_layouts(joint, parameters.force_number or None)
            self._read_forces = partial(read_forces, layouts[parameters.force_type], by_log=True)
        topics = JOINT_STATES, CONTROL_FORCE, DROPPED_FORCE
        self._waiting: dict[str, list[Message]] = {topic.name: [] for topic in topics}

    def add(self, messages: Mapping[Topic[Any], list[Message]]) -> None:
        """Keep those messages, by topic, that are measured."""
        for topic, batch in messages.items():
            if topic.name in self._waiting:
                self._waiting[topic.name] += batch

    def give_up(self) -> None:
        """Do not measure what was added."""
        self.meter.unmeasured += len(self._waiting[JOINT_STATES.name])
        for messages in self._waiting.values():
            messages.clear()

    def measure(self) -> tuple[list[Cycle], list[RingDown]]:
        """Measure what was added; return the cycles and ring-downs that have ended."""
        states, efforts = self._read(JOINT_STATES, self._read_states, NO_SAMPLES, NO_FORCES)
        machine = self._motion.machine
        if machine and machine.estimated and self.meter.motion.reading.noisy is None:
            self._assume(SampleAssumptions(noisy=True))
        cycles, ring_downs = self.meter.motion.feed(states), self.watch.feed(states)
        self.cycles += len(cycles)
        (dropped,) = self._read(DROPPED_FORCE, _read_wrenches, NO_FORCES)
        if not len(efforts):
            efforts = self._read(CONTROL_FORCE, self._read_forces, NO_FORCES)[0]
        self.meter.feed_forces(efforts, dropped)
        return cycles, ring_downs

    def report(self, *, quick: bool = False) -> dict[str, Any]:
        """Return the report of the run so far; see `SampleMeter.measured` for `quick`."""
        return report_of(self.meter, self.meter.motion.measured(self.length, quick=quick))

    def text(self) -> str:
        """Return the measures of the last window of cycles in words."""
        measures = self.meter.motion.measures(quick=True)
        regime = str(measures.regime or Regime.label(None, self.cycles))
        if measures.amplitude is None or measures.frequency is None:
            return regime
        share = measures.stick_fraction
        return (
            f"{regime}: amplitude {quantity(measures.amplitude, self.length)}, "
            f"frequency {quantity(measures.frequency, self.length and 'Hz')}, "
            f"stick fraction {'not known' if share is None else f'{share:.3g}'}"
        )

    def assume_plant(self, plant: Mapping[str, Any]) -> None:
        """Read the samples as those of a plant with these parameters, by flat name."""
        self._assume(self._parameters.reading_of(plant))
        with suppress(InvalidInputError, KeyError, TypeError):  # a plant of another version
            drive = Drive(**{name: plant[name] for name in ("mass", "stiffness", "normal_force")})
            period = drive.natural_period
            self.watch.pause = max(1.0, period if period < inf else 0.0)
            self.length = "" if drive.is_dimensionless else "m"

    def _assume(self, reading: SampleAssumptions) -> None:
        self.meter.motion.reading = reading
        if reading.noisy:  # imported when first used, it would hold up the recording for long
            Thread(target=import_for_noise, name="imports").start()

    def _read_states(self, messages: Messages, _: IntArray) -> tuple[Any, ...]:
        return self._motion.read(messages)

    def _read(
        self,
        topic: Topic[Any],
        read: Callable[[Messages, IntArray], tuple[Any, ...]],
        *nothing: Any,
    ) -> Sequence[Any]:
        """Return what `read` makes of the messages of a topic to measure, or nothing.

        It gets messages and their stamps, and returns values and what it refused, which is dropped.
        """
        messages, self._waiting[topic.name] = self._waiting[topic.name], []
        stamps = np.array([message.stamp for message in messages], np.int64)
        try:
            *values, refused = read(joined([message.data for message in messages]), stamps)
        except BagError as error:
            self._dropped.add(str(error), len(messages))
            return nothing
        if refused.number > 0:
            self._dropped.add(f"{topic.name}: {refused.reason}", refused.number)
        return values


class PlantTiming:
    """Adds up the counts of a plant over its activations.

    What a paused plant repeats is left out: it may be from before this recording.
    """

    def __init__(self, plant: str) -> None:
        """Count from now on; `plant` is the full name of the node."""
        self._plant, self._since = plant, time.time_ns()
        self._activations: dict[str, Timing] = {}

    @property
    def total(self) -> Timing | None:
        """The counts of all activations; None if there is none."""
        counts = self._activations.values()
        return Timing(*map(sum, zip(*counts, strict=True))) if counts else None

    @property
    def complete(self) -> bool:
        """Whether all counts are of this recording: the plant started while it went on.

        The stamps of lockstep are no time of day, and do not tell that.
        """
        return all(number_in(first) >= self._since for first in self._activations)

    def take(self, health: DiagnosticArray) -> None:
        """Take the counts of the plant's activation, if they are there."""
        for status in health.status:
            values = {entry.key: entry.value for entry in status.values}
            paused = values.get(STATE) in NEXT_TRANSITION
            if status.name == self._plant and FIRST_STAMP in values and not paused:
                counts = (int(number_in(values.get(name, ""))) for name in Timing._fields)
                self._activations[values[FIRST_STAMP]] = Timing(*counts)


def _read_wrenches(messages: Messages, _: IntArray) -> tuple[ForceColumns, Refused]:
    return wrenches_in(*messages)
