"""Names that a program for version 0.1 imports: all of its docs/reference.md."""

import pickle
import warnings
from dataclasses import dataclass, replace
from importlib import import_module
from math import exp
from typing import Any, ClassVar

import numpy as np
import pytest

from stickslip_ros.deprecated_names import ADAPTERS, MOVED
from stickslip_ros.physics.loop.controller import Controller
from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.loop.simulation import simulate_sampled
from stickslip_ros.physics.measures import CycleMeter
from stickslip_ros.physics.model.control import Washout as WashoutLaw
from stickslip_ros.physics.model.control import WashoutGains
from stickslip_ros.physics.model.friction import Exponential, FrictionLaw, Linear
from stickslip_ros.physics.motion import RecordedMotion
from stickslip_ros.physics.theory.closed_forms import CubicLoop
from stickslip_ros.physics.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.samples import SampleColumns
from stickslip_ros.studies.basin import Attractor, Basins
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.design import Task
from tests.physics.drives import PAPER

PUBLIC = {
    "stickslip_ros.testing": "ClosedLoop RunResult Diagnostics own_domain",
    "stickslip_ros.bags": "Recording RunBlock",
    "stickslip_ros.bags.messages": "JointStateColumns WrenchColumns",
    "stickslip_ros.bags.report": "report_of_bag",
    "stickslip_ros.scenario.files": "load_scenario Scenario parameter_file",
    "stickslip_ros.physics.drive": "Drive",
    "stickslip_ros.physics.loop.washout": "WashoutParameters Washout",
    "stickslip_ros.physics.model.equations": "WashoutGains",
    "stickslip_ros.physics.friction": "FrictionLaw Stribeck Coulomb Linear Exponential LAWS",
    "stickslip_ros.physics.motion": "Motion",
    "stickslip_ros.physics.knots": "Knots",
    "stickslip_ros.physics.washout": "WashoutParameters Washout",
    "stickslip_ros.physics.equations": "WashoutGains",
    "stickslip_ros.physics.sampled_loop": "SampledLoop Sample Verdict",
    "stickslip_ros.physics.disturbance": "Disturbance",
    "stickslip_ros.physics.simulation": "simulate_sampled simulate_continuous",
    "stickslip_ros.physics.measures": "CycleMeter Measures Cycle Regime",
    "stickslip_ros.physics.theory.linear": "expand Expansion",
    "stickslip_ros.physics.theory.hopf": (
        "hopf_points HopfPoint first_lyapunov_coefficient crossing_speed"
    ),
    "stickslip_ros.physics.theory.closed_forms": "CubicLoop",
    "stickslip_ros.physics.theory.sticking": "sticking_onset StickingOnset",
    "stickslip_ros.physics.theory.limit_cycles": "limit_cycles limit_cycle_of_run shoot LimitCycle",
    "stickslip_ros.physics.theory.hopf_cycles": "limit_cycle_from_hopf",
    "stickslip_ros.physics.theory.closed_loop": "critical_gains CriticalGains",
    "stickslip_ros.physics.theory.sampled": "LinearSampledLoop GainInterval",
    "stickslip_ros.studies.plan": "Axis Grid Sample Carry",
    "stickslip_ros.studies.settled": "Course",
    "stickslip_ros.studies.sweep": "sweep_study",
    "stickslip_ros.studies.basin": "basin_study default_axes Basins Attractor",
    "stickslip_ros.studies.columns": "compute_columns Columns",
    "stickslip_ros.studies.journal": "Journal",
    "stickslip_ros.studies.runner": "run",
    "stickslip_ros.studies.design": "Task design Design Check Margins",
    "stickslip_ros.errors": "StickslipError InvalidInputError BagError RunError",
}
NAMES = [(module, name) for module, names in PUBLIC.items() for name in names.split()]


@pytest.mark.parametrize(("module", "name"), NAMES)
def test_what_was_public_is_importable_from_where_it_was(module: str, name: str) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = getattr(import_module(module), name)
    now = MOVED.get(module, {}).get(name)
    told = [str(w.message) for w in caught if w.category is DeprecationWarning]
    if now is None:
        assert told == []
    else:
        assert told == [f"{module}.{name} is now {now}; the old name will be removed in 0.3"]
        home, _, new_name = ADAPTERS.get(now, now).rpartition(".")
        assert getattr(import_module(home), new_name) is found


@pytest.mark.parametrize("module", MOVED)
def test_what_was_not_public_is_no_attribute(module: str) -> None:
    with pytest.raises(AttributeError, match=f"'{module}' has no attribute 'nothing'"):
        _ = import_module(module).nothing


