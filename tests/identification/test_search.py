"""The search of the constants whose trajectories are nearest to what a record has measured."""

import numpy as np
import pytest

from stickslip_ros.identification.search import refine
from stickslip_ros.identification.segment_starts import best_starts
from tests.identification.segments import FREE, TRUE, segments


@pytest.mark.parametrize("seed", range(3))
def test_a_search_from_constants_nearby_finds_the_true_ones(seed: int) -> None:
    """It ends within the bounds, and not worse than where it began or the true constants are."""
    task, factors = segments(), np.random.default_rng(seed).uniform(0.9, 1.1, len(FREE))
    begun = TRUE | {name: f * TRUE[name] for name, f in zip(FREE, factors.tolist(), strict=True)}
    found = refine(task, FREE, begun)
    assert found.loss <= min(best_starts(task, each).loss for each in (begun, TRUE))
    for name, value in found.values.items():
        if name not in FREE:
            assert value == TRUE[name], name
            continue
        low, high = task.law.bounds(name, begun, task.fastest)
        assert low <= value <= high, name
        place = FREE.index(name)
        error = np.sqrt(found.covariance[place, place])
        assert abs(value - TRUE[name]) < 4.5 * error, name


def test_a_search_from_outside_of_the_bounds_stays_inside() -> None:
    task, begun = segments(), TRUE | {"viscous": 1e6}
    low, high = task.law.bounds("viscous", begun, task.fastest)
    assert high < 1e6
    found = refine(task, ["viscous"], begun, most=3)
    assert low <= found.values["viscous"] <= high
    assert found.loss <= best_starts(task, TRUE | {"viscous": high}).loss


def test_a_search_without_free_constants_is_one_of_the_starts() -> None:
    task = segments()
    found = refine(task, [], TRUE)
    assert found.values == TRUE
    assert found.loss == pytest.approx(best_starts(task, TRUE).loss, rel=1e-3)


def test_a_search_whose_time_is_over_is_not_worse_than_its_start() -> None:
    task, begun = segments(0.0), TRUE | {"mass": 1.05 * TRUE["mass"]}
    found = refine(task, FREE, begun)
    assert found.loss <= 1.001 * best_starts(task, begun).loss


def test_a_constant_at_zero_has_derivatives() -> None:
    """Without viscous friction the equations have no such constant."""
    task, begun = segments(), TRUE | {"viscous": 0.0}
    starts = best_starts(task, begun).starts
    outputs, by_names, _ = task.sensitivities(begun, starts, ["viscous"])
    step = 1e-3 * TRUE["viscous"]
    moved, _, _ = task.sensitivities(begun | {"viscous": step}, starts, ["viscous"])
    change = moved - outputs
    assert by_names[:, 0] * step == pytest.approx(change, abs=1e-2 * float(abs(change).max()))
