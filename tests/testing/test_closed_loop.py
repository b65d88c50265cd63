import gc
import multiprocessing
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from select import select
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from stickslip_ros.errors import BagError, InvalidInputError, RunError
from stickslip_ros.motion.motion import Motion
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.nodes.base.managed import WARN
from stickslip_ros.nodes.running.composition import ControllerThread
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.recorder import Recorder
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.testing import ClosedLoop, RunResult
from tests.nodes.graph import PATIENCE, wait_for
from tests.testing import controllers
from tests.testing.controllers import GAIN, VelocityFeedback, WithoutArguments

SECOND = 1_000_000_000


def process(controller: type[Node]) -> list[str]:
    return [sys.executable, str(controllers.__file__), controller.__name__]


def assert_every_sample_is_answered(result: RunResult) -> None:
    assert result.late_forces == 0
    assert result.forces.stamp.tolist() == result.states.stamp.tolist()


def test_a_controller_of_ones_own_acts_as_it_does_without_ros() -> None:
    plant = load_scenario("paper").plant
    expected = SampledLoop(Motion(plant.as_drive(), 0.0, 0.0), plant.rate, LOCKSTEP_START)
    samples = [expected.sample]
    for _ in range(300):
        expected.offer(samples[-1].stamp, -GAIN * samples[-1].velocity)
        samples.append(expected.advance())
    with ClosedLoop("paper", controller=WithoutArguments) as loop:
        result = loop.run(3.0)
        assert isinstance(loop.controller, WithoutArguments)
        assert loop.controller.answered == 301
    assert loop.controller is None
    assert result.states.stamp.tolist() == [sample.stamp for sample in samples]
    assert result.states.position.tolist() == [sample.position for sample in samples]
    assert_every_sample_is_answered(result)
    assert result.forces.force.tolist() == [-GAIN * sample.velocity for sample in samples]
    assert result.time[[0, -1]].tolist() == [0.0, 3.0]
    assert result.lost_samples == 0


@pytest.mark.parametrize(
    "controller",
    [
        lambda: VelocityFeedback(),
        controllers.Informed,
        controllers.Managed,
        WashoutControllerNode,
        "scenario",
        "velocity_feedback",
    ],
)
def test_every_kind_of_controller_answers_every_sample(controller: Any) -> None:
    with ClosedLoop("paper", controller=controller) as loop:
        assert_every_sample_is_answered(loop.run(0.5))


COMMANDS = "plant.command_rule=newest", "plant.effort=actuator"


def test_a_controller_that_commands_efforts_closes_the_loop_and_its_forces_are_recorded() -> None:
    with ClosedLoop(
        "paper", *COMMANDS, "plant.command_timeout=60.0", controller=controllers.Commanding
    ) as loop:
        result = loop.run(1.0)
    expected = [-GAIN * velocity for velocity in result.states.velocity[:-1]]
    assert result.forces.force[1:].tolist() == expected


def test_commands_that_nobody_expects_do_not_act_and_mark_the_result() -> None:
    with ClosedLoop("paper", controller=None) as loop:
        alone = loop.run(2.0)
    with ClosedLoop("paper", *COMMANDS, "plant.pace=realtime", controller=None) as loop:
        node = controllers.Commanding(context=loop.context, namespace=loop.namespace)
        beside = ControllerThread(node)
        beside.start()
        wait_for(lambda: node.commands.get_subscription_count(), "the plant hears it")
        result = loop.run(2.0)
        beside.close()
    assert result.states.position.tolist() == alone.states.position.tolist()
    told = result.diagnostics["plant"]
    assert told.level == WARN
    assert "expects_control is false" in told.message


@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    [
        process(WithoutArguments),
        process(controllers.Managed),
        process(controllers.Slow),
        [sys.executable, "-m", WashoutControllerNode.__module__],
        ["sh", "-c", '"$0" "$@"; exit', *process(WithoutArguments)],
    ],
)
def test_a_controller_in_a_process_of_its_own_answers_every_sample(command: list[str]) -> None:
    with ClosedLoop("paper", controller=command) as loop:
        for _ in range(2):
            assert_every_sample_is_answered(loop.run(0.5))


@pytest.mark.long
@pytest.mark.parametrize(("own", "gain"), [([], 0.5), (["--ros-args", "-p", "gain:=0.25"], 0.25)])
def test_parameters_of_a_command_are_those_of_the_scenario_unless_it_has_its_own(
    tmp_path: Path, own: list[str], gain: float
) -> None:
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(
        "/**/plant: {ros__parameters: {pace: lockstep}}\n"
        "/**/damper: {ros__parameters: {gain: 0.5}}\n",
        encoding="utf-8",
    )
    with ClosedLoop(scenario, controller=[*process(controllers.Damper), *own]) as loop:
        result = loop.run(0.1)
    assert result.forces.force.tolist() == (-gain * result.states.velocity).tolist()


