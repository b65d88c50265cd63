"""Progress and state of a run, from what its nodes publish."""

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from std_msgs.msg import Header

from stickslip_ros.nodes.base import managed
from stickslip_ros.nodes.base.clients import ACTIVE, NEXT_TRANSITION
from stickslip_ros.nodes.base.endpoints import qos_profile
from stickslip_ros.record.topics import DIAGNOSTICS, RECORDED
from stickslip_ros.scenarios import full_name
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.text import number_in

OnSimulatedTime = Callable[[float], None]
"""Called repeatedly with the simulated time so far, s."""

Notify = Callable[[str], None]
"""Called with messages to the user, one sentence each."""


class RunMonitor:
    """Subscribes to the diagnostics of the nodes and to the progress of the recording."""

    def __init__(
        self,
        node: Node,
        *,
        fail: Callable[[str], None],
        notify: Notify,
        on_simulated_time: OnSimulatedTime,
    ) -> None:
        """Subscribe through a node in the run's namespace; call `fail` if the plant fails."""
        self.values: dict[str, dict[str, str]] = {}
        """Last values of each node, as in its diagnostics, by its full name."""
        self.finished = False
        """Whether the plant has reached its end, or was ended from outside."""
        self.plant_stopped = False
        """Whether the plant is no longer active and has published its last values."""
        self.newest_recorded = 0
        """Stamp of the newest sample that the analyzer has received, ns."""
        self.ending = False
        """Whether the run is ending: a plant that stops then is not paused."""
        self._fail, self._notify, self._on_simulated_time = fail, notify, on_simulated_time
        self.recording_failure = ""
        """Why the analyzer could not continue to record; empty if it could."""
        self.recording_ended: bool = False
        """Whether the analyzer has published its last values after it was active."""
        self._namespace = node.get_namespace()
        self._paused = self._forecast_told = False
        self._first_recorded: int | None = None
        node.create_subscription(
            DiagnosticArray, DIAGNOSTICS.name, self._on_diagnostics, qos_profile(DIAGNOSTICS)
        )
        node.create_subscription(Header, RECORDED.name, self._on_recorded, qos_profile(RECORDED))

    @property
    def plant(self) -> dict[str, str]:
        """The plant's last values."""
        return self.values.get(full_name(self._namespace, "plant"), {})

    @property
    def unrecorded(self) -> float:
        """Time from the newest sample that the analyzer has received to the plant's last, s."""
        return (number_in(self.plant.get(managed.NEWEST_STAMP, "")) - self.newest_recorded) * 1e-9

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {entry.key: entry.value for entry in status.values}
            self.values[status.name] = values
            if status.name == full_name(self._namespace, "plant"):
                self._follow_plant(values.get(managed.STATE))
            elif status.name == full_name(self._namespace, "analyzer"):
                self.recording_failure = values.get(managed.FAILURE, self.recording_failure)
                self.recording_ended |= values.get(managed.STATE) == "deactivating"

    def _follow_plant(self, state: str | None) -> None:
        if managed.FORECAST in self.plant and not self._forecast_told:
            self._forecast_told = True
            self._notify(self.plant[managed.FORECAST])
        if managed.FAILURE in self.plant:
            self._fail(f"the plant could not continue: {self.plant[managed.FAILURE]}")
        if state == ACTIVE:
            if self._paused:
                self._notify("the plant continues")
            self._paused = self.plant_stopped = False
        elif managed.NEWEST_STAMP in self.plant:
            self.plant_stopped = True
            if self.plant.get(managed.FINISHED) == str(True) or state == "finalized":
                self.finished = True
            elif state in NEXT_TRANSITION and not (self._paused or self.ending):
                self._paused = True
                self._notify(
                    "the plant is paused: activate it to continue, or end the run with Ctrl-C"
                )

    def _on_recorded(self, message: Header) -> None:
        self.newest_recorded = message.stamp.sec * NANOSECONDS + message.stamp.nanosec
        if self._first_recorded is None:
            self._first_recorded = self.newest_recorded
        self._on_simulated_time((self.newest_recorded - self._first_recorded) * 1e-9)
