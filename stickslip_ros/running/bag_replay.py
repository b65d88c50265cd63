"""Replaying one bag in this process."""

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
    """Replay a bag in this process; return whether a signal ended it before the bag did.

    `parameters` are those of the node by name. `offering` is told the topics when they are offered,
    `progress` now and then which share of the recorded time is done. Raises InvalidInputError for
    what is refused, BagError where the bag cannot be read on, and RunError where all else fails.
    """
    initialise()
    try:
        node = _OneReplay(offering, progress, overrides=parameters)
        run_until_stopped(node)
        return not node.ended
    finally:
        rclpy.try_shutdown()


class _OneReplay(ReplayNode):
    """Runs until the bag or a signal ends it, and says how far it has come."""

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
        """Whether the bag has ended it."""
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
