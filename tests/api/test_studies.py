"""Sweeps and basins as objects: columns, figures, tables."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Measures, Regime
from stickslip_ros.quantities import quantities_of
from stickslip_ros.studies.basin import Basins
from stickslip_ros.studies.columns import COLUMNS

FREE = ss.scenario("paper", expects_control=False)
SHORT: dict[str, Any] = {"transient": 20.0, "cycles": 2}


def test_a_sweep_prints_plots_and_knows_its_transitions() -> None:
    found = ss.sweep(FREE, belt_speed=(0.3, 0.5, 5), **SHORT)
    assert repr(found).splitlines()[0] == "paper, 5 points"
    assert "stick-slip" in repr(found)
    assert "<table>" in found._repr_html_()  # pyright: ignore
    assert list(found.transitions) == ["Hopf point", "limit of sticking"]
    assert isinstance(found.plot(), Figure)
    with pytest.raises(InvalidInputError, match="is for maps"):
        found.plot("amplitude")


@pytest.mark.usefixtures("coarse_maps")
def test_a_map_has_two_dimensions() -> None:
    found = ss.sweep(FREE, belt_speed=(0.3, 0.5, 3), damping=(0.01, 0.1, 2, "log"), **SHORT)
    assert found.transitions == {}
    assert isinstance(found.plot("amplitude"), Figure)
    with pytest.raises(InvalidInputError, match="must be one of regime, amplitude, "):
        found.plot("velocity")  # pyright: ignore
    data = found.to_xarray()
    assert data["amplitude"].dims == ("belt_speed", "damping")
    assert np.array_equal(data["amplitude"].to_numpy().ravel(), found.columns.amplitude)
    assert data["damping"].to_numpy() == pytest.approx([0.01, 0.1])
    assert data["belt_speed"].attrs["long_name"].startswith("Speed of the belt")
    frame = found.to_pandas()
    assert list(frame.columns) == ["belt_speed", "damping", *COLUMNS]
    assert len(frame) == 6
    assert frame["damping"].tolist() == pytest.approx(3 * [0.01, 0.1])


def test_a_sweep_over_whole_numbers() -> None:
    drive = ss.scenario(FREE, friction_law="maxwell_slip")
    found = ss.sweep(drive, friction_elements=(1, 4, 4), **SHORT)
    assert found.columns.values["plant.friction.elements"].tolist() == [1, 2, 3, 4]
    assert found.columns.reason.tolist() == [None] * 4
    assert found.to_pandas()["friction_elements"].tolist() == [1, 2, 3, 4]
    assert found.to_xarray()["friction_elements"].to_numpy().tolist() == [1, 2, 3, 4]
    assert found.transitions == {}
    assert "4 points" in repr(found)
    assert isinstance(found.plot(), Figure)


@pytest.mark.parametrize("carry", [None, "both"])
def test_the_tables_have_what_the_columns_have(carry: str | None) -> None:
    found = ss.sweep(FREE, belt_speed=(0.35, 0.45, 3), carry=carry, **SHORT)
    columns = found.columns
    frame, data = found.to_pandas(), found.to_xarray()
    directions = {None: [], "both": ["up", "down"]}.get(carry, [carry])
    for name in quantities_of(Measures):
        if name != "regime":
            assert np.array_equal(frame[name], getattr(columns, name), equal_nan=True)
            assert np.array_equal(
                data[name].to_numpy().ravel(), getattr(columns, name), equal_nan=True
            )
    assert frame["regime"].tolist() == [str(regime) for regime in columns.regime]
    assert data["regime"].to_numpy().ravel().tolist() == frame["regime"].tolist()
    assert frame["turning_points"].tolist() == list(columns.turning_points)
    assert frame["belt_speed"].tolist() == columns.values["plant.belt_speed"].tolist()
    rows = data["turning_points"].to_numpy().reshape(len(frame), -1)
    for row, points in zip(rows, columns.turning_points, strict=True):
        assert tuple(row[~np.isnan(row)]) == points
    if directions:
        assert data["direction"].to_numpy().tolist() == directions
        assert frame["direction"].tolist() == [each for each in directions for _ in range(3)]
        assert data["amplitude"].dims == ("direction", "belt_speed")
    assert data["amplitude"].attrs["units"] == "1"
    assert "units" not in data["regime"].attrs
    assert found.study.plan.continuation == carry


def test_points_without_a_result_are_nan_and_none() -> None:
    found = ss.sweep(ss.scenario(FREE, rate=1.0), friction_static=(0.2, 0.4, 3), **SHORT)
    frame = found.to_pandas()
    assert frame["reason"].notna().tolist() == [True, False, False]
    assert frame["regime"].isna().tolist() == [True, False, False]
    assert np.isnan(frame["amplitude"][0])
    assert found.to_xarray()["regime"].to_numpy()[0] == ""
    assert "must not exceed" in repr(found)


def test_refusals() -> None:
    refused: list[tuple[Any, dict[str, Any], str]] = [
        (ss.sweep, {"belt_sped": (0.1, 0.2, 3)}, "did you mean belt_speed?"),
        (ss.sweep, {"belt_speed": (0.1, 0.2)}, "(first, last, count) or (first, last, count, 'l"),
        (ss.sweep, {"belt_speed": (0.1, 0.2, 3, "lin")}, "must be (first, last, count)"),
        (ss.sweep, {"belt_speed": 0.1}, "belt_speed = 0.1 is invalid"),
        (ss.sweep, {"belt_speed": "abc"}, "belt_speed = 'abc' is invalid"),
        (ss.sweep, {"belt_speed": (0.1, 0.2, 2.5)}, "must be (first, last, count)"),
        (ss.sweep, {"window": (1, 3, 3)}, "analyzer"),
        (ss.sweep, {"belt_speed": (0.1, 0.2, 3), "carry": "left"}, "carry = 'left' is invalid"),
        (ss.sweep, {"belt_speed": (0.1, 0.2, 3), "workers": 0}, "0 workers"),
        (ss.sweep, {"autostart": (0, 1, 2)}, "several nodes"),
        (ss.basin, {"position": (0.0, 1.0)}, "position = (0.0, 1.0) is invalid"),
        (ss.basin, {"velocity": 1.0}, "velocity = 1.0 is invalid"),
        (ss.basin, {"velocity": 1.0, "sample": 3}, "velocity = 1.0 is invalid"),
        (ss.basin, {"sample": 3, "seed": -1}, "seed -1"),
    ]
    lists = [], [0.02], ["a", "b"], np.zeros((2, 2)), [0.02, float("nan")]
    refused += [(ss.sweep, {"belt_speed": values}, "belt_speed") for values in lists]
    for study, options, meant in refused:
        with pytest.raises(InvalidInputError) as refusal:
            study(FREE, **options)
        assert meant in str(refusal.value)
        assert "\n" not in str(refusal.value)


def test_controlled_and_continuous() -> None:
    controlled = ss.scenario("paper", rate=20.0)
    sampled = ss.sweep(controlled, linear_gain=(-2.0, 0.0, 2), **SHORT)
    continuous = ss.sweep(controlled, linear_gain=(-2.0, 0.0, 2), continuous=True, **SHORT)
    assert sampled.study.continuous is False
    assert continuous.study.continuous is True
    assert list(sampled.transitions) != list(continuous.transitions)
    assert continuous.columns.amplitude != pytest.approx(sampled.columns.amplitude, rel=1e-12)


def test_progress_and_a_journal(tmp_path: Any) -> None:
    seen: list[int] = []
    journal = tmp_path / "sweep.part"
    found = ss.sweep(FREE, belt_speed=(0.3, 0.5, 3), journal=journal, progress=seen.append, **SHORT)
    assert all(one <= other for one, other in pairwise(seen))
    assert seen[-1] == 3
    again: list[int] = []
    same = ss.sweep(FREE, belt_speed=(0.3, 0.5, 3), journal=journal, progress=again.append, **SHORT)
    assert again == [3]
    assert same.columns.turning_points == found.columns.turning_points


def test_a_basin_of_a_grid() -> None:
    one = ss.basin(FREE, position=(-1.0, 1.0, 3), velocity=(-1.0, 1.0, 2), **SHORT)
    (attractor,) = one.attractors
    assert attractor.regime is Regime.STICK_SLIP
    assert one.basins.attractors == Basins.from_columns(one.columns).attractors
    assert repr(one).splitlines()[0] == "paper, 6 starts"
    assert isinstance(one.plot(), Figure)
    frame, data = one.to_pandas(), one.to_xarray()
    assert frame["attractor"].tolist() == [0] * 6
    assert frame["initial_position"].tolist() == [-1.0, -1.0, 0.0, 0.0, 1.0, 1.0]
    assert data["attractor"].dims == ("initial_position", "initial_velocity")


def test_a_basin_of_random_starts() -> None:
    found = ss.basin(FREE, position=(-1.0, 1.0), sample=4, seed=2, **SHORT)
    assert np.abs(found.columns.values["plant.initial.position"]).max() <= 1.0
    data = found.to_xarray()
    assert data["initial_position"].dims == ("point",)
    assert data.sizes["point"] == 4
    assert isinstance(found.plot(), Figure)


def test_a_sweep_takes_a_list_or_an_array() -> None:
    drive = ss.scenario("feed_drive", controller=None)
    one = ss.sweep(drive, belt_speed=(0.02, 0.03, 2), transient=5.0, cycles=1)
    for values in ([0.02, 0.03, 0.05], np.array([0.05, 0.03, 0.02])):
        found = ss.sweep(drive, belt_speed=values, transient=5.0, cycles=1)
        assert found.columns.values["plant.belt_speed"].tolist() == list(values)
        assert found.columns.amplitude[1] == one.columns.amplitude[1]
    assert found.plot() is not None
    data = found.to_xarray()
    assert [data[name].attrs["units"] for name in ("belt_speed", "turning_points")] == ["m/s", "m"]
