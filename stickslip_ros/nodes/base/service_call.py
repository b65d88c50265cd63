"""Call a service of another node, even if the middleware is slow or loses messages."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future

ANSWER_TIME = 1.0
"""Time, s, for a client to match an existing service, and then to get its answer."""


class ServiceCall:
    """Calls a service as soon as it exists, until it has answered.

    A client may never match an existing service, and an answer may be lost. Then a new client
    repeats the request, and has twice the time. So the service may get the request more than once.
    The earlier clients stay: to answer one that is gone takes a service 0.1 s, and it complains.
    """

    def __init__(
        self, node: Node, kind: Any, service: str, *, answer_time: float = ANSWER_TIME
    ) -> None:
        """Prepare to call a service through `node`; the first answer may take `answer_time` (s)."""
        self._node = node
        self._kind = kind
        self._service = service
        self._answer_time = answer_time
        self._clients = [self._new_client()]
        self._pending: Future | None = None
        self._factor = 1.0

    def start(self, request: Any, on_answer: Callable[[Any], None] = lambda _: None) -> None:
        """Send this request from now on, in place of an earlier one."""
        self._request = request
        self._on_answer = on_answer
        self.answer: Any = None
        """The answer; None until it arrives."""
        self._pending = None
        self._attempt_ends: float | None = None

    @property
    def sent(self) -> bool:
        """Whether the request was sent."""
        return self._pending is not None

    def pursue(self) -> bool:
        """Do the next step; call this repeatedly. Return whether the answer has arrived."""
        if self.answer is not None:
            return True
        if not self._node.count_services(self._service):
            return False
        now = time.monotonic()
        if self._attempt_ends is not None and now > self._attempt_ends:
            self._clients.append(self._new_client())
            self._pending = self._attempt_ends = None
            self._factor *= 2.0
        if self._attempt_ends is None:
            self._attempt_ends = now + ANSWER_TIME * self._factor
        if self._pending is None and self._clients[-1].service_is_ready():
            self._attempt_ends = now + self._answer_time * self._factor
            self._pending = self._clients[-1].call_async(self._request)
            self._pending.add_done_callback(self._take)
        return False

    def close(self) -> None:
        """Stop; ignore an answer that still arrives."""
        self._pending = None
        for client in self._clients:
            self._node.destroy_client(client)

    def _new_client(self) -> Client:
        return self._node.create_client(self._kind, self._service)

    def _take(self, pending: Future) -> None:
        response = pending.result()
        if response is not None and pending is self._pending:
            self.answer = response
            self._factor = 1.0
            self._on_answer(response)


def parameters_call(
    node: Node, other: str, names: Sequence[str], on_answer: Callable[[dict[str, Any]], None]
) -> ServiceCall:
    """Return a call that requests the named parameters of the node `other`."""

    def take(response: Any) -> None:
        values: list[Any] = []
        with suppress(RuntimeError):  # a type that ROS does not know
            values += map(parameter_value_to_python, response.values)
        on_answer(dict(zip(names, values, strict=False)))

    call = ServiceCall(node, GetParameters, f"{other}/get_parameters")
    call.start(GetParameters.Request(names=names), take)
    return call
