"""Control laws of other packages that answer with anything: each command ends in a sentence."""

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from importlib import import_module
from math import inf, nan
from typing import Any, ClassVar

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.errors import RunError
from stickslip_ros.model.constants import constant
from stickslip_ros.model.control import CONTROL_LAWS, ControlLaw, VelocityFeedback
from stickslip_ros.model.control.base import LinearFeedback
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    NODE_PARAMETERS,
    ControllerParameters,
)
from tests.app.conftest import Run

Install = Callable[..., None]

POINTS = ("--json", "--transient", "2", "--cycles", "3")
SWEEP = ("sweep", "paper", "--over", "plant.belt_speed=0.3:0.4:2", *POINTS)
BASIN = ("basin", "paper", "--position=-1:1:2", "--velocity=-1:1:2", *POINTS)


class _Unprintable:
    def __repr__(self) -> str:
        raise RuntimeError


class _UnprintableError(Exception):
    def __str__(self) -> str:
        raise RuntimeError


def _raising(error: BaseException) -> Callable[..., Any]:
    def fail(*_: Any) -> Any:
        raise error

    return fail


def _endless(law: Any, state: Any, elapsed: Any, sample: Any, reference: Any) -> Any:
    return _endless(law, state, elapsed, sample, reference)  # with *_, 3.13.0 has no limit


@pytest.fixture
def install() -> Iterator[Install]:
    """Add the law `hostile`, a damper, with other members."""
    import_module("stickslip_ros.studies.plan")  # keeps the nodes that are known when it is loaded

    @dataclass(frozen=True)
    class Damper(ControlLaw):
        name: ClassVar[str] = "hostile"
        gain: float = constant(1.0, "Gain.", "N s/m")

        def respond(self, state: Any, elapsed: Any, sample: Any, reference: Any) -> Any:
            return -self.gain * sample.velocity, state

    def add(**members: Any) -> None:
        law = dataclass(frozen=True)(type("Hostile", (Damper,), members))
        CONTROL_LAWS[law.name] = law
        made = object.__new__(law)  # as if it failed from now on
        vars(made).update(vars(Damper()))
        model = ControllerParameters(control_law=made)
        CONTROLLER_PARAMETERS[law.name] = NODE_PARAMETERS["hostile_controller"] = model

    yield add
    for known in (CONTROL_LAWS, CONTROLLER_PARAMETERS):
        known.pop("hostile", None)
    NODE_PARAMETERS.pop("hostile_controller", None)


NUMBER = "which must be a finite number"
STATE = "which must be a tuple of finite numbers, as many at every sample"
ANSWERS: dict[str, tuple[Callable[..., Any], str]] = {
    "nan": (lambda *_: (nan, ()), f"its force is nan, {NUMBER}"),
    "inf": (lambda *_: (inf, ()), f"its force is inf, {NUMBER}"),
    "text": (lambda *_: ("3", ()), f"its force is '3', {NUMBER}"),
    "None": (lambda *_: (None, ()), f"its force is None, {NUMBER}"),
    "a larger int": (lambda *_: (10**5000, ()), f"its force is an object of class int, {NUMBER}"),
    "an array": (lambda *_: (np.ones(2), ()), f"its force is array([1., 1.]), {NUMBER}"),
    "bool": (lambda *_: (True, ()), f"its force is True, {NUMBER}"),
    "unprintable": (
        lambda *_: (_Unprintable(), ()),
        f"its force is an object of class _Unprintable, {NUMBER}",
    ),
    "no pair": (lambda *_: None, "TypeError: cannot unpack non-iterable NoneType object"),
    "an error": (_raising(OSError("no\ndevice")), "OSError: no device"),
    "its own error": (
        _raising(_UnprintableError()),
        "tests.app.test_hostile_laws._UnprintableError: <exception str() failed>",
    ),
    "recursion": (_endless, "RecursionError: maximum recursion depth exceeded"),
    "exit": (lambda *_: sys.exit(3), "SystemExit: 3"),
    "state None": (lambda *_: (0.0, None), f"its state is None, {STATE}"),
    "a longer state": (lambda *_: (0.0, (1.0,)), f"its state is (1.0,), {STATE}"),
    "state of text": (lambda *_: (0.0, "a"), f"its state is 'a', {STATE}"),
}


def test_an_answer_that_is_none_ends_in_a_sentence(install: Install, stickslip: Run) -> None:
    for respond, reason in ANSWERS.values():
        install(respond=respond)
        done = stickslip("simulate", "paper", "--duration", "1", "--controller", "hostile")
        assert (done.returncode, done.stdout) == (1, "")
        last = done.stderr.splitlines()[-1]
        assert last == f"stickslip simulate: the control law hostile fails at 0 s: {reason}"


