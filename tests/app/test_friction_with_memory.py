"""Friction with a memory, through commands, nodes, bags and studies."""

from collections.abc import Mapping
from typing import Any

import pytest

from tests.app.conftest import Run

LAWS: Mapping[str, Mapping[str, float]] = {
    "dahl": {"bristle_stiffness": 1e5},
    "lugre": {"bristle_stiffness": 1e5, "bristle_damping": 100.0},
    "elasto_plastic": {"bristle_stiffness": 1e5, "bristle_damping": 100.0},
    "maxwell_slip": {"bristle_stiffness": 1e5, "attraction": 1000.0, "elements": 2},
}
CURVE: Mapping[str, Any] = {"curve": "exponential", "decay_speed": 0.02, "kinetic": 0.25}


def options(law: str, **others: float) -> list[str]:
    """Overrides of feed_drive that give it a law."""
    values = {**LAWS[law], **({} if law == "dahl" else CURVE), **others}
    pairs = {"law": law, **values}
    return [f"-p=plant.friction.{name}={value}" for name, value in pairs.items()]


@pytest.mark.parametrize(
    "law",
    [pytest.param(law, marks=[pytest.mark.long] * (law != "dahl")) for law in LAWS],
)
def test_a_law_is_simulated_and_its_stability_computed(stickslip: Run, law: str) -> None:
    given = ["feed_drive", *options(law), "--no-control"]
    regime = stickslip.json("simulate", *given, "--duration", "3")["regime"]
    assert (regime in ("stick_slip", "pure_slip")) or law == "dahl"
    stability = stickslip.json("stability", "feed_drive", *options(law))
    count = {"maxwell_slip": 4}.get(law, 3)
    assert len(stability["open_loop"]["eigenvalues"]) == count
    assert stability["sampled_loop"]["stable"] is True
    assert len(stability["open_loop"]["limit_cycles"]) == (law != "dahl")
    notes = stability["notes"]
    onset = "the stick-slip onset speed needs a friction law without memory"
    assert notes["sticking"].startswith(onset)
    nonsmooth = "the friction law elasto_plastic has no second derivative there"
    assert any(nonsmooth in note for note in notes.values()) == (law == "elasto_plastic")


def test_a_law_that_is_not_passive_is_told(stickslip: Run) -> None:
    told = stickslip("simulate", "feed_drive", *options("lugre"), "--duration", "0.1")
    assert "friction law lugre is not passive, and may supply energy" in told.stderr
    assert "viscous = 0 s/m is 60 s/m below" in told.stderr
    passive = options("lugre", viscous=61.0)
    assert stickslip("simulate", "feed_drive", *passive, "--duration", "0.1").stderr == ""
