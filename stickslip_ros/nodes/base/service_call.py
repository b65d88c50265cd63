"""Asking another node, where the middleware may not do its part at once."""

from collections.abc import Callable, Sequence
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future

PATIENCE = 10
"""Times that an inquiry is pursued before another client asks; doubled with each."""


class Inquiry:
    """Calls a service as soon as it is there, until it has answered.

    A client may never match a service that is there, and an answer may be lost: then another asks.
    So it may be asked more than once.
    """

    def __init__(
        self,
        inquirer: Node,
        kind: Any,
        service: str,
        request: Any,
        on_answer: Callable[[Any], None],
        patience: int = PATIENCE,
    ) -> None:
        """Call, for `inquirer`, a service of some kind, and pass on its answer.

        `patience` is how often the inquiry is pursued before it is asked a second time.
        """
        self._inquirer = inquirer
        self._kind = kind
        self._service = service
        self._request = request
        self._on_answer = on_answer
        self.answered = False
        """Whether the answer has come."""
        self._closed = False
        self._pursued = 0
        self._patience = patience
        self._client = self._new_client()
        self._answer: Future | None = None

    def pursue(self) -> None:
        """Do what is due; to be called about ten times a second."""
        if self.answered or not self._inquirer.count_services(self._service):
            return
        self._pursued += 1
        if self._pursued > self._patience:
            self._pursued, self._patience = 0, 2 * self._patience
            self._inquirer.destroy_client(self._client)
            self._client, self._answer = self._new_client(), None
        if self._answer is None and self._client.service_is_ready():
            self._answer = self._client.call_async(self._request)
            self._answer.add_done_callback(self._take)

    def close(self) -> None:
        """Ask no more; an answer that comes still is nobody's."""
        self._closed = True
        self._inquirer.destroy_client(self._client)

    def _new_client(self) -> Client:
        return self._inquirer.create_client(self._kind, self._service)

    def _take(self, answer: Future) -> None:
        response = answer.result()
        if response is None or self.answered or self._closed:
            return
        self.answered = True
        self._on_answer(response)


def ask_parameters(
    inquirer: Node, asked: str, names: Sequence[str], on_answer: Callable[[dict[str, Any]], None]
) -> Inquiry:
    """Return an inquiry to the node `asked` for its parameters of these names."""

    def take(response: Any) -> None:
        values = [parameter_value_to_python(value) for value in response.values]
        on_answer(dict(zip(names, values, strict=False)))

    request = GetParameters.Request(names=names)
    return Inquiry(inquirer, GetParameters, f"{asked}/get_parameters", request, take)