@pytest.mark.long
@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (process(controllers.RefusingToStart), "/feed_drive/managed_feedback could not be activ"),
        ([sys.executable, "-c", "raise SystemExit(3)"], r"SystemExit\(3\).* has ended \(exit stat"),
    ],
)
def test_a_controller_that_does_not_start_is_reported(command: list[str], sentence: str) -> None:
    with pytest.raises(RunError, match=sentence), ClosedLoop("paper", controller=command) as loop:
        loop.run(1.0)


@pytest.mark.long
def test_the_test_may_start_a_controller_by_itself() -> None:
    with ClosedLoop("paper", controller="external") as loop:
        command = [*process(WithoutArguments), *loop.ros_arguments]
        with subprocess.Popen(command, env=loop.environment) as controller:
            try:
                assert_every_sample_is_answered(loop.run(0.5))
            finally:
                controller.kill()


def test_the_motion_goes_on_in_a_further_run(tmp_path: Path) -> None:
    with ClosedLoop("paper", bag=tmp_path / "bag") as loop:
        first, second = loop.run(1.0), loop.run(2.0)
    assert (len(first.states.stamp), len(second.states.stamp)) == (101, 201)
    assert second.states.stamp[0] == first.states.stamp[-1] + SECOND // 100
    assert second.states.position[0] == first.states.position[-1]
    for name, result in (("bag", first), ("bag_2", second)):
        with Recording(tmp_path / name) as recording:
            assert recording.complete
            np.testing.assert_array_equal(recording.joint_states.stamp, result.states.stamp)


def test_measures_are_those_of_the_run() -> None:
    rate = "plant.rate=20.0"  # a busy machine takes seconds for some thousand exchanges
    with ClosedLoop("paper", rate, "plant.belt_speed=0.3", controller=None) as loop:
        vibrating = loop.run(40.0)
    assert vibrating.measures.regime == "stick_slip"
    assert vibrating.peak_force is None
    assert vibrating.late_forces == 0
    settling = ("washout_controller.corner_frequency=0.5", "washout_controller.linear_gain=-2.0")
    with ClosedLoop("paper", rate, *settling) as loop:
        loop.run(60.0)
        resting = loop.run(20.0)
    assert resting.measures.regime == "equilibrium"
    assert resting.resting_force == pytest.approx(0.0, abs=1e-3)
    assert resting.diagnostics["washout_controller"].figures["answered"] == 1602


def test_parameters_and_disturbance_are_changed_between_runs() -> None:
    with ClosedLoop("paper") as loop:
        before = loop.run(0.5)
        loop.set("plant.belt_speed=0.2", "washout_controller.linear_gain=-2.0")
        loop.disturb(0.25)
        after = loop.run(0.5)
        assert loop.scenario.washout_controller.linear_gain == -2.0
    assert set(before.states.belt_velocity) == {0.4}
    assert set(after.states.belt_velocity) == {0.2}
    assert before.disturbances.force.tolist() == []
    assert after.disturbances.force.tolist() == [0.25]
    assert after.disturbances.stamp[0] == after.states.stamp[0]


def test_a_scenario_that_expects_no_control_has_no_controller() -> None:
    variants: list[dict[str, Any]] = [{"controller": None}, {}]
    for options in variants:
        overrides = () if options else ("plant.expects_control=false",)
        with ClosedLoop("paper", *overrides, **options) as loop:
            assert not loop.scenario.plant.expects_control
            result = loop.run(0.1)
            with pytest.raises(InvalidInputError, match="=true is refused: this loop has no contr"):
                loop.set("plant.expects_control=true")
        assert (len(result.states.stamp), len(result.forces.stamp)) == (11, 0)
    with pytest.raises(InvalidInputError, match="this loop has no controller"):
        ClosedLoop("paper", "plant.expects_control=true", controller=None)


@pytest.mark.parametrize(
    ("written", "error", "sentence"),
    [
        (0, BagError("no space left"), ""),
        (401, BagError("no space left"), ""),
        (101, None, r": it has 5\d of 201 samples"),
    ],
)
def test_a_run_that_is_not_recorded_whole_fails(
    monkeypatch: pytest.MonkeyPatch, written: int, error: BagError | None, sentence: str
) -> None:
    """No gap shows that the last samples are missing; the plant knows how many there were."""
    write, left = Recorder.write, iter(range(written))

    def write_some(self: Recorder, *message: Any) -> None:
        if next(left, None) is not None:
            write(self, *message)
        elif error is not None:
            raise error

    monkeypatch.setattr(Recorder, "write", write_some)
    refusal = f"the recording of the run failed{sentence}"
    with ClosedLoop("paper") as loop, pytest.raises(RunError, match=refusal):
        loop.run(2.0)


