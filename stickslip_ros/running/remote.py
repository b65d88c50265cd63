"""Nodes in other processes: getting them ready, and knowing that they are."""

import time
from collections.abc import Callable

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters

from stickslip_ros.errors import RunError
from stickslip_ros.running.composition import Composition

_ANSWER_TIMEOUT = 2.0
_AUTOSTART_TIMEOUT = 1.0
"""Wall time, s, in which a managed node may go on to its next state by itself."""

_NEXT = {
    State.PRIMARY_STATE_UNCONFIGURED: (Transition.TRANSITION_CONFIGURE, "configured"),
    State.PRIMARY_STATE_INACTIVE: (Transition.TRANSITION_ACTIVATE, "activated"),
}


def bring_up(nodes: Composition, name: str, timeout: float, check: Callable[[], None]) -> None:
    """Configure and activate a managed node that does not do so by itself.

    Raises RunError if it refuses or is not active within so much wall time (s), and what `check`
    raises, which is called again and again meanwhile.
    """
    deadline = time.monotonic() + timeout
    asked: set[int] = set()
    done = "brought up"
    while (state := _state(nodes, name)) != State.PRIMARY_STATE_ACTIVE:
        check()
        if state in asked or state == State.PRIMARY_STATE_FINALIZED:
            raise RunError(f"the controller {name} could not be {done}; its log says why")
        if time.monotonic() >= deadline:
            raise RunError(f"the controller {name} was not active within {timeout:g} s")
        if state in _NEXT and not nodes.spin_until(
            lambda s=state: _state(nodes, name) != s, _AUTOSTART_TIMEOUT
        ):
            asked.add(state)
            transition, done = _NEXT[state]
            request = ChangeState.Request(transition=Transition(id=transition))
            nodes.ask(ChangeState, f"{name}/change_state", request, _ANSWER_TIMEOUT)


def greet(nodes: Composition, name: str) -> None:
    """Wait, within bounds, for an answer of a node, with which it knows all that was here before.

    The middleware tells a process of our topics in the order in which we have made them: whoever
    has found what answers are to go to has found plant and analyzer, too.
    """
    nodes.ask(GetParameters, f"{name}/get_parameters", GetParameters.Request(), _ANSWER_TIMEOUT)


def _state(nodes: Composition, name: str) -> int | None:
    answer = nodes.ask(GetState, f"{name}/get_state", GetState.Request(), _ANSWER_TIMEOUT)
    return None if answer is None else answer.current_state.id
