"""Plans: texts of axes, grids in row-major order, chains that are carried, random samples."""

from dataclasses import replace
from itertools import product
from math import isclose

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.studies.plan import (
    MOST_POINTS,
    Axis,
    Continuation,
    Grid,
    ListedAxis,
    RandomSample,
)

SPEED = "plant.belt_speed"
AXES = [
    Axis(SPEED, 0.1, 0.7, 4),
    Axis("plant.damping", 1e-3, 1.0, 3, logarithmic=True),
    Axis("plant.friction.static", 0.9, 0.3, 2),
]


def test_a_text_is_read_as_the_axis_it_stands_for() -> None:
    for text, axis in (
        ("plant.belt_speed=0.02:0.6:59", Axis(SPEED, 0.02, 0.6, 59)),
        ("plant.belt_speed=0.6:-0.02:2", Axis(SPEED, 0.6, -0.02, 2)),
        ("plant.damping=1e-3:1:7:log", Axis("plant.damping", 1e-3, 1.0, 7, True)),
        ("washout_controller.linear_gain=-1:-10:3:log",
         Axis("washout_controller.linear_gain", -1.0, -10.0, 3, True)),
        ("plant.friction.minimum=0:0.4:5", Axis("plant.friction.minimum", 0.0, 0.4, 5)),
        ("plant.force_jitter_seed=0:9:10", Axis("plant.force_jitter_seed", 0.0, 9.0, 10)),
    ):  # fmt: skip
        assert Axis.parse(text) == Axis.parse(str(axis)) == axis


FORM = "must be NODE.PARAMETER=A:B:COUNT, or A:B:COUNT:log"


def test_any_other_text_is_refused_with_what_was_allowed() -> None:
    for text, message in (
        ("", FORM),
        ("plant.belt_speed", FORM),
        ("plant.belt_speed=1:2", FORM),
        ("plant.belt_speed=1:2:3:", FORM),
        ("plant.belt_speed=one:2:3", "'one' is invalid: must be a number in m/s"),
        ("plant.belt_speed=1:2:3.0", FORM),
        (f"plant.belt_speed=1:2:{'9' * 5000}", FORM),
        ("analyzer.window=1:2:3", "must be a parameter of plant or washout_controller"),
        ("plant=1:2:3", r"unknown parameter; numbers of plant are actuator\.\*, answer_e"),
        ("plant.speed=1:2:3", r"unknown parameter; did you mean plant\.belt_speed or "),
        (
            "washout_controller.gain=1:2:3",
            r"washout_controller\.cubic_gain or washout_controller\.",
        ),
        ("plant.friction.law=1:2:3", "is not a number"),
        ("plant.belt_speed=1:1:3", "1:1 must be two different finite numbers"),
        ("plant.belt_speed=1:nan:3", "1:nan must be two different finite numbers"),
        ("washout_controller.force_limit=1:inf:3", "1:inf must be two different finite numbers"),
        ("plant.belt_speed=1:2:1", "1 values: must be from 2 to 10,000,000"),
        (f"plant.belt_speed=1:2:{MOST_POINTS + 1}", "values: must be from 2 to 10,000,000"),
        ("plant.belt_speed=-1:1:3:log", "with :log -1:1 must have one sign and exclude zero"),
        ("plant.mass=0:1:3", "plant.mass=0:1:3: mass = 0.0.* above 0 kg"),
        ("plant.belt_speed=0:1e31:3", r"belt_speed = 1e\+31.* at most 1e\+30"),
        ("plant.friction.static=-0.1:1:3", "friction.static = -0.1.* at least 0"),
        ("plant.flow_window=100:300:3", "flow_window = 100.* at least 200"),
        ("plant.sensor.difference_samples=1:4:5", "there are fewer whole numbers from 1:4"),
        ("plant.sensor.difference_samples=1.5:4.5:3", "1.5:4.5 must be two whole numbers"),
    ):
        with pytest.raises(InvalidInputError, match=message) as refusal:
            Axis.parse(text)
        assert len(str(refusal.value)) < 1000


numbers = st.floats(-1e3, 1e3)


@given(first=numbers, last=numbers, count=st.integers(2, 50))
def test_the_values_go_from_the_first_to_the_last_exactly(
    first: float, last: float, count: int
) -> None:
    if first == last:
        return
    values = Axis(SPEED, first, last, count).values()
    assert values[0] == first
    assert values[-1] == last
    assert len(values) == count
    steps = np.diff(values)
    assert steps == pytest.approx((last - first) / (count - 1), abs=1e-12)


@given(
    first=st.floats(1e-30, 1e30),
    last=st.floats(1e-30, 1e30),
    sign=st.sampled_from([1.0, -1.0]),
    count=st.integers(2, 50),
)
def test_logarithmic_values_have_one_ratio_and_exact_ends(
    first: float, last: float, sign: float, count: int
) -> None:
    if isclose(first, last):
        return
    values = Axis(SPEED, sign * first, sign * last, count, logarithmic=True).values()
    assert values[0] == sign * first
    assert values[-1] == sign * last
    ratio = (last / first) ** (1.0 / (count - 1))
    assert values[1:] / values[:-1] == pytest.approx(ratio, rel=1e-9)