def test_a_bad_change_changes_nothing() -> None:
    with pytest.raises(InvalidInputError, match=r"analyzer\.bag=elsewhere is refused.*`bag`"):
        ClosedLoop("paper", "analyzer.bag=elsewhere")
    refused = {
        "plant.mass=-1.0": "mass",
        "plant.mas=1.0": "mas",
        "mass": "mass",
        "washout_controller.d=1.0": "d",
        "analyzer.bag=elsewhere": r"analyzer\.bag=elsewhere is refused",
    }
    with ClosedLoop("paper") as loop:
        loop.run(0.1)
        active = {"washout_controller.wait_for=[plant]": "wait_for cannot be changed while"}
        for change, sentence in {**refused, **active}.items():
            with pytest.raises(InvalidInputError, match=sentence):
                loop.set("plant.belt_speed=0.2", change)
        assert set(loop.run(0.1).states.belt_velocity) == {0.4}
    with ClosedLoop("paper", controller=WithoutArguments) as loop:
        with pytest.raises(InvalidInputError, match="washout_controller is not part of this loop"):
            loop.set("plant.belt_speed=0.2", "washout_controller.linear_gain=-2.0")
        assert set(loop.run(0.1).states.belt_velocity) == {0.4}


@pytest.mark.parametrize("rate", [100.0, 19.0])
def test_what_a_controller_raises_ends_the_run(rate: float) -> None:
    """Also what it raises after its last answer, of 20."""
    with ClosedLoop("paper", f"plant.rate={rate}", controller=controllers.Raising) as loop:
        for _ in range(2):
            with pytest.raises(RunError, match="velocity_feedback raised ValueError: twenty") as it:
                loop.run(1.0)
            assert isinstance(it.value.__cause__, ValueError)
            assert it.value.__cause__.__traceback__ is not None


def test_what_a_controller_raises_between_runs_is_not_lost() -> None:
    raising = controllers.RaisingByItself
    with (
        pytest.raises(RunError, match="raised ValueError: by itself"),
        ClosedLoop("paper", controller=raising),
    ):
        raising.about_to_raise.wait()


def test_without_an_answer_the_run_goes_on() -> None:
    options: dict[str, Any] = {"controller": controllers.Silent}
    with ClosedLoop("paper", "plant.reply_timeout=0.2", **options) as loop:
        result = loop.run(1.0)
    assert (len(result.states.stamp), len(result.forces.stamp)) == (101, 0)
    assert result.late_forces == 100
    assert "no control force arrives" in result.diagnostics["plant"].message


def test_a_run_that_takes_too_long_is_ended() -> None:
    with ClosedLoop("paper", controller=controllers.Silent) as loop:
        for timeout in (0.1, 0.2):
            with pytest.raises(RunError, match=f"took more than {timeout} s: 1 samples so far"):
                loop.run(1.0, timeout=timeout)


class _BestEffort(Node):
    def __init__(self) -> None:
        super().__init__("best_effort")
        self.create_publisher(WrenchStamped, "control_force", qos_profile_sensor_data)
        self.create_subscription(JointState, "joint_states", lambda _: None, 10)


@pytest.mark.long
def test_a_controller_that_is_not_found_is_explained() -> None:
    with pytest.raises(RunError) as told, ClosedLoop("paper", controller=_BestEffort) as loop:
        loop.run(1.0)
    for sentence in ("/feed_drive/best_effort", "Best effort publisher"):
        assert sentence in str(told.value)


def test_invalid_input_is_refused() -> None:
    refusals: list[tuple[dict[str, Any], str]] = [
        ({"controller": "python my.py"}, "controller = 'python my.py' is invalid: must be a class"),
        ({"controller": []}, r"controller = \[\] is invalid"),
        ({"controller": ["no_such_command"]}, "no command 'no_such_command'"),
        ({"controller": lambda: 5}, "made 5, not an rclpy node"),
        ({"controller": controllers.Refusing}, "refusing could not be configured: failure"),
        ({"namespace": "a b"}, "namespace = 'a b' is refused"),
        ({"namespace": "/" + 230 * "n"}, "must have at most 200 characters"),
    ]
    for options, sentence in refusals:
        with pytest.raises((InvalidInputError, RunError), match=sentence):
            ClosedLoop("paper", **options).__enter__()


