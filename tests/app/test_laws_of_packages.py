"""Commands with laws of other packages: those of examples/, and some that fail."""

import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from importlib import import_module
from math import inf, nan
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.errors import RunError
from stickslip_ros.model.constants import constant
from stickslip_ros.model.control import ControlLaw, VelocityFeedback
from stickslip_ros.model.control.base import LinearFeedback
from stickslip_ros.scenarios.foreign_laws import CONTROLLERS
from stickslip_ros.scenarios.parameters import ControllerParameters
from tests.app.conftest import Run, RunOfItsOwn
from tests.docs.page import CHECKOUT
from tests.scenarios.foreign_laws import BRAKE, FALLING, make_known, write_example, write_package

Install = Callable[..., None]

BROKEN = "cannot be imported: ModuleNotFoundError: No module named 'no_such'\n"
LUBRICATED = "lubricated_drive.yaml"
STRENGTH = ("--controller", "brake", "-p", "brake_controller.strength=0.3")


@pytest.fixture
def with_packages(process_environment: dict[str, str], tmp_path: Path) -> Run:
    """Run a command in a process that finds packages with laws, two of which are broken."""
    write_package(tmp_path, "brake", {"brake": BRAKE}, {"brake": "brake:Brake"}, CONTROLLERS.group)
    write_package(tmp_path, "bad", {"bad": "import no_such"}, {"bad": "bad:Law"}, CONTROLLERS.group)
    write_package(tmp_path, "falling", {"falling": FALLING}, {"falling": "falling:Falling"})
    warns = "def warning(self):\n        return 1 / 0\n\n    def coefficient"
    late = FALLING.replace('"falling"', '"late"').replace("def coefficient", warns)
    write_package(tmp_path, "late", {"late": late}, {"late": "late:Falling"})
    write_package(tmp_path, "broken", {"broken": "import no_such"}, {"broken": "broken:Law"})
    write_example(tmp_path, "own_control_law")
    write_example(tmp_path, "own_friction_law")
    shutil.copy(CHECKOUT / "examples/own_friction_law" / LUBRICATED, tmp_path)
    return RunOfItsOwn(tmp_path, process_environment)


def test_the_list_has_the_laws_of_other_packages_and_says_which_are_refused(
    with_packages: Run,
) -> None:
    done = with_packages("list")
    assert done.returncode == 0
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    for law, parameters in (
        ("falling Friction that falls with speed.", "static, fall"),
        ("brake Force against the velocity.", "strength, force_limit, start_after"),
    ):
        assert lines[lines.index(law) + 1] == f"parameters: {parameters}"
    assert done.stderr == (
        f"friction law broken is refused: broken:Law of package broken {BROKEN}"
        f"control law bad is refused: bad:Law of package bad {BROKEN}"
    )
    refused = with_packages("simulate", "paper", "--controller", "bad")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr == (
        f"stickslip simulate: --controller: control law bad is refused: bad:Law of package bad "
        f"{BROKEN}"
    )


def test_what_a_law_raises_later_is_told_with_its_package(with_packages: Run) -> None:
    done = with_packages("simulate", "paper", "-p", "plant.friction.law=late", "--duration", "1")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.endswith(
        "simulate: law late of package late fails: ZeroDivisionError: division by zero\n"
    )


def test_a_control_law_of_another_package_runs_as_a_node(with_packages: Run) -> None:
    """In a process of its own it does in docs/how-to/write-a-control-law.md."""
    found = with_packages.json("run", "paper", *STRENGTH, "--duration", "5", "--composed")
    assert found["controller"] == "/feed_drive/brake_controller"
    assert found["report"]["peak_force"] > 0.0


def test_the_drive_of_the_example_vibrates_by_its_own_law(with_packages: Run) -> None:
    found = with_packages.json("simulate", LUBRICATED, "--no-control", "--duration", "1.3")
    assert found["regime"] == "stick_slip"


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
def install(monkeypatch: pytest.MonkeyPatch) -> Install:
    """Add the law `hostile`, a damper, with other members."""
    import_module("stickslip_ros.studies.plan")  # keeps the nodes that are known when it is loaded

    @dataclass(frozen=True)
    class Damper(ControlLaw):
        name: ClassVar[str] = "hostile"
        package: ClassVar[str] = "others"
        gain: float = constant(1.0, "Gain.", "N s/m")

        def respond(self, state: Any, elapsed: Any, sample: Any, reference: Any) -> Any:
            return -self.gain * sample.velocity, state

    def add(**members: Any) -> None:
        law = dataclass(frozen=True)(type("Hostile", (Damper,), members))
        made = object.__new__(law)  # as if it failed from now on
        vars(made).update(vars(Damper()))
        make_known(monkeypatch, law, ControllerParameters(control_law=made))

    return add


