"""Messages that a node received and dropped."""

import time
from math import inf
from typing import Any

from rclpy.impl.rcutils_logger import RcutilsLogger


class DroppedMessages:
    """Counts dropped messages and keeps the last reason, which is a complaint for 15 s."""

    def __init__(self, logger: RcutilsLogger) -> None:
        """Start counting; the first message dropped after a pause is logged."""
        self._logger = logger
        self._number = 0
        self._last = ""
        self._complaint_ends = -inf

    def add(self, reason: str, number: int = 1) -> None:
        """Count `number` dropped messages; `reason` is a sentence about the last of them."""
        now = time.monotonic()
        if now > self._complaint_ends:
            self._logger.warning(reason)
        self._number += number
        self._last = reason
        self._complaint_ends = now + 15.0

    @property
    def complaint(self) -> str:
        """Current complaint; empty if there is none."""
        if time.monotonic() > self._complaint_ends:
            return ""
        return f"{self._number} messages dropped so far, the last: {self._last}"

    @property
    def figures(self) -> dict[str, Any]:
        """Number and last reason, for the diagnostics."""
        return {"dropped_messages": self._number, "last_dropped": self._last or "none"}
