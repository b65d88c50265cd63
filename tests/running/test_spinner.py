"""Waiting for conditions and answers while nodes run."""

import time
from collections.abc import Iterator
from typing import Any

import pytest
from rclpy.node import Node
from std_srvs.srv import Trigger

from stickslip_ros.nodes.base.machine import own_domain
from stickslip_ros.nodes.base.process import ros_context
from stickslip_ros.nodes.base.service_call import ServiceCall
from stickslip_ros.running.spinner import Spinner


@pytest.fixture
def node() -> Iterator[Node]:
    with own_domain() as domain, ros_context(domain, ["--ros-args"]) as context:
        yield Node("waiting", context=context)


@pytest.fixture
def spinner(node: Node) -> Iterator[Spinner]:
    spinner = Spinner(node.context)
    spinner.add(node)
    yield spinner
    spinner.close()


def answer_once(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    response.message = "here"
    return response


def test_time_ends_waiting_though_there_is_always_a_callback_to_run(spinner: Spinner) -> None:
    def call_again() -> None:
        spinner.executor.create_task(call_again)
        spinner.executor.create_task(lambda: None)

    call_again()
    started = time.monotonic()
    assert not spinner.spin_until(lambda: False, 0.1)
    assert time.monotonic() - started < 10.0


def test_waiting_is_cut_short(node: Node, spinner: Spinner) -> None:
    rung: list[None] = []
    node.create_timer(0.05, lambda: rung.append(None))
    spinner.is_cut_short = lambda: bool(rung)
    assert not spinner.spin_until(lambda: False)
    assert not spinner.spin_until(lambda: True)


def test_a_service_is_asked_again_and_again_by_one_call(node: Node, spinner: Spinner) -> None:
    call = ServiceCall(node, Trigger, "ring")
    assert spinner.ask(call, Trigger.Request(), 0.1) is None
    assert not call.sent
    service = node.create_service(Trigger, "ring", answer_once)
    answers: list[Any] = [spinner.ask(call, Trigger.Request(), 10.0) for _ in range(2)]
    assert [answer.message for answer in answers] == ["here", "here"]
    assert answers[0] is not answers[1]
    node.destroy_service(service)
    assert spinner.ask(call, Trigger.Request(), 0.2) is None