@pytest.mark.parametrize(
    ("owner", "old", "new"),
    [
        (CubicLoop, "of", "from_drive"),
        (LinearSampledLoop, "of", "from_drive"),
        (Task, "of", "from_scenario"),
        (Attractor, "of", "from_point"),
        (Basins, "of", "from_points"),
        (Columns, "of", "from_journal"),
        (RecordedMotion, "take_knots", "take_breakpoints"),
    ],
)
def test_members_have_their_old_names_too(owner: type, old: str, new: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"{owner.__name__}.{old} is now .*{new}; the old"):
        found = getattr(owner, old)
    assert found == getattr(owner, new)


def test_values_have_their_old_names_too() -> None:
    law = Exponential(0.4, 0.2, 0.01, 0.0)
    with pytest.warns(DeprecationWarning, match="is now Exponential.characteristic_speed"):
        assert law.sudden_speed == law.characteristic_speed
    columns = SampleColumns(*(np.array([float(number)]) for number in range(6)))
    with pytest.warns(DeprecationWarning, match="is now SampleColumns.friction_force"):
        assert columns.effort is columns.friction_force


def test_the_old_controller_still_works() -> None:
    with pytest.warns(DeprecationWarning, match="physics.washout.WashoutParameters is now"):
        from stickslip_ros.physics.washout import WashoutParameters
    with pytest.warns(DeprecationWarning, match="physics.washout.Washout is now"):
        from stickslip_ros.physics.washout import Washout

    parameters = WashoutParameters(20.0, -3000.0, 0.0, 50.0, 1e-3)
    assert parameters == WashoutParameters(
        corner_frequency=20.0,
        linear_gain=-3000.0,
        cubic_gain=0.0,
        force_limit=50.0,
        start_after=1e-3,
    )
    assert parameters.gains == WashoutGains(20.0, -3000.0, 0.0)
    assert pickle.loads(pickle.dumps(parameters)) == parameters
    assert replace(parameters, linear_gain=-1.0).linear_gain == -1.0
    with pytest.raises(TypeError, match="cubic_gain"):
        WashoutParameters(20.0, -3000.0)
    washout = Washout(parameters, low_passed=0.03)
    answers = [washout.answer(stamp, 0.04) for stamp in (0, 1_000_000, 1_000_000, 2_000_000)]
    low_passed = [0.04 - 0.01 * exp(-0.02 * number) for number in (1, 2)]
    assert answers[:1] + answers[2:3] == [0.0, None]
    assert [answers[1], answers[3]] == pytest.approx([-3000.0 * (0.04 - z) for z in low_passed])
    assert washout.low_passed == pytest.approx(low_passed[1])
    washout.parameters = WashoutParameters(20.0, 1e9, 0.0, force_limit=7.0)
    assert (washout.parameters.force_limit, washout.answer(3_000_000, 0.04)) == (7.0, 7.0)


def test_a_simulation_takes_the_old_controller() -> None:
    with pytest.warns(DeprecationWarning, match="Washout"):
        from stickslip_ros.physics.washout import Washout, WashoutParameters
    ends: list[float] = []
    for controller in (
        Washout(WashoutParameters(2.0, -1.0, -1.0)),
        Controller(WashoutLaw(2.0, -1.0, -1.0)),
    ):
        motion = RecordedMotion(PAPER, 0.0, 0.0)
        loop = SampledLoop(motion, 100.0, 0)
        simulate_sampled(loop, motion, controller, 5.0, CycleMeter(20))
        ends.append(motion.position)
    assert ends[0] == ends[1]


def test_a_law_with_the_old_name_still_works() -> None:
    class OldLaw(Linear):
        @property
        def sudden_speed(self) -> float:
            return 0.5

    law: FrictionLaw = OldLaw(0.4, -1.0)
    assert law.characteristic_speed == 0.5


def test_a_law_without_defaults_still_works() -> None:
    @dataclass(frozen=True)
    class OldLaw(FrictionLaw):
        name: ClassVar[str] = "old"
        inverse_speed_power: ClassVar[dict[str, int]] = {"rise": 1}
        rise: Any

        def coefficient(self, relative_speed: Any, sign: Any) -> Any:
            return -self.static * sign - self.rise * relative_speed

    assert OldLaw.constants() == ("static", "rise")
    assert OldLaw(0.3, 0.5).scaled(4.0) == OldLaw(static=0.3, rise=2.0)
    with pytest.raises(TypeError, match="missing constant 'rise', which has no default"):
        OldLaw(0.3)
