"""Friction with a memory, through commands, nodes, bags and studies."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.bags.reader import Recording
from tests.app.conftest import Run

LAWS: Mapping[str, Mapping[str, float]] = {
    "dahl": {"bristle_stiffness": 1e5},
    "lugre": {"bristle_stiffness": 1e5, "bristle_damping": 100.0},
    "elasto_plastic": {"bristle_stiffness": 1e5, "bristle_damping": 100.0},
    "maxwell_slip": {"bristle_stiffness": 1e5, "attraction": 1000.0, "elements": 3},
    "rate_state": {"slip_distance": 1e-5, "evolution_effect": 0.03},
}
CURVE: Mapping[str, Any] = {"curve": "exponential", "decay_speed": 0.02, "kinetic": 0.25}


def options(law: str, **others: float) -> list[str]:
    """Overrides of feed_drive that give it a law."""
    values = {**LAWS[law], **({} if law in ("dahl", "rate_state") else CURVE), **others}
    pairs = {"law": law, **values}
    return [f"-p=plant.friction.{name}={value}" for name, value in pairs.items()]


@pytest.mark.process
@pytest.mark.parametrize(("law", "how"), [("lugre", "composed"), ("rate_state", "processes")])
def test_nodes_in_lockstep_give_what_simulate_does(
    stickslip: Run, tmp_path: Path, law: str, how: str
) -> None:
    given = ["feed_drive", *options(law), "-p=washout_controller.start_after=1.0"]
    arguments = (*given, "--pace", "lockstep", "--duration", "1.5", "--bag", "bag", "--json")
    done = stickslip("run", *arguments, *(["--composed"] if how == "composed" else []))
    assert done.returncode == 0, done.stderr
    simulated = stickslip("simulate", *given, "--duration", "1.5", "--out", "motion.csv")
    assert simulated.returncode == 0
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    with Recording(tmp_path / "bag") as recording:
        states = recording.joint_states
        assert recording.metadata("stickslip_ros/analyzer")["stick_speed"] == "0.0004"
    assert len(states) == len(table)
    for name in ("position", "velocity", "friction_force"):
        assert getattr(states, name).tolist() == table[name].tolist(), name
    report = json.loads(done.stdout)["report"]
    found = json.loads(stickslip("report", "bag", "--json").stdout)
    for name in ("amplitude", "period", "stick_fraction", "regime"):
        assert found[name] == report[name], name


@pytest.mark.parametrize(
    "law",
    [pytest.param(law, marks=[pytest.mark.long] * (law == "maxwell_slip")) for law in LAWS],
)
def test_a_law_is_simulated_and_its_stability_computed(stickslip: Run, law: str) -> None:
    given = ["feed_drive", *options(law), "--no-control"]
    simulated = stickslip("simulate", *given, "--duration", "3", "--json")
    assert simulated.returncode == 0, simulated.stderr
    regime = json.loads(simulated.stdout)["regime"]
    assert (regime in ("stick_slip", "pure_slip")) or law == "dahl"
    found = stickslip("stability", "feed_drive", *options(law), "--json")
    assert found.returncode == 0, found.stderr
    stability = json.loads(found.stdout)
    count = {"maxwell_slip": 5}.get(law, 3)
    assert len(stability["open_loop"]["eigenvalues"]) == count
    assert stability["sampled_loop"]["stable"] is True
    assert len(stability["open_loop"]["limit_cycles"]) == (law != "dahl")
    notes = stability["notes"]
    onset = "the onset of sticking needs a friction law without memory"
    assert notes["sticking"].startswith(onset)
    kinked = "the friction law elasto_plastic has no second derivative there"
    assert any(kinked in note for note in notes.values()) == (law == "elasto_plastic")


def test_bad_constants_are_refused_in_one_line(stickslip: Run) -> None:
    for law, name, value, sentence in (
        ("lugre", "curve", "dahl", "'dahl' is refused: law dahl has a memory"),
        ("lugre", "curve", "linear", "must be at least 1e-12 at every speed"),
        ("lugre", "kinetic", "0.5", "must not exceed friction.static"),
        ("elasto_plastic", "break_away", "1", "must be below 1"),
        ("maxwell_slip", "elements", "30", "must not exceed 20"),
        ("rate_state", "direct_effect", "1e-4", "must be at least friction.kinetic = 0.25"),
        ("dahl", "bristle_stiffness", "0", "must be a finite number above 0 1/m"),
        ("dahl", "static", "0", "must be at least 1e-12 for law dahl"),
        ("dahl", "elements", "1.5", "must be a whole number"),
    ):
        given = (*options(law), f"-p=plant.friction.{name}={value}")
        refused = stickslip("simulate", "feed_drive", *given)
        assert (refused.returncode, refused.stdout) == (2, "")
        assert sentence in refused.stderr, refused.stderr
        assert f"friction.{name} = " in refused.stderr
        assert refused.stderr.count("\n") == 1


def test_a_law_that_is_not_passive_is_told(stickslip: Run) -> None:
    told = stickslip("simulate", "feed_drive", *options("lugre"), "--duration", "0.1")
    assert "friction law lugre is not passive, and may supply energy" in told.stderr
    assert "viscous = 0 s/m is 60 s/m below" in told.stderr
    passive = options("lugre", viscous=61.0)
    assert stickslip("simulate", "feed_drive", *passive, "--duration", "0.1").stderr == ""


def scenario(**others: Any) -> ss.Scenario:
    values = {f"friction_{name}": value for name, value in {**LAWS["lugre"], **CURVE}.items()}
    return ss.scenario(
        "feed_drive", friction_law="lugre", expects_control=False, **values, **others
    )


def test_a_sweep_shows_the_hysteresis_of_a_subcritical_hopf_point() -> None:
    """Above the Hopf speed of 72.49 mm/s rest and stick-slip are both stable."""
    found = ss.sweep(scenario(), belt_speed=(0.07, 0.078, 5), carry="both").to_pandas()
    assert {"up", "down"} <= set(found["direction"])
    above = found[found["belt_speed"] > 0.0725]
    up, down = (above[above["direction"] == way]["amplitude"] for way in ("up", "down"))
    assert up.max() > 3e-4
    assert down.max() < 1e-4


def test_the_gains_of_a_design_hold_in_its_trials() -> None:
    proposal = ss.design(ss.scenario(scenario(), expects_control=True), belt_speed=(0.02, 0.05))
    assert (
        proposal.scenario.controller.as_law().linear_gain < -848.0
    )  # the critical gain at 40 mm/s
