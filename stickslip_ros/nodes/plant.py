"""Plant node: integrates the stick-slip motion of the drive and publishes its state."""

import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from math import isfinite, nan
from typing import Any

from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.motion.force_answers import Verdict
from stickslip_ros.motion.motion import Motion
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.nodes.base import managed
from stickslip_ros.nodes.base.managed import Diagnosis, ManagedNode, diagnosis
from stickslip_ros.nodes.base.process import run_node
from stickslip_ros.nodes.pacing import NO_FORCE, LockstepPacer, RealtimePacer
from stickslip_ros.nodes.timing import FORECAST_DURATION, Forecast, TimingMonitor
from stickslip_ros.record import codec, topics
from stickslip_ros.samples import Sample
from stickslip_ros.scenarios import Pace
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.stamps import END_OF_TIME, NANOSECONDS


class PlantNode(ManagedNode[PlantParameters]):
    """Publishes joint_states and receives control_force; a pacer drives one sampled loop."""

    def __init__(self, **options: Any) -> None:
        super().__init__("plant", PlantParameters(), **options)
        self._next_start = LOCKSTEP_START
        self.elapsed = 0.0
        """Simulated time, s, before the last pause that counts as part of the duration."""
        self._warned: str | None = None
        self._timing: TimingMonitor | None = None

    def connect(self) -> None:
        """Compile the motion; publish the state, subscribe to forces and to the recorder."""
        self._warn_of_friction()
        initial = self.parameters.initial
        self._motion = Motion(self.parameters.as_drive(), initial.position, initial.velocity)
        self._moved = False
        self.elapsed = 0.0
        self._lock = threading.Lock()
        self._topics = _SampleTopics(self)
        self.read_last = self._topics.states
        self._dropped_force = self.advertise(topics.DROPPED_FORCE)
        self._answerable = 0
        """Stamp of the sample that may still be answered while the plant pauses, ns."""
        force, commands = topics.force_topics(self.parameters.force_type)
        unpack: Callable[[bytes], tuple[int, float]] = codec.unpack_wrench
        if force != topics.CONTROL_FORCE:
            number, slide = self.parameters.force_number or None, self.parameters.slide_name
            layouts = codec.force_layouts(slide, number)
            unpack = partial(codec.unpack_force, layouts[force.type_name])
        self.subscribe_serialized(force, partial(self._on_force, unpack))
        unpack = partial(codec.unpack_command, joint=self.parameters.slide_name)
        self.subscribe_serialized(commands, partial(self._on_force, unpack))
        self.subscribe(topics.DISTURBANCE_FORCE, self._on_disturbance, while_active=False)
        self.subscribe(topics.RECORDED, lambda stamp: self._pacer.recorder_came_to(stamp))
        self.keep(self.create_service(Trigger, "~/reset", self._on_reset))

    def start(self) -> None:
        """Start a segment: sample 0 now, the following ones as the pacer advances."""
        self._superseded = 0
        parameters = self.parameters
        realtime = parameters.pace is Pace.REALTIME
        self._loop = parameters.as_loop(
            self._motion,
            time.time_ns() if realtime else self._next_start,
            hold_late=realtime,
            overtaken=lambda stamp, force: self._dropped_force.publish(
                codec.pack_wrench(stamp, force)
            ),
        )
        self._topics.start(self._loop, effort_of_actuator=parameters.effort == "actuator")
        latest = END_OF_TIME - NANOSECONDS
        stampable = self._loop.stamps.number(latest) - 1
        if stampable < 0:
            raise InvalidInputError(
                f"no stamps are left after {latest // NANOSECONDS} s: restart the node"
            )
        self._forecast: Forecast | None = None
        if realtime:
            self._pacer = RealtimePacer(
                self._loop,
                self._topics.publish,
                self._end,
                self._lock,
                parameters.real_time_factor,
                self.call_soon,
            )
            long = parameters.duration > FORECAST_DURATION * parameters.real_time_factor
            if long and parameters.command_rule != "newest":
                rate, every = parameters.control_rate, parameters.answer_every
                pacer = self._pacer
                self._forecast = Forecast(
                    rate * parameters.real_time_factor, lambda n: pacer.deadline(n * every)
                )
        else:
            self._pacer = LockstepPacer(self._loop, self._topics.publish, self._end, self)
        last = stampable
        if parameters.last_sample is not None:
            due = parameters.last_sample - round(self.elapsed * parameters.rate)
            last = min(max(due, 0), stampable)
        self._timing = TimingMonitor()
        self._pacer.start(last)

    def stop(self) -> None:
        """Pause the motion once the states sent have arrived."""
        self._pacer.stop()
        self._moved = True
        done = self._loop.sample_number * self._loop.period
        self.elapsed = 0.0 if self._pacer.finished else self.elapsed + done
        self._next_start = self._loop.stamps.stamp(self._loop.sample_number + 1)
        self._answerable = self._loop.sample.stamp
        super().stop()

    def _warn_of_friction(self) -> None:
        """Log what a user of the friction law should know, once."""
        warning = self.parameters.friction.selected.warning()
        if warning is not None and warning != self._warned:
            self.get_logger().warning(warning)
        self._warned = warning

    def apply_parameters(self) -> None:
        """Use the new drive and disturbance from the next sample on."""
        self._warn_of_friction()
        if self.active:
            with self._lock:
                self._loop.change_drive(self.parameters.as_drive())
                period = self.parameters.period
                self._loop.follow_disturbance(self.parameters.disturbance.signal(period))
        elif self.configured:
            self._motion.drive = self.parameters.as_drive()
            if not self._moved:
                initial = self.parameters.initial
                self._motion.restart(initial.position, initial.velocity)

    def diagnose(self) -> Diagnosis:
        """Return counts of samples, late and dropped forces and missed deadlines."""
        if self._timing is None:
            return managed.OK, "", {}
        loop, pacer = self._loop, self._pacer
        values = {
            "samples": loop.sample_number + 1,
            managed.FIRST_STAMP: loop.stamps.stamp(0),
            managed.NEWEST_STAMP: loop.sample.stamp,
            managed.FINISHED: pacer.finished,
            "late_forces": loop.answers.late_forces,
            "missed_deadlines": pacer.missed_deadlines,
            "largest_lateness": round(pacer.largest_lateness, 6),
            "steps_per_second": round(pacer.steps_per_second, 1),
            "silent_samples": loop.answers.silent_samples,
            "superseded": self._superseded,
            "disturbance_force": loop.disturbance,
            **self.dropped.values,
            **{f"dropped: {reason}": count for reason, count in loop.answers.dropped.items()},
        }
        if self._forecast is not None and self._forecast.sentence:
            values[managed.FORECAST] = self._forecast.sentence
        if loop.unbounded:
            return managed.ERROR, "the motion diverges (regime unbounded)", values
        if pacer.failure:
            return managed.ERROR, pacer.failure, {**values, managed.FAILURE: pacer.failure}
        controlled = self.parameters.expects_control and loop.answers.controller_present
        timing = self._timing.check(
            loop.sample_number + 1,
            loop.answers.late_forces,
            pacer.missed_deadlines,
            controlled=controlled,
        )
        lost = NO_FORCE if self.parameters.expects_control and not controlled else ""
        if self._timing.turns_to("lost" if lost else "late" if timing else ""):
            if lost or timing:
                self.get_logger().warning(lost or timing)
            else:
                self.get_logger().info("forces and samples are in time again")
        complaints = [pacer.complaint, lost, timing, self.dropped.complaint]
        complaints += self.duplicate_publishers(
            *topics.force_topics(self.parameters.force_type), topics.DISTURBANCE_FORCE
        )
        return diagnosis(complaints, values)

    def _end(self) -> None:
        """Pause: the last sample was reached, or the motion cannot continue."""
        if not self._pacer.finished:  # this call belongs to an earlier segment
            return
        if self._loop.unbounded:
            self.get_logger().error("the motion diverges (regime unbounded): plant deactivated")
        elif self._pacer.failure:
            self.get_logger().error(f"{self._pacer.failure}: plant deactivated")
        else:
            self.get_logger().info("finished: the last sample was reached")
        if self.active:
            self.trigger_deactivate()

    def _on_force(self, unpack: Callable[[bytes], tuple[int, float]], message: bytes) -> None:
        try:
            stamp, force = unpack(message)
        except BagError as error:
            if self.active:
                self.dropped.add(f"control force: {error}")
            return
        wrench = message if unpack is codec.unpack_wrench else codec.pack_wrench(stamp, force)
        if not self.active:
            if stamp != self._answerable:
                self._dropped_force.publish(wrench)
            return
        if not self.parameters.expects_control:
            self.dropped.add(
                f"control force {force} N is dropped: expects_control is false, and must be true "
                "for forces to act"
            )
            self._dropped_force.publish(wrench)
            return
        with self._lock:
            if self.parameters.command_rule == "newest":
                verdict = self._loop.command(force, self._pacer.instant)
            else:
                verdict = self._loop.offer(stamp, force)
        if self._forecast is not None and stamp <= self._loop.sample.stamp:
            number = self._loop.stamps.number(stamp)
            self._forecast.answered(number // self.parameters.answer_every)
        if verdict is Verdict.SUPERSEDED:
            self._superseded += 1
        elif verdict is not Verdict.ACCEPTED:
            self.dropped.add(f"control force {force} N stamped {stamp} ns: {verdict}")
            self._dropped_force.publish(wrench)
        self._pacer.force_came()

    def _on_disturbance(self, stamped_force: tuple[int, float]) -> None:
        _, force = stamped_force
        if not self.active or not isfinite(force):
            why = "not finite" if self.active else "the plant is not active"
            self.dropped.add(f"disturbance force {force} N: {why}")
            return
        with self._lock:
            self._loop.disturb(force)

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        initial = self.parameters.initial
        if self.active:
            with self._lock:
                self._loop.reset(initial.position, initial.velocity)
        else:
            self._motion.restart(initial.position, initial.velocity)
        response.success = True
        return response


class _SampleTopics:
    """Joint states and disturbances; if the parameters say so, what is true, and the clock."""

    def __init__(self, node: ManagedNode[PlantParameters]) -> None:
        """Advertise the topics through a node."""
        parameters = node.parameters
        self.states = node.advertise(topics.JOINT_STATES)
        self._truth: tuple[Publisher, Publisher] | None = None
        if parameters.publish_truth:
            states, force = topics.TRUE_JOINT_STATES, topics.APPLIED_FORCE
            self._truth = node.advertise(states), node.advertise(force)
        self._applied_disturbance = node.advertise(topics.APPLIED_DISTURBANCE)
        self._clock = node.advertise(topics.CLOCK) if parameters.publish_clock else None
        names = parameters.slide_name, parameters.belt_name
        self._pack, self._pack_motor = (
            [codec.joint_state_packer(*joints, frame=frame) for frame in (codec.HELD, "")]
            for joints in (names, (*names, codec.MOTOR))
        )
        self._disturbance = 0.0

    def start(self, loop: SampledLoop, *, effort_of_actuator: bool) -> None:
        """Publish the samples of a loop from now on, with friction or actuator as the effort."""
        self._loop, self._effort_of_actuator = loop, effort_of_actuator
        if self._disturbance:  # the recorder of the new segment has not received it
            self._disturbance = nan

    def publish(self, sample: Sample) -> None:
        """Publish the newest sample of the loop."""
        self.states.publish(self._packed(sample))
        if self._truth is not None:
            true_states, applied_force = self._truth
            true_states.publish(self._packed(self._loop.true_sample))
            applied_force.publish(codec.pack_wrench(sample.stamp, self._loop.applied_force))
        if self._loop.disturbance != self._disturbance:
            self._disturbance = self._loop.disturbance
            self._applied_disturbance.publish(codec.pack_wrench(sample.stamp, self._disturbance))
        if self._clock is not None:
            clock = Clock()
            clock.clock.sec, clock.clock.nanosec = divmod(sample.stamp, NANOSECONDS)
            self._clock.publish(clock)

    def _packed(self, sample: Sample) -> bytes:
        friction = sample.friction_force
        effort = self._loop.applied_force if self._effort_of_actuator else friction
        asks = self._loop.asks
        positions = sample.position, sample.belt_position
        velocities = sample.velocity, sample.belt_velocity
        if (motor := sample.motor) is None:
            return self._pack[asks](sample.stamp, positions, velocities, (effort, -friction))
        return self._pack_motor[asks](
            sample.stamp,
            (*positions, motor.position),
            (*velocities, motor.velocity),
            (effort, -friction, self._loop.applied_force),
        )


def main() -> None:
    """Run the node as a process."""
    sys.exit(run_node(PlantNode, PlantParameters()))


if __name__ == "__main__":
    main()
