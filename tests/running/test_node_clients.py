"""States and transitions of a managed node, asked for over its services."""

from collections.abc import Iterator
from typing import Any

import pytest
from lifecycle_msgs.msg import Transition
from rclpy.node import Node

from stickslip_ros.nodes.base.machine import own_domain
from stickslip_ros.nodes.base.process import ros_context
from stickslip_ros.nodes.base.service_call import ServiceCall
from stickslip_ros.nodes.washout_controller import WashoutControllerNode
from stickslip_ros.running.node_clients import LifecycleClient
from stickslip_ros.running.spinner import Spinner

CONFIGURE = Transition.TRANSITION_CONFIGURE
ACTIVATE = Transition.TRANSITION_ACTIVATE


@pytest.fixture
def client() -> Iterator[LifecycleClient]:
    with own_domain() as domain, ros_context(domain, ["--ros-args"]) as context:
        spinner, asking = Spinner(context), Node("asking", context=context)
        spinner.add(asking)
        spinner.add(WashoutControllerNode(context=context, overrides={"autostart": False}))
        yield LifecycleClient(spinner, asking, "washout_controller", 1.0)
        spinner.close()


def test_each_transition_is_made_once(client: LifecycleClient) -> None:
    assert client.state() == "unconfigured"
    assert not client.change_state(ACTIVATE)
    assert client.change_state(CONFIGURE)
    assert client.state() == "inactive"
    assert client.change_state(ACTIVATE)
    assert client.state() == "active"


def test_the_state_replaces_an_answer_that_is_lost(
    client: LifecycleClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    take = ServiceCall._take
    lost: list[Any] = []

    def lose_the_first(call: ServiceCall, pending: Any) -> None:
        if call is client._change_state and not lost:
            lost.append(pending.result())
        else:
            take(call, pending)

    monkeypatch.setattr(ServiceCall, "_take", lose_the_first)
    assert not client.change_state(CONFIGURE)
    assert [answer.success for answer in lost] == [True]
    assert client.change_state(CONFIGURE)
    assert client.change_state(ACTIVATE)
    assert client.state() == "active"
