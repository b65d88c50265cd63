"""Nodes on simulated time from the plant."""

from collections.abc import Iterator

import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from stickslip_ros.nodes.plant import PlantNode
from stickslip_ros.nodes.running.composition import ControllerThread
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.record.codec import unpack_header
from stickslip_ros.record.topics import JOINT_STATES
from tests.nodes.graph import Graph

SHORT, LONG = 0.1, 0.25


class User(Node):
    """A node of a user's: its clock and its timers follow /clock, on an executor of its own."""

    def __init__(self, context: Context) -> None:
        use_sim_time = Parameter("use_sim_time", value=True)
        super().__init__(
            "user", context=context, namespace="/test", parameter_overrides=[use_sim_time]
        )
        self.seen: list[tuple[float, int]] = []
        """Period of the timer that fired, s, and what the clock showed, ns."""
        for period in (SHORT, LONG):
            self.create_timer(period, lambda p=period: self._note(p))

    def times(self, period: float | None = None) -> list[int]:
        """Return what the clock showed, ns, as the timer of that period fired, or any did."""
        return [time for p, time in self.seen if period in (None, p)]

    def _note(self, period: float) -> None:
        self.seen.append((period, self.get_clock().now().nanoseconds))


@pytest.fixture
def user(graph: Graph) -> Iterator[User]:
    user = User(graph.context)
    running = ControllerThread(user)
    running.start()
    yield user
    running.close()


@pytest.mark.parametrize(("pace", "factor"), [("lockstep", 1.0), ("realtime", 5.0)])
def test_a_node_on_simulated_time_follows_the_plant(
    graph: Graph, user: User, pace: str, factor: float
) -> None:
    heard = graph.listen(JOINT_STATES, raw=True)
    graph.add(WashoutControllerNode, use_sim_time=True)
    plant = graph.add(
        PlantNode,
        pace=pace,
        real_time_factor=factor,
        publish_clock=True,
        reply_timeout=1.0,
        wait_for=["user", "observer", "washout_controller"],
    )
    graph.wait_until(lambda: len(user.times(LONG)) >= 8, "both timers have fired")
    plant.trigger_deactivate()
    samples = plant.diagnose()[2]["samples"]
    graph.wait_until(lambda: len(heard) == samples, "every sample is heard")
    stamps = [unpack_header(message) for message in heard]

    seen = [time for time in user.times() if time]
    assert seen == sorted(seen)
    assert set(seen) <= set(stamps)
    for period in (SHORT, LONG):
        fired = [time for time in user.times(period) if time]
        # One firing too many at most: the one that sees the time leap to the first stamp.
        for count, time in enumerate(fired, start=1):
            assert count <= (time - stamps[0]) * 1e-9 / period + 2.0
