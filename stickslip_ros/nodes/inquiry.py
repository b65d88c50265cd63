"""Asking another node what parameters it runs with."""

from collections.abc import Callable, Sequence
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future

_PATIENCE = 10
"""Times that an inquiry is pursued before another client asks; doubled with each."""


class Inquiry:
    """Asks a node for parameters as soon as it is there, until it has answered.

    A client may never match a service that is there, and an answer may be lost: then another asks.
    """

    def __init__(
        self,
        inquirer: Node,
        asked: str,
        names: Sequence[str],
        on_answer: Callable[[dict[str, Any]], None],
    ) -> None:
        """Ask, for `inquirer`, the node `asked` for the parameters called `names`."""
        self._inquirer = inquirer
        self._service = f"{asked}/get_parameters"
        self._names = names
        self._on_answer = on_answer
        self._answered = self._closed = False
        self._pursued = 0
        self._patience = _PATIENCE
        self._client = self._new_client()
        self._answer: Future | None = None

    def pursue(self) -> None:
        """Do what is due; to be called about ten times a second."""
        if self._answered or not self._inquirer.count_services(self._service):
            return
        self._pursued += 1
        if self._pursued > self._patience:
            self._pursued, self._patience = 0, 2 * self._patience
            self._inquirer.destroy_client(self._client)
            self._client, self._answer = self._new_client(), None
        if self._answer is None and self._client.service_is_ready():
            self._answer = self._client.call_async(GetParameters.Request(names=self._names))
            self._answer.add_done_callback(self._take)

    def close(self) -> None:
        """Ask no more; an answer that comes still is nobody's."""
        self._closed = True
        self._inquirer.destroy_client(self._client)

    def _new_client(self) -> Client:
        return self._inquirer.create_client(GetParameters, self._service)

    def _take(self, answer: Future) -> None:
        response = answer.result()
        if response is None or self._answered or self._closed:
            return
        self._answered = True
        values = [parameter_value_to_python(value) for value in response.values]
        self._on_answer(dict(zip(self._names, values, strict=False)))
