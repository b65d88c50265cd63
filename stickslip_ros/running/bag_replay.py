"""Replay one bag in this process."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import rclpy
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from stickslip_ros.errors import RunError
from stickslip_ros.nodes.base.process import initialise, run_until_stopped
from stickslip_ros.nodes.replay import ReplayNode


def replay_bag(
    parameters: Mapping[str, Any],
    offering: Callable[[Sequence[str]], None],
    progress: Callable[[float], None],
) -> bool:
    """Replay a bag in this process; return whether a signal ended the replay before the bag did.

    `parameters` are those of the node, by name. `offering` receives the topics when the node
    publishes them, and `progress` receives the share of the recorded time that is done. Raises
    InvalidInputError for refused parameters, BagError if the bag cannot be read further, and
    RunError for other failures.
    """
    initialise()
    try:
        node = _OneReplay(offering, progress, overrides=parameters)
        run_until_stopped(node)
        return not node.ended
    finally:
        rclpy.try_shutdown()


class _OneReplay(ReplayNode):
    """A replay that runs until the bag or a signal ends it, and reports its progress."""

    def __init__(
        self,
        offering: Callable[[Sequence[str]], None],
        progress: Callable[[float], None],
        **options: Any,
    ) -> None:
        super().__init__(**options)
        self._offering = offering
        self._progress = progress
        self.ended = False
        """Whether the replay reached the end of the bag."""
        self.every(0.1, self._tell_progress)

    def connect(self) -> None:
        super().connect()
        self._offering(sorted(self._writers))

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        self.end_process(RunError("the replay failed for the reason above"))
        return super().on_error(state)

    def _end(self) -> None:
        super()._end()
        self.ended = True
        self.end_process(self._player.failure if self._player is not None else None)

    def _tell_progress(self) -> None:
        if self._position > 0.0:
            done = self._position - self.parameters.start
            self._progress(done / max(self._selection.length, 1e-9))
