"""What a node did not take of what it heard."""

import time
from math import inf
from typing import Any

from rclpy.impl.rcutils_logger import RcutilsLogger


class DroppedMessages:
    """Messages that a node dropped: how many, and why the last one; for 15 s a complaint."""

    def __init__(self, logger: RcutilsLogger) -> None:
        """Count from now on; what is dropped after a quiet time is logged."""
        self._logger = logger
        self._number = 0
        self._last = ""
        self._complaint_ends = -inf

    def add(self, reason: str, number: int = 1) -> None:
        """Count messages, dropped for a reason that is a sentence on the last of them."""
        now = time.monotonic()
        if now > self._complaint_ends:
            self._logger.warning(reason)
        self._number += number
        self._last = reason
        self._complaint_ends = now + 15.0

    @property
    def complaint(self) -> str:
        """What to say of it at present, if anything."""
        if time.monotonic() > self._complaint_ends:
            return ""
        return f"{self._number} messages dropped so far, the last: {self._last}"

    @property
    def figures(self) -> dict[str, Any]:
        """Number and last reason, if there is one, for the diagnostics."""
        return {"dropped_messages": self._number, "last_dropped": self._last or "none"}