def test_values_of_a_whole_number_are_whole() -> None:
    axis = Axis("plant.force_jitter_seed", 0.0, 10.0, 4)
    assert [axis.value(number) for number in range(4)] == [0, 3, 7, 10]
    assert all(isinstance(axis.value(number), int) for number in range(4))
    assert axis.values().tolist() == [0.0, 3.0, 7.0, 10.0]
    sample = RandomSample((Axis("plant.force_jitter_seed", 1, 6, 2),), 50)
    values = {sample.values(index)[0] for index in range(50)}
    assert values == {1, 2, 3, 4, 5, 6}
    assert all(isinstance(value, int) for value in values)


def test_the_last_axis_of_a_grid_varies_fastest() -> None:
    for axes in (AXES[:1], AXES):
        grid = Grid(tuple(axes))
        expected = list(product(*(axis.values().tolist() for axis in axes)))
        assert grid.size == len(expected)
        assert [grid.values(index) for index in range(grid.size)] == expected
        assert grid.parameters == tuple(axis.parameter for axis in axes)
        assert list(grid.chains()) == [range(grid.size)]
        assert not grid.continuation
    assert [axis.unit for axis in AXES] == ["m/s", "N s/m", ""]


axis_counts = st.lists(st.integers(2, 7), min_size=1, max_size=3)


@given(counts=axis_counts, carry=st.sampled_from(Continuation))
def test_every_point_is_carried_on_once_from_its_neighbour(
    counts: list[int], carry: Continuation
) -> None:
    axes = tuple(replace(axis, count=count) for axis, count in zip(AXES, counts, strict=False))
    grid = Grid(axes, carry)
    chains = list(grid.chains())
    assert sorted(index for chain in chains for index in chain) == list(range(grid.size))
    assert grid.size == len(carry.directions) * np.prod([axis.count for axis in axes])
    along = axes[-1].values().tolist()
    for chain in chains:
        (direction,) = {grid.direction(index) for index in chain}
        values = [grid.values(index) for index in chain]
        assert len({value[:-1] for value in values}) == 1
        in_order = along if direction is Continuation.UP else along[::-1]
        assert [value[-1] for value in values] == in_order


def test_a_grid_refuses_one_parameter_twice_and_too_many_points() -> None:
    with pytest.raises(InvalidInputError, match="belt_speed: must be different parameters"):
        Grid((AXES[0], Axis(SPEED, 0.0, 1.0, 2)))
    many = replace(AXES[0], count=40_000), replace(AXES[1], count=40_000)
    with pytest.raises(InvalidInputError, match="1600000000 points: must be at most 10,000,000"):
        Grid(many)


def test_a_larger_sample_begins_with_the_smaller_one() -> None:
    small, large = RandomSample(tuple(AXES), 10, 3), RandomSample(tuple(AXES), 1000, 3)
    assert all(small.values(index) == large.values(index) for index in range(10))
    assert list(large.chains()) == [range(1000)]
    assert not large.continuation


def test_samples_of_two_seeds_and_two_points_have_nothing_in_common() -> None:
    samples = [RandomSample(tuple(AXES), 200, seed) for seed in (0, 1, 2, 2**32, 2**40)]
    values = [value for sample in samples for i in range(200) for value in sample.values(i)]
    assert len(set(values)) == len(values)


def test_a_sample_that_cannot_be_is_refused() -> None:
    for size in (0, MOST_POINTS + 1):
        with pytest.raises(
            InvalidInputError, match=f"^{size} points: must be from 1 to 10,000,000"
        ):
            RandomSample((AXES[0],), size)
    with pytest.raises(InvalidInputError, match="seed -1: must be 0 or more"):
        RandomSample((AXES[0],), 5, -1)
    with pytest.raises(InvalidInputError, match="belt_speed: must be different parameters"):
        RandomSample((AXES[0], AXES[0]), 5)


def test_listed_values_are_taken_as_they_are() -> None:
    axis = ListedAxis("plant.belt_speed", 0.02, 0.05, 3, listed=(0.02, 0.03, 0.05))
    assert axis.values().tolist() == [0.02, 0.03, 0.05]
    assert str(axis) == "plant.belt_speed=[0.02, 0.03, 0.05]"
    whole = ListedAxis("plant.sensor.seed", 1.0, 5.0, 3, listed=(1.0, 2.0, 5.0))
    assert [type(whole.value(number)) for number in range(3)] == [int, int, int]
    with pytest.raises(InvalidInputError, match="the values must rise, or fall"):
        ListedAxis("plant.belt_speed", 0.03, 0.05, 3, listed=(0.03, 0.02, 0.05))
