"""Simulated runs: trajectory, measures, figure and tables."""

import sys

import numpy as np
import pytest
from matplotlib.figure import Figure

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.studies.simulate import simulate

COLUMNS = ["time", "position", "velocity"]
COLUMNS += ["friction_force", "control_force", "belt_position", "belt_velocity"]


@pytest.fixture(scope="module")
def feed_run() -> ss.Run:
    """A short run of a drive with units."""
    return ss.simulate(ss.scenario("feed_drive", start_after=0.1, belt_speed=0.03), duration=1.0)


def test_twice_the_same_and_as_without_a_trajectory(feed_run: ss.Run) -> None:
    other = ss.simulate(feed_run.scenario, duration=1.0)
    assert feed_run.measures == other.measures == simulate(feed_run.scenario, 1.0)
    assert list(vars(feed_run.trajectory)) == COLUMNS
    for column in COLUMNS:
        ours = getattr(feed_run.trajectory, column)
        assert ours.dtype == float
        assert np.array_equal(ours, getattr(other.trajectory, column))


def test_continuous_control_is_sampled_at_the_same_instants() -> None:
    drive = ss.scenario("feed_drive", rate=20000.0, start_after=0.05)
    sampled = ss.simulate(drive, duration=0.3).trajectory
    run = ss.simulate(drive, duration=0.3, continuous=True)
    assert np.array_equal(run.trajectory.time, sampled.time)
    assert run.trajectory.position == pytest.approx(sampled.position, abs=2e-6)
    assert run.trajectory.control_force == pytest.approx(sampled.control_force, abs=2.0)
    assert run.trajectory.belt_position == pytest.approx(sampled.belt_position)
    expected = simulate(drive, 0.3, continuous=True)
    assert run.measures.amplitude == pytest.approx(expected.amplitude, rel=1e-9)


def test_a_run_away_ends_the_trajectory() -> None:
    run = ss.simulate(ss.scenario("paper", cubic_gain=10.0, initial_velocity=20.0), duration=10.0)
    assert run.measures.regime == "unbounded"
    assert 1 < len(run.trajectory) < 1001


def test_short_runs() -> None:
    for duration, samples in ((0.0, 1), (0.004, 5), (0.0099999999999, 11)):
        for continuous in (False, True):
            run = ss.simulate("feed_drive", duration=duration, continuous=continuous)
            assert len(run.trajectory) == samples
            assert "no whole cycle" in repr(run)
    assert isinstance(run.plot(), Figure)


def test_what_cannot_be_simulated_is_refused(feed_run: ss.Run) -> None:
    for duration in (-1.0, float("nan"), float("inf"), 1e308):
        with pytest.raises(InvalidInputError, match="must be from 0 to"):
            ss.simulate("paper", duration=duration)
    with pytest.raises(InvalidInputError, match=r"plant\.force_delay"):
        ss.simulate(ss.scenario("paper", force_delay=0.1), 1.0, continuous=True)
    with pytest.raises(InvalidInputError, match="style = 'poster' is invalid: must be one of scr"):
        feed_run.plot(style="poster")


def test_it_prints_with_units_and_plots_for_notebooks_and_journals(feed_run: ss.Run) -> None:
    assert repr(feed_run).splitlines()[0] == "feed_drive, 1 s"
    assert "µm" in repr(feed_run)
    html: str = feed_run._repr_html_()  # pyright: ignore
    assert html.count("<table>") == 1
    assert "µm" in html
    assert repr(ss.simulate("paper", duration=1.0)).startswith("paper, 1\n")
    figure = feed_run.plot(style="paper")
    assert len(figure.axes) > 5
    assert figure._repr_png_()[:4] == b"\x89PNG"  # pyright: ignore
    assert figure.get_figwidth() == pytest.approx(85.0 / 25.4)


def test_tables_have_the_arrays_with_units(feed_run: ss.Run) -> None:
    frame, data = feed_run.to_pandas(), feed_run.to_xarray()
    assert frame.index.name == "time"
    assert list(frame.columns) == COLUMNS[1:]
    assert np.array_equal(data["time"], feed_run.trajectory.time)
    for name in COLUMNS[1:]:
        assert np.array_equal(frame[name], getattr(feed_run.trajectory, name))
        assert data[name].dims == ("time",)
        assert np.array_equal(data[name], getattr(feed_run.trajectory, name))
    assert frame.attrs["units"]["position"] == "m"
    assert data["control_force"].attrs == {"long_name": "control force", "units": "N"}
    assert data.attrs["overrides"].endswith("plant.belt_speed=0.03")
    assert ss.simulate("paper", duration=0.1).to_xarray()["position"].attrs["units"] == "1"


def test_a_package_that_is_missing_is_named(
    feed_run: ss.Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package, convert in (("pandas", ss.Run.to_pandas), ("xarray", ss.Run.to_xarray)):
        monkeypatch.setitem(sys.modules, package, None)
        with pytest.raises(RunError, match=rf"{package}.*pip install 'stickslip_ros\[analysis\]'"):
            convert(feed_run)


def test_what_makes_the_measures_doubtful_is_noted() -> None:
    coarse = ss.scenario("feed_drive", sensor_position_resolution=1e-4, expects_control=False)
    run = ss.simulate(coarse, duration=3)
    (note,) = run.notes
    assert note.startswith("the amplitude is only 4.6 steps of the encoder")
    assert repr(run).splitlines()[-1] == note
    assert ss.simulate("feed_profile", duration=0.5).notes == [
        "belt, load, disturbance or reference vary: a drift is not judged"
    ]


def test_lengths_of_a_dimensionless_drive_have_no_unit_in_notes() -> None:
    reference = {"kind": "sine", "amplitude": 1.0, "frequency": 0.1}
    values = {f"pid_controller.reference.{name}": value for name, value in reference.items()}
    drive = ss.scenario("paper", controller="pid", belt_speed=0.0).changed(
        {**values, "plant.sensor.position_resolution": 5.0}
    )
    note = "positions tell none below 2e-06"
    assert ss.simulate(drive, 20).notes[-1].endswith(note)


def test_a_run_has_the_truth_and_what_is_told() -> None:
    run = ss.simulate(
        ss.scenario("feed_drive", sensor_position_resolution=1e-4, sensor_velocity="difference"),
        duration=1.0,
    )
    assert run.truth.amplitude == ss.simulate("feed_drive", duration=1.0).measures.amplitude
    table = run.to_pandas()
    told = table["measured_position"].to_numpy()
    assert told == pytest.approx(table["position"].to_numpy(), abs=0.5001e-4)
    assert told / 1e-4 == pytest.approx(np.rint(told / 1e-4), abs=1e-9)
    assert table.attrs["units"]["measured_velocity"] == "m/s"
    assert repr(run).splitlines()[1].split() == ["measured", "true"]
