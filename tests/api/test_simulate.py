"""Simulated runs: trajectory, measures, figure and tables."""

import json
import sys
from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.physics.loop.controller import answer
from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.studies.simulate import simulate

COLUMNS = [
    "time",
    "position",
    "velocity",
    "friction_force",
    "control_force",
    "belt_position",
    "belt_velocity",
]


@pytest.mark.parametrize("name", ["paper", "feed_drive"])
@pytest.mark.parametrize("duration", [3.0, 0.5])
def test_twice_the_same_and_as_without_a_trajectory(name: str, duration: float) -> None:
    drive = ss.scenario(name, start_after=0.1)
    one, other = ss.simulate(drive, duration=duration), ss.simulate(drive, duration=duration)
    assert one.measures == other.measures == simulate(drive, duration)
    assert list(vars(one.trajectory)) == COLUMNS
    for column in COLUMNS:
        ours = getattr(one.trajectory, column)
        assert ours.dtype == float
        assert np.array_equal(ours, getattr(other.trajectory, column))


def test_the_command_has_the_same_measures(capsys: pytest.CaptureFixture[str]) -> None:
    from stickslip_ros.app.main import main

    with pytest.raises(SystemExit):
        main(["simulate", "feed_drive", "--duration", "2", "--json"])
    printed = json.loads(capsys.readouterr().out)
    measures = ss.simulate("feed_drive", duration=2).measures.as_dict()
    assert {name: printed[name] for name in measures} == measures


def test_the_trajectory_is_that_of_the_loop() -> None:
    drive = ss.scenario("feed_drive", start_after=0.2, force_delay=0.0015, initial_velocity=0.01)
    plant = drive.plant
    motion = Motion(plant.as_drive(), 0.0, 0.01)
    loop: SampledLoop = plant.as_loop(motion)
    controller = drive.controller.as_controller()
    rows: list[tuple[float, ...]] = []
    for _ in range(501):
        sample = loop.sample
        force = answer(loop, controller)
        rows.append((*sample[1:4], force, *sample[4:]))
        loop.advance()
    found = ss.simulate(drive, duration=0.5).trajectory
    assert np.array_equal(found.time, np.arange(501) / 1000.0)
    columns = np.array(rows).T
    for name, expected in zip(COLUMNS[1:], columns, strict=True):
        assert getattr(found, name) == pytest.approx(expected, rel=1e-9, abs=1e-12), name
    assert np.any(found.control_force)


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
    again = ss.simulate(drive, duration=0.3, continuous=True)
    assert again.measures == run.measures


def test_slow_samples_change_no_measure_but_by_rounding() -> None:
    drive = ss.scenario("feed_drive", rate=100.0, expects_control=False)
    run = ss.simulate(drive, duration=3.0)
    assert run.measures.amplitude == pytest.approx(simulate(drive, 3.0).amplitude, rel=1e-9)
    assert len(run.trajectory) == 301
    assert not run.trajectory.control_force.any()


def test_a_motion_is_integrated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[object] = []
    advanced: list[float] = []
    advance = Motion.advance

    def counted(motion: Motion, duration: float) -> None:
        made.append(motion)
        advanced.append(duration)
        advance(motion, duration)

    monkeypatch.setattr(Motion, "advance", counted)
    run = ss.simulate("feed_drive", duration=0.5)
    run.plot()
    assert len(set(map(id, made))) == 1
    assert sum(advanced) == pytest.approx(0.5)


def test_a_run_away_ends_the_trajectory() -> None:
    run = ss.simulate(ss.scenario("paper", cubic_gain=10.0, initial_velocity=20.0), duration=10.0)
    assert run.measures.regime == "unbounded"
    assert 1 < len(run.trajectory) < 1001


@pytest.mark.parametrize(("duration", "samples"), [(0.0, 1), (0.004, 5), (0.0099999999999, 11)])
@pytest.mark.parametrize("continuous", [False, True])
def test_short_runs(duration: float, samples: int, continuous: bool) -> None:
    run = ss.simulate("feed_drive", duration=duration, continuous=continuous)
    assert len(run.trajectory) == samples
    assert isinstance(run.plot(), Figure)
    assert "no whole cycle" in repr(run)


def test_the_default_duration_is_that_of_the_command() -> None:
    assert ss.simulate(ss.scenario("paper", duration=2.0)).duration == 2.0
    drive = ss.scenario("paper", rate=1.0)
    assert ss.simulate(drive).duration == pytest.approx(200 * 2 * np.pi)


@pytest.mark.parametrize("duration", [-1.0, float("nan"), float("inf")])
def test_a_duration_that_is_none_is_refused(duration: float) -> None:
    with pytest.raises(InvalidInputError, match="must be finite, 0 or more"):
        ss.simulate("paper", duration=duration)


def test_what_continuous_control_lacks_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"plant\.force_delay"):
        ss.simulate(ss.scenario("paper", force_delay=0.1), 1.0, continuous=True)


def test_it_prints_with_units() -> None:
    run = ss.simulate("feed_drive", duration=1.0)
    assert repr(run).splitlines()[0] == "feed_drive, 1 s"
    assert "µm" in repr(run)
    html: str = run._repr_html_()  # pyright: ignore
    assert html.count("<table>") == 1
    assert "µm" in html
    assert repr(ss.simulate("paper", duration=1.0)).startswith("paper, 1\n")


def test_it_plots_twice_and_in_a_notebook() -> None:
    run = ss.simulate("feed_drive", duration=0.5)
    one, other = run.plot(), run.plot()
    assert len(one.axes) == len(other.axes) > 5
    assert one._repr_png_()[:4] == b"\x89PNG"  # pyright: ignore


def test_it_plots_for_a_journal() -> None:
    run = ss.simulate("feed_drive", duration=0.5)
    assert run.plot(style="paper").get_figwidth() == pytest.approx(85.0 / 25.4)
    with pytest.raises(InvalidInputError, match="style = 'poster' is refused: must be one of scr"):
        run.plot(style="poster")


def test_pandas_has_the_arrays() -> None:
    run = ss.simulate("feed_drive", duration=0.2)
    frame = run.to_pandas()
    assert frame.index.name == "time"
    assert list(frame.columns) == COLUMNS[1:]
    for name in COLUMNS[1:]:
        assert np.array_equal(frame[name], getattr(run.trajectory, name))
    assert frame.attrs["units"]["position"] == "m"
    assert run.to_pandas().equals(frame)


def test_xarray_has_the_arrays_with_units() -> None:
    run = ss.simulate(ss.scenario("feed_drive", belt_speed=0.03), duration=0.2)
    found = run.to_xarray()
    assert np.array_equal(found["time"], run.trajectory.time)
    for name in COLUMNS[1:]:
        assert found[name].dims == ("time",)
        assert np.array_equal(found[name], getattr(run.trajectory, name))
    assert found["control_force"].attrs == {"long_name": "control force", "units": "N"}
    assert found.attrs["overrides"] == "plant.belt_speed=0.03"
    assert ss.simulate("paper", duration=0.1).to_xarray()["position"].attrs["units"] == "1"


@pytest.mark.parametrize(
    ("package", "convert"), [("pandas", ss.Run.to_pandas), ("xarray", ss.Run.to_xarray)]
)
def test_a_package_that_is_missing_is_named(
    package: str, convert: Callable[[ss.Run], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = ss.simulate("paper", duration=0.1)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(RunError, match=rf"{package}.*pip install 'stickslip_ros\[analysis\]'"):
        convert(run)