@pytest.mark.parametrize("answer", ["nan", "exit"])
def test_in_a_study_it_is_the_reason_of_each_point(
    install: Install, stickslip: Run, answer: str
) -> None:
    respond, reason = ANSWERS[answer]
    install(respond=respond)
    whole = f"the control law hostile fails at 0 s: {reason}"
    for command in (SWEEP, BASIN):
        done = stickslip(*command, "--controller", "hostile")
        assert done.returncode == 0
        reasons = json.loads(done.stdout)["reason"]
        assert reasons == [whole] * len(reasons)
    scenario = ss.scenario("paper", controller="hostile")
    found = ss.sweep(scenario, "plant.belt_speed=0.3:0.4:2", transient=2.0, cycles=3)
    assert found.to_xarray()["reason"].values.tolist() == [whole, whole]
    with pytest.raises(RunError) as failed:
        ss.simulate(scenario, 1.0)
    assert str(failed.value) == whole


def test_an_initial_state_that_is_none_ends_in_a_sentence(install: Install, stickslip: Run) -> None:
    for initial, reason in (
        (_raising(KeyError("x")), "KeyError: 'x'"),
        (lambda *_: None, f"its state is None, {STATE}"),
        (lambda *_: (1.0, inf), f"its state is (1.0, inf), {STATE}"),
    ):
        install(initial_state=initial)
        done = stickslip("simulate", "paper", "--duration", "1", "--controller", "hostile")
        assert done.returncode == 1
        assert done.stderr.endswith(f"the control law hostile fails at 0 s: {reason}\n")


def test_the_time_is_that_of_the_sample(install: Install, stickslip: Run) -> None:
    install(respond=lambda _, state, elapsed, sample, __: (nan if sample.velocity else 0.0, state))
    done = stickslip("simulate", "paper", "--duration", "1", "--controller", "hostile")
    assert "the control law hostile fails at 0.01 s: its force is nan" in done.stderr


def test_any_real_number_is_a_force(install: Install) -> None:
    for force in (np.float32(0.5), np.float64(0.5), np.int64(0), 0, Fraction(1, 2)):
        found = []
        for each in (force, float(force)):
            install(respond=lambda _, state, *__, answer=each: (answer, state))
            found.append(ss.simulate(ss.scenario("paper", controller="hostile"), 1.0).measures)
        assert found[0] == found[1]


def zeros(*shape: int) -> Any:
    return np.zeros(shape)


@dataclass(frozen=True)
class _Absolute(VelocityFeedback):
    def control_force(self, position: Any, speed: Any, states: Any) -> Any:
        return [] if isinstance(speed, float) else speed


FORMS: dict[str, tuple[dict[str, Any], str]] = {
    "linear_feedback raises": (
        {"linear_feedback": _raising(OSError("no table"))},
        "OSError: no table",
    ),
    "linear_feedback has a wrong shape": (
        {
            "linear_feedback": lambda *_: LinearFeedback(
                zeros(2, 2), zeros(1, 2), zeros(2), zeros(2)
            )
        },
        "its linear_feedback has the shapes [(2, 2), (1, 2), (2,), (2,)], which must be (n, n), "
        "(n, 2), (n,) and (2,), of finite numbers",
    ),
    "linear_feedback is nan": (
        {"linear_feedback": lambda *_: LinearFeedback(*(nan * zeros(2, 2),) * 4)},
        "its linear_feedback has the shapes [(2, 2), (2, 2), (2, 2), (2, 2)], which must be",
    ),
    "continuous raises": ({"continuous": property(_raising(OSError("no")))}, "OSError: no"),
    "continuous gives no number": (
        {"continuous": _Absolute(1.0, 1.0)},
        "TypeError: float() argument must be a string or a real number, not 'list'",
    ),
    "continuous is nan": (
        {"continuous": VelocityFeedback(1.0, nan)},
        "its continuous form: [nan], which must be finite numbers",
    ),
    "refusal raises": ({"refusal": _raising(KeyError("gains"))}, "KeyError: 'gains'"),
    "it cannot be made": (
        {"__post_init__": _raising(OSError("no licence"))},
        "OSError: no licence",
    ),
}


STABILITY = ("stability", "paper")
CONTINUOUS = ("simulate", "paper", "--duration", "1", "--continuous-control")


def test_a_form_that_is_none_is_refused_with_the_values(install: Install, stickslip: Run) -> None:
    for form, command in (
        *((form, STABILITY) for form in FORMS),
        ("continuous raises", CONTINUOUS),
        ("linear_feedback is nan", SWEEP),
        ("refusal raises", BASIN),
    ):
        members, reason = FORMS[form]
        install(**members)
        done = stickslip(*command, "--controller", "hostile")
        assert (done.returncode, done.stdout) == (2, "")
        values = "force_limit = inf, start_after = 0.0, gain = 1.0"
        given = "" if "__post_init__" in members else f" with {values}"
        (line,) = done.stderr.splitlines()
        assert f"hostile_controller: law hostile{given} fails: {reason}" in line


def test_a_design_proposes_gains_of_another_law(install: Install, stickslip: Run) -> None:
    install(respond=_raising(KeyError("x")))
    done = stickslip("design", "paper", "--controller", "hostile")
    assert "Traceback" not in done.stderr
    assert done.returncode == 2
