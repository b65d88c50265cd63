"""Slip by slip: a sawtooth with known slips, and records of paper on paper where they are found."""

import os
from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures import Regime
from stickslip_ros.measures.sample_assumptions import SampleAssumptions
from stickslip_ros.measures.slips import SlipThreshold, slip_report, slips_in
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.record.table_file import read_table
from tests.measures import records

BELT, SLIP_TIME = 1e-3, 0.04
LEAST = SlipThreshold(1e-4)
DATA = Path(
    os.environ.get("STICKSLIP_DATA", Path(__file__).parents[3] / "shared" / "data"),
    "paper_on_paper",
)
WEIGHT = 0.0307 * 9.81
COUNTED_BY_HAND = 36
"""Slips in the first 60 s of the record at 168 N/m and 42 um/s, in a plot of ten seconds a line."""
recorded = pytest.mark.skipif(not DATA.exists(), reason=f"the recordings are not in {DATA}")


def sawtooth(noise: float = 0.0, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times, positions and the drops of slips that last half a cosine."""
    random = np.random.default_rng(seed)
    position, drops = [0.0], random.uniform(0.3e-3, 1e-3, 30)
    for drop in drops:
        rise = round(random.uniform(0.5, 1.5) / 1e-3)
        position += (position[-1] + BELT * 1e-3 * np.arange(1, rise + 1)).tolist()
        phase = np.linspace(0.0, np.pi, round(SLIP_TIME / 1e-3))[1:]
        position += (position[-1] - drop / 2.0 * (1.0 - np.cos(phase))).tolist()
    position += (position[-1] + BELT * 1e-3 * np.arange(1, 300)).tolist()
    time = np.arange(len(position)) * 1e-3
    return time, np.array(position) + noise * random.standard_normal(len(position)), drops


@pytest.mark.parametrize("noise", [0.0, 5e-6])
def test_the_slips_of_a_sawtooth_are_found(noise: float) -> None:
    time, position, drops = sawtooth(noise)
    found = slips_in(time, position, LEAST)
    assert [slip.drop for slip in found] == pytest.approx(drops.tolist(), abs=5e-6 + 4.0 * noise)
    # From a tenth to nine tenths, a half cosine takes 0.59 of its time.
    assert [slip.slip_time for slip in found] == pytest.approx([0.59 * SLIP_TIME] * 30, abs=3e-3)
    speeds = [slip.stick_velocity for slip in found[1:]]
    errors = [slip.stick_velocity_error for slip in found[1:]]
    assert np.mean(speeds) == pytest.approx(BELT, rel=0.01)
    if noise:
        assert np.std(np.array(speeds) - BELT) == pytest.approx(np.mean(errors), rel=0.5)
    report = slip_report(found, LEAST, BELT)
    assert report["count"] == 30
    assert report["regime"] is Regime.STICK_SLIP
    assert report["each"]["stick_time"][0] is None
    assert report["drop"]["mean"] == pytest.approx(drops.mean(), rel=0.02)


def test_impulses_and_slow_drops_are_no_slips() -> None:
    time = np.arange(20_000) * 1e-3
    position = -2e-4 * time
    position[500::1000] -= 1e-2
    assert slips_in(time, position, LEAST) == []


def test_a_slip_that_is_not_recorded_as_a_whole_is_none() -> None:
    time, position, drops = sawtooth()
    (starts,) = np.nonzero(np.diff(position) < 0.0)
    whole = slips_in(time, position, LEAST)
    cut = int(starts[-1]) - 5  # before the end of the last one
    assert len(drops) == len(whole)
    assert slips_in(time[:cut], position[:cut], LEAST) == whole[:-1]


def test_an_oscillation_is_no_stick_slip() -> None:
    time = np.arange(20_000) * 1e-3
    found = slips_in(time, 1e-3 * np.sin(2.0 * np.pi * 15.0 * time), LEAST)
    report = slip_report(found, LEAST, BELT)
    assert report["count"] == pytest.approx(300, abs=2)
    assert report["regime"] is Regime.PURE_SLIP


@pytest.mark.parametrize("threshold", [(0.0, 0.1), (1e-6, 0.0), (float("nan"), 0.1)])
def test_a_threshold_that_is_none_is_refused(threshold: tuple[float, float]) -> None:
    with pytest.raises(InvalidInputError, match=r"is invalid: must be above 0"):
        SlipThreshold(*threshold)


def columns(stiffness: int, speed: int) -> dict[str, str]:
    return {
        "time": "t",
        "position": f"Fnorm*{WEIGHT / stiffness!r}",
        "belt_velocity": f"{speed}e-6",
    }


@pytest.mark.process
@recorded
def test_the_slips_of_paper_on_paper_are_those_that_are_seen() -> None:
    samples = read_table(DATA / "k168Nm_v42.mat", columns(168, 42)).samples
    time = (samples.stamp - samples.stamp[0]) * 1e-9
    part = (time < 60.0) & samples.is_valid
    found = slips_in(time[part], samples.position[part], SlipThreshold(2e-3 / 168))
    assert len(found) == pytest.approx(COUNTED_BY_HAND, rel=0.05)


@pytest.mark.long
@pytest.mark.process
@recorded
@pytest.mark.parametrize(("speed", "regime"), [(42, "stick_slip"), (4300, "pure_slip")])
def test_stick_slip_is_told_apart_from_inertial_motion(speed: int, regime: str) -> None:
    path = DATA / f"k168Nm_v{speed}.mat"
    report = report_of_recording(path, columns(168, speed), slips=SlipThreshold(2e-3 / 168))
    assert report["slips"]["regime"] == regime
    if speed == 42:
        # The spring's end moves some 9 % faster than is said, or the spring is stiffer.
        velocity = report["slips"]["stick_velocity"]
        assert velocity["mean"] / 42e-6 == pytest.approx(1.09, abs=0.03)
        assert velocity["standard_error"] / 42e-6 < 0.01


def unlike_sticks(noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times and positions of 60 sticks of 15 to 85 ms and slips of 20 ms, at 250 Hz."""
    random, position = np.random.default_rng(1), [0.0]
    for _ in range(60):
        ride = int(0.05 * random.uniform(0.3, 1.7) * 250.0)
        position += (position[-1] + 8e-6 * np.arange(1, ride + 1)).tolist()
        end = -random.uniform(0.2, 1.0) * 5e-5
        course = 0.5 * (1.0 - np.cos(np.pi * np.arange(1, 6) / 5.0))
        position += (position[-1] + (end - position[-1]) * course).tolist()
    told = np.array(position) + noise * random.standard_normal(len(position))
    return np.arange(len(told)) * 0.004, told


@pytest.mark.parametrize("quick", [False, True])
def test_where_cycles_are_not_alike_rests_and_slips_tell_how_long_it_sticks(quick: bool) -> None:
    time, position = unlike_sticks(3e-6)
    stamps = np.rint(time * 1e9).astype(np.int64)
    told = records.columns(stamps, position, belt_velocity=2e-3)
    found = records.fed(told, SampleAssumptions(noisy=True)).measures(quick=quick)
    assert found.regime is Regime.STICK_SLIP
    assert found.errors is not None
    assert 0.02 < found.errors["stick_fraction"] < 0.1
    assert found.stick_fraction == pytest.approx(0.727, abs=2 * found.errors["stick_fraction"])
