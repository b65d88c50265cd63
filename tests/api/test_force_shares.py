"""What is said of a drive does not depend on how normal force and coefficients share a force."""

from collections.abc import Callable
from typing import Any

import pytest

import stickslip_ros as ss

NOT_COMPARED = {"scenario", "parameters", "parameter_file", "overrides"}
"""Of a scenario, not of its motion."""

ANSWERS: dict[str, Callable[[ss.Scenario, ss.Scenario], Any]] = {
    "sweep": lambda free, _: ss.sweep(free, belt_speed=("20 mm/s", "60 mm/s", 2)),
    "basin": lambda free, _: ss.basin(
        free, position=("-1 mm", "1 mm", 2), velocity=("-0.1 m/s", "0.1 m/s", 2)
    ),
    "theory": lambda _, controlled: ss.stability(controlled),
    "design": lambda _, controlled: ss.design(controlled, belt_speed=0.04),
}


def with_share(normal_force: float) -> tuple[ss.Scenario, ss.Scenario]:
    """feed_drive, of 400 N static and 250 N minimum friction, without and with control."""
    values = {
        "plant.normal_force": normal_force,
        "plant.friction.static": 400.0 / normal_force,
        "plant.friction.minimum": 250.0 / normal_force,
    }
    texts = [f"{name}={value!r}" for name, value in values.items()]
    free, controlled = (ss.scenario("feed_drive", *texts, expects_control=c) for c in (False, True))
    return free, controlled


def numbers(found: Any, name: str = "") -> dict[str, Any]:
    """All values of a result by path; dimensionless Lyapunov coefficients are in units of N."""
    if isinstance(found, dict):
        inner = {f"{name}.{k}": v for k, v in found.items() if k not in NOT_COMPARED}
        return {n: v for k, each in inner.items() for n, v in numbers(each, k).items()}
    if isinstance(found, list):
        inner = {f"{name}[{k}]": v for k, v in enumerate(found)}
        return {n: v for k, each in inner.items() for n, v in numbers(each, k).items()}
    return {} if "lyapunov" in name else {name: found}


@pytest.mark.parametrize("answer", ANSWERS.values(), ids=ANSWERS)
def test_answers_agree(answer: Callable[[ss.Scenario, ss.Scenario], Any]) -> None:
    usual, other = (numbers(answer(*with_share(n)).to_dict()) for n in (1000.0, 1e-3))
    assert other.keys() == usual.keys()
    for name, value in usual.items():
        near = pytest.approx(value, rel=1e-6, abs=1e-9) if isinstance(value, float) else value
        assert other[name] == near, name