def test_a_loop_has_to_be_open_and_to_run_for_some_time(tmp_path: Path) -> None:
    loop = ClosedLoop("paper")
    with pytest.raises(RunError, match="not open"):
        loop.run(1.0)
    with pytest.raises(RunError, match="not open"):
        _ = loop.environment
    with loop:
        for duration in (0.0, -1.0, float("inf"), float("nan")):
            with pytest.raises(InvalidInputError, match=f"duration = {duration} s is invalid"):
                loop.run(duration)
    with pytest.raises(BagError, match="exists already"):
        ClosedLoop("paper", bag=tmp_path)


def test_where_the_default_context_is_in_use_the_loop_has_its_own() -> None:
    rclpy.init(args=["--ros-args", "--disable-external-lib-logs"], domain_id=0)
    try:
        with (
            pytest.raises(InvalidInputError, match="does not take `context`"),
            ClosedLoop("paper", controller=WithoutArguments),
        ):
            pass
        with ClosedLoop("paper", controller=VelocityFeedback) as loop:
            assert loop.run(0.1).late_forces == 0
        assert rclpy.ok()
    finally:
        rclpy.shutdown()


def test_two_loops_do_not_meet() -> None:
    with (
        ClosedLoop("paper", controller=WithoutArguments) as first,
        ClosedLoop("paper", controller=VelocityFeedback) as second,
    ):
        for loop in (first, second, first, second):
            assert_every_sample_is_answered(loop.run(0.2))


def _in_use() -> dict[str, Any]:
    maps = Path("/proc/self/maps").read_text(encoding="utf-8")
    return {
        "environment": dict(os.environ),
        "tasks": len(os.listdir("/proc/self/task")),
        "files": len(os.listdir("/proc/self/fd")),
        "shared memory": sum("/dev/shm/" in line for line in maps.splitlines()),
        "threads": threading.active_count(),
        "default context": rclpy.ok(),
    }


@pytest.fixture
def no_collection() -> Iterator[None]:
    """What is left to the garbage collector is left for as long as it likes."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.usefixtures("no_collection")
@pytest.mark.parametrize("controller", [controllers.Managed, "washout"])
def test_nothing_is_left_behind(
    controller: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))

    def use() -> None:
        with ClosedLoop("paper", controller=controller) as loop:
            loop.run(0.1)

    use()  # what the middleware keeps for all of the process
    before = _in_use()
    use()
    with pytest.raises(ZeroDivisionError), ClosedLoop("paper", controller=controller):
        raise ZeroDivisionError
    assert _in_use() == before
    assert list(tmp_path.iterdir()) == []


@pytest.mark.process
@pytest.mark.usefixtures("no_collection")
def test_a_fork_has_nothing_of_a_closed_loop_to_finalise() -> None:
    """Not even of one whose run failed: what raised held the nodes for longer."""
    with pytest.raises(RunError), ClosedLoop("paper") as loop:
        loop.run(20.0, timeout=0.01)
    child = multiprocessing.get_context("fork").Process(target=gc.collect)
    child.start()
    child.join(PATIENCE)
    child.kill()
    assert child.exitcode == 0


@pytest.mark.process
def test_no_process_is_left_behind(tmp_path: Path) -> None:
    """Not even where it was started by a shell, and does not care for SIGINT."""
    ignoring = "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_IGN); "
    ignoring += "pipe = open(sys.argv[1], 'w'); print(1, file=pipe, flush=True); signal.pause()"
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    shell = ["sh", "-c", f'{sys.executable} -c "{ignoring}" {pipe} & wait']
    with ClosedLoop("paper", controller=shell):
        written = pipe.open()
        assert written.readline() == "1\n"
    with written:
        ended, _, _ = select([written], [], [], 60.0)
        assert ended
        assert written.read() == ""


def test_what_an_earlier_call_named_may_fall_idle() -> None:
    with ClosedLoop("paper", controller=None) as loop:
        loop.disturb(0.1)
        loop.set("plant.disturbance.kind=none")
        assert loop.scenario.plant.disturbance.amplitude == 0.1
        with pytest.raises(InvalidInputError, match="amplitude is not used by the kind none"):
            loop.set("plant.disturbance.amplitude=0.2")
    with pytest.raises(InvalidInputError, match="real_time_factor is not used by the pace lock"):
        ClosedLoop("paper", "plant.real_time_factor=2")
    assert ClosedLoop("paper", "plant.pace=realtime").scenario.plant.pace == "realtime"
