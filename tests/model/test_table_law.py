"""A law given by a table: its points, its shape, its motion and its theory."""

from math import inf, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.model.friction import Table


@st.composite
def tables(draw: st.DrawFn) -> Table:
    steps = draw(st.lists(st.floats(1e-3, 1.0), min_size=0, max_size=8))
    values = draw(st.lists(st.floats(0.0, 1.0), min_size=len(steps) + 1, max_size=len(steps) + 1))
    speeds = np.cumsum([0.0, *steps]).tolist()
    return Table(tuple(zip(speeds, values, strict=True)))


@given(tables(), st.floats(0.0, 10.0))
def test_a_table_is_exact_at_its_points_and_between_them(law: Table, elsewhere: float) -> None:
    assert law.refusal() is None
    for speed, value in law.points:
        assert law.coefficient(speed, 1.0) == pytest.approx(-value, rel=1e-14, abs=1e-15)
        assert law.coefficient(-speed, -1.0) == pytest.approx(value, rel=1e-14, abs=1e-15)
    assert law.static == law.points[0][1]
    assert law.limits == (law.static, law.static)
    speeds, values = np.array(law.points).T
    after = int(np.searchsorted(speeds, elsewhere))
    around = values[max(after - 1, 0) : after + 1]
    found = -float(law.coefficient(elsewhere, 1.0))
    assert around.min() - 1e-14 <= found <= around.max() + 1e-14


@given(tables(), st.floats(0.0, 10.0))
def test_a_piece_leads_to_its_neighbors(law: Table, speed: float) -> None:
    piece = law.switches_at(speed, 1.0, ())
    lower, upper, first, last, *_ = piece
    assert min(law.margins(speed, 1.0, (), piece)) >= 0.0
    if not last:
        assert law.switches_after(1, 1.0, piece) == law.switches_at(upper, 1.0, ())
        assert law.switches_after(0, 1.0, law.switches_after(1, 1.0, piece)) == piece
    if not first:
        assert law.switches_after(0, 1.0, piece)[1] == lower


@pytest.mark.parametrize(
    ("points", "refusal"),
    [
        ((), "the table has no points: must have at least one"),
        (((0.1, 0.4),), "point 1 of the table: the speed must be 0"),
        (((nan, 0.4),), "point 1 of the table: the speed must be 0"),
        (
            ((0.0, 0.4), (0.2, 0.3), (0.2, 0.2)),
            "point 3 of the table: the speed must be finite and above the one before",
        ),
        (
            ((0.0, 0.4), (inf, 0.3)),
            "point 2 of the table: the speed must be finite and above the one before",
        ),
        (
            ((0.0, 0.4), (0.1, nan)),
            "point 2 of the table: the coefficient must be a finite number at least 0",
        ),
    ],
)
def test_points_that_make_no_table_are_refused(points: Any, refusal: str) -> None:
    assert Table(points).refusal() == refusal