LAW = "the control law hostile of package others"
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
        "tests.app.test_laws_of_packages._UnprintableError: <exception str() failed>",
    ),
    "recursion": (_endless, "RecursionError: maximum recursion depth exceeded"),
    "exit": (lambda *_: sys.exit(3), "SystemExit: 3"),
    "state None": (lambda *_: (0.0, None), f"its state is None, {STATE}"),
    "a longer state": (lambda *_: (0.0, (1.0,)), f"its state is (1.0,), {STATE}"),
    "state of text": (lambda *_: (0.0, "a"), f"its state is 'a', {STATE}"),
}


def test_an_answer_that_is_none_ends_in_a_sentence(install: Install, stickslip: Run) -> None:
    for member, given, time, reason in (
        *(("respond", respond, "0", reason) for respond, reason in ANSWERS.values()),
        ("respond", lambda *a: (nan if a[3].velocity else 0.0, a[1]), "0.01", "its force is nan, "),
        ("initial_state", _raising(KeyError("x")), "0", "KeyError: 'x'"),
        ("initial_state", lambda *_: None, "0", f"its state is None, {STATE}"),
        ("initial_state", lambda *_: (1.0, inf), "0", f"its state is (1.0, inf), {STATE}"),
    ):
        install(**{member: given})
        done = stickslip("simulate", "paper", "--duration", "1", "--controller", "hostile")
        assert (done.returncode, done.stdout) == (1, "")
        last = done.stderr.splitlines()[-1]
        assert last.startswith(f"stickslip simulate: {LAW} fails at {time} s: {reason}")


def test_in_a_study_it_is_the_reason_of_each_point(install: Install, stickslip: Run) -> None:
    respond, reason = ANSWERS["nan"]
    install(respond=respond)
    whole = f"{LAW} fails at 0 s: {reason}"
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


def test_any_real_number_is_a_force(install: Install) -> None:
    for force in (np.float32(0.5), np.float64(0.5), np.int64(0), 0, Fraction(1, 2)):
        found = []
        for each in (force, float(force)):
            install(respond=lambda _, state, *__, answer=each: (answer, state))
            found.append(ss.simulate(ss.scenario("paper", controller="hostile"), 1.0).measures)
        assert found[0] == found[1]


FORMS: dict[str, tuple[dict[str, Any], str]] = {
    "linear_feedback raises": ({"linear_feedback": _raising(OSError("no"))}, "OSError: no"),
    "linear_feedback is nan": (
        {"linear_feedback": lambda *_: LinearFeedback(*(nan * np.zeros((2, 2)),) * 4)},
        "its linear_feedback is [nan, ",
    ),
    "continuous raises": ({"continuous": property(_raising(OSError("no")))}, "OSError: no"),
    "continuous is nan": (
        {"continuous": VelocityFeedback(1.0, nan)},
        "its continuous form is [nan], which must be finite numbers",
    ),
    "refusal raises": ({"refusal": _raising(KeyError("gains"))}, "KeyError: 'gains'"),
    "it cannot be made": ({"__post_init__": _raising(OSError("no key"))}, "OSError: no key"),
}


STABILITY = ("stability", "paper")
CONTINUOUS = ("simulate", "paper", "--duration", "1", "--continuous-control")


def test_a_form_that_is_none_is_refused_with_the_package(install: Install, stickslip: Run) -> None:
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
        (line,) = done.stderr.splitlines()
        assert f"hostile_controller: law hostile of package others fails: {reason}" in line


def test_a_design_of_a_law_that_names_no_gains_is_refused(install: Install, stickslip: Run) -> None:
    install(respond=_raising(KeyError("x")))
    done = stickslip("design", "paper", "--controller", "hostile")
    assert done.returncode == 2
    assert "control law hostile has no gains to tune" in done.stderr
