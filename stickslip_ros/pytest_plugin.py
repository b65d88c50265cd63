"""The pytest fixture `closed_loop`; ROS is imported only when a test uses it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from stickslip_ros.testing import ClosedLoop


@pytest.fixture
def closed_loop() -> Iterator[Callable[..., ClosedLoop]]:
    """Open a `stickslip_ros.testing.ClosedLoop` with its arguments; close it after the test."""
    from stickslip_ros.testing import ClosedLoop

    with ExitStack() as opened:

        def open_loop(*arguments: Any, **options: Any) -> ClosedLoop:
            return opened.enter_context(ClosedLoop(*arguments, **options))

        yield open_loop
