"""Drives on a spring: the constants of noisy runs come out within their intervals.

docs/identification.md has a table of more seeds.
"""

from dataclasses import replace

import pytest

from benchmarks import identification as study
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.identify import identify
from stickslip_ros.identification.record import Record
from tests.identification.axis_record import record as axis_record

_FAR = 4.5
"""Standard errors that an estimate is away at most: five constants of some records, all right."""


@pytest.mark.parametrize(
    ("law", "kind"),
    [("stribeck", "ramp"), ("exponential", "ramp"), ("coulomb", "ramp"), ("stribeck", "stick")],
)
def test_constants_are_within_their_errors(law: str, kind: str) -> None:
    fixed = {"normal_force": study.NORMAL_FORCE}
    if kind == "stick":
        fixed["mass"] = study.MASS
    found = identify([study.record(law, kind, seed=7, duration=2.5)], law, fixed)
    true = study.truth(law, kind)
    assert found.fitted
    for name, each in found.fitted.items():
        assert abs(each.value - true[name]) < _FAR * each.standard_error, name
        assert each.standard_error < 0.05 * max(abs(true[name]), 1e-3), name
    assert found.notes == []


def test_several_records_tell_more_than_one() -> None:
    records = [study.record("exponential", "ramp", seed, duration=2.0) for seed in (1, 2)]
    one, both = identify(records[:1], "exponential"), identify(records, "exponential")
    assert both.fitted["mass"].standard_error < one.fitted["mass"].standard_error


def test_the_model_predicts_a_record_that_it_was_not_fitted_to() -> None:
    fitted = identify(
        [study.record("exponential", "stick", 1, 2.5)], "exponential", {"mass": 100.0}
    )
    error = fitted.check(study.record("exponential", "stick", 2, 2.5))["free_run_error"]
    assert error is not None
    assert error < 2e-6


def test_what_one_belt_speed_cannot_tell_is_named() -> None:
    found = identify([study.record("stribeck", "stick", 1, 2.5)], "stribeck", {"mass": 100.0})
    assert "several belt speeds" in found.unidentified["damping"]
    assert "both directions" in found.unidentified["bias_force"]


def test_without_a_force_something_must_be_known() -> None:
    with pytest.raises(InvalidInputError, match=r"--fix plant\.mass"):
        identify([study.record("stribeck", "stick", 1, 2.0)], "stribeck")


def test_a_missing_input_is_noted() -> None:
    own = study.record("coulomb", "ramp", 1, 2.0)
    lacking = Record(own.name, own.period, own.position, own.belt_velocity, own.force)
    assert "an input may be missing" in identify([lacking], "coulomb").notes[0]


def test_a_force_of_the_wrong_sign_is_refused() -> None:
    own = study.record("coulomb", "ramp", 1, 2.0)
    assert own.force is not None
    assert own.disturbance is not None
    wrong = replace(own, force=-own.force, disturbance=-own.disturbance)
    with pytest.raises(InvalidInputError, match=r"comes out as 0.* sign"):
        identify([wrong], "stribeck")


def test_a_constant_that_the_law_does_not_search_is_refused() -> None:
    own = study.record("exponential", "stick", 1, 2.0)
    with pytest.raises(InvalidInputError, match=r"only plant\.friction\.kinetic"):
        identify([own], "exponential", {"mass": 100.0, "friction.static": 400.0})
    with pytest.raises(InvalidInputError, match="with the law auto"):
        identify([own], "auto", {"mass": 100.0, "friction.kinetic": 250.0})
    found = identify([own], "exponential", {"mass": 100.0, "friction.kinetic": 250.0})
    assert "friction.kinetic" not in found.fitted


def test_laws_of_an_axis_are_refused_on_a_spring() -> None:
    with pytest.raises(InvalidInputError, match="law table is refused for a drive on a spring"):
        identify([study.record("stribeck", "stick", 1, 2.0)], "table", {"mass": 100.0})
    with pytest.raises(InvalidInputError, match="without a spring"):
        identify([axis_record("coulomb")], "maxwell_slip")


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_the_first_seeds_of_the_study() -> None:
    found = study.study(2, workers=2, cases=study.CASES[:3])
    for case in found["cases"]:
        assert case["right"] == 1.0, case["law"]
        for name, each in case["constants"].items():
            assert abs(each["bias"]) < 3.0 * each["standard_error"], (case["law"], name)
