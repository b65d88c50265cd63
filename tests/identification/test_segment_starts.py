"""States at the starts of segments: those from which given constants fit best."""

import numpy as np
import pytest

from stickslip_ros.identification.segment_starts import Errors, best_starts
from tests.identification.segments import FREE, TRUE, segments


@pytest.fixture(scope="module")
def measured() -> Errors:
    """Errors of the true constants from the measured states."""
    task = segments()
    return Errors.at(task, FREE, TRUE, task.starts)


def test_best_starts_are_better_in_each_segment_and_none_near_them_is(measured: Errors) -> None:
    found = measured.settled()
    assert (found.losses <= measured.losses).all()
    assert found.loss < 0.5 * measured.loss
    for moved in (np.array([1e-7, 0.0]), np.array([0.0, 1e-5])):
        for sign in (1.0, -1.0):
            assert (found.moved(found.starts + sign * moved).losses > found.losses).all()


def test_columns_without_starts_are_those_that_no_start_explains(measured: Errors) -> None:
    left = measured.without_starts(np.hstack([measured.by_names, measured.by_start]))
    sizes = np.linalg.norm(measured.by_start, axis=0)
    for part in measured.task.parts:
        along = measured.by_start[part].T @ left[part] / sizes[:, None]
        assert np.abs(along / np.linalg.norm(measured.by_names, axis=0).max()).max() < 1e-9
    assert np.linalg.norm(left[:, -2:], axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_start_that_is_far_away_is_doubted_and_found_again(measured: Errors) -> None:
    """Its segment has nearly all of the error: the others are as before."""
    away = measured.starts.copy()
    away[3] += [2e-5, 5e-3]
    lost = measured.moved(away)
    assert lost.has_outliers
    again = lost.restarted()
    assert (again.losses <= lost.losses).all()
    assert again.losses[3] == pytest.approx(best_starts(lost.task, TRUE).losses[3], rel=1e-3)
