"""What a node did not take of what it heard."""

from typing import Any

from stickslip_ros.nodes.base.managed import ManagedNode

_PERIOD = 10.0


class Dropped:
    """Messages that a node dropped: how many of them, and why the last one.

    It complains while that goes on, and between ten and twenty seconds more.
    """

    def __init__(self, node: ManagedNode[Any]) -> None:
        """Count from now on; what is dropped after a quiet time is logged by `node`."""
        self._node = node
        self._logger = node.get_logger()
        self._timer = node.every(_PERIOD, self._forget)
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self._number = 0
        self._last = ""
        self._periods_to_complain = 0

    def add(self, reason: str, number: int = 1) -> None:
        """Count messages, dropped for a reason that is a sentence on the last of them."""
        if not self._periods_to_complain:
            self._logger.warning(reason)
        self._number += number
        self._last = reason
        self._periods_to_complain = 2

    @property
    def complaint(self) -> str:
        """What to say of it at present, if anything."""
        if not self._periods_to_complain:
            return ""
        return f"{self._number} messages dropped so far, the last: {self._last}"

    @property
    def figures(self) -> dict[str, Any]:
        """Number and last reason, if there is one, for the diagnostics."""
        return {"dropped_messages": self._number, "last_dropped": self._last or "none"}

    def destroy(self) -> None:
        """End."""
        self._node.destroy_timer(self._timer)

    def _forget(self) -> None:
        self._periods_to_complain = max(0, self._periods_to_complain - 1)
