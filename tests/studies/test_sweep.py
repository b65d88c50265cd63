"""The kinds of sweeps."""

from collections.abc import Sequence

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.physics.theory.critical_gains import critical_gains
from stickslip_ros.studies.columns import compute_columns
from stickslip_ros.studies.plan import Axis, Carry, Grid
from stickslip_ros.studies.settling import SettlingCourse
from stickslip_ros.studies.sweep import sweep_study
from tests.physics.drives import LIMIT_CYCLES
from tests.studies.studies import free, paper

SPEED = Axis("plant.belt_speed", 0.2, 0.4, 3)
DAMPING = Axis("plant.damping", 0.01, 0.03, 3)
STATIC = Axis("plant.friction.static", 0.4, 0.5, 2)
GAIN = Axis("washout_controller.linear_gain", -2.0, 0.0, 6)


def test_a_map_has_the_reference_cycles_where_its_axes_have_their_drives() -> None:
    found = compute_columns(sweep_study(free(), [DAMPING, SPEED], course=SettlingCourse(300.0, 6)))
    rows = slice(3, 6)
    assert found.values["plant.damping"][rows] == pytest.approx(0.02)
    for name in ("amplitude", "stick_fraction", "period", "midpoint"):
        expected = [getattr(cycle, name) for cycle in LIMIT_CYCLES[:3]]
        assert getattr(found, name)[rows] == pytest.approx(expected, abs=1e-8), name
    assert found.values["plant.belt_speed"][rows].tolist() == pytest.approx([0.2, 0.3, 0.4])


def test_over_the_gain_the_vibration_ends_where_theory_has_it() -> None:
    scenario = paper("washout_controller.cubic_gain=0.0")
    found = compute_columns(sweep_study(scenario, [GAIN], continuous=True))
    drive = scenario.plant.as_drive()
    critical = critical_gains(drive, scenario.washout_controller.as_law().gains)
    assert critical is not None
    rests = found.values[GAIN.parameter] < critical.linear
    assert 0 < rests.sum() < GAIN.count
    assert (found.regime[rests] == Regime.EQUILIBRIUM).all()
    assert found.midpoint[rests] == pytest.approx(drive.equilibrium_position, rel=1e-6)
    assert set(found.regime[~rests]) == {Regime.PURE_SLIP, Regime.STICK_SLIP}
    without = compute_columns(sweep_study(free(), [SPEED]))
    assert found.amplitude[-1] == pytest.approx(without.amplitude[-1], rel=1e-9)


def test_it_carries_along_the_last_axis() -> None:
    plan = sweep_study(free(), [DAMPING, SPEED], carry=Carry.UP).plan
    assert plan == Grid((DAMPING, SPEED), Carry.UP)
    for chain in plan.chains():
        assert len({plan.values(index)[0] for index in chain}) == 1


@pytest.mark.parametrize("axes", [[], [SPEED, DAMPING, STATIC]])
def test_no_axes_or_three_are_refused(axes: Sequence[Axis]) -> None:
    with pytest.raises(InvalidInputError, match=f"^{len(axes)} parameters: a sweep is over one or"):
        sweep_study(free(), axes)


def test_one_parameter_twice_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="must be different parameters"):
        sweep_study(free(), [SPEED, SPEED])


def test_a_controllers_parameter_is_refused_without_control() -> None:
    with pytest.raises(InvalidInputError, match="without control there is no controller"):
        sweep_study(free(), [SPEED, GAIN])


def test_the_message_of_a_refused_sweep_names_parameter_and_value() -> None:
    minimum = Axis("plant.friction.minimum", 0.5, 0.6, 2)
    with pytest.raises(InvalidInputError, match=r"friction\.minimum = 0\.5 must not exceed"):
        sweep_study(free(), [minimum])
