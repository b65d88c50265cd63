import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.physics.samples import ForceMeter, RunMeter

PERIOD = 10_000_000  # of 100 Hz, in ns


def decaying(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Forces of alternating sign that fall off from 1 N."""
    numbers = np.arange(count)
    return 10**9 + PERIOD * numbers, (-1.0) ** numbers / (1.0 + numbers)


def test_without_forces_there_is_neither_peak_nor_rest() -> None:
    meter = ForceMeter()
    meter.feed(np.array([], dtype=np.int64), np.array([]))
    assert meter.peak_force is None
    assert meter.resting_force is None


@given(st.integers(1, 3000), st.integers(1, 3000))
def test_the_peak_is_the_largest_magnitude(count: int, block: int) -> None:
    stamp, force = decaying(count)
    force[count // 2] = -7.0
    meter = ForceMeter()
    for start in range(0, count, block):
        meter.feed(stamp[start : start + block], force[start : start + block])
    assert meter.peak_force == 7.0


@pytest.mark.parametrize("count", [50, 300, 3000, 30_000])
@pytest.mark.parametrize("block", [1, 100, 30_000])
def test_the_resting_force_is_the_largest_over_the_last_tenth(count: int, block: int) -> None:
    stamp, force = decaying(count)
    meter = ForceMeter()
    for start in range(0, count, block):
        meter.feed(stamp[start : start + block], force[start : start + block])
    assert meter.resting_force is not None
    # The tenth need not be cut to the sample.
    assert 1.0 / count < meter.resting_force <= 1.5 / (0.9 * count)


def test_the_report_of_a_run() -> None:
    meter = RunMeter(window=5)
    stamp, force = decaying(300)
    time = (stamp - stamp[0]) * 1e-9
    # Two and a quarter turns at 0.75 Hz, seen from the trough on.
    angle = 2.0 * np.pi * 0.75 * time
    meter.motion.feed(stamp, -np.cos(angle), 1.5 * np.pi * np.sin(angle), np.full(len(stamp), 6.0))
    meter.force.feed(stamp, force)
    report = meter.report()
    assert report["samples"] == 300
    assert report["lost_samples"] == 0
    assert report["duration"] == pytest.approx(2.99)
    assert report["peak_force"] == 1.0
    assert report["regime"] == "pure_slip"
    assert report["cycles"] == 1
    assert report["amplitude"] == pytest.approx(1.0, rel=1e-6)
    assert report["frequency"] == pytest.approx(0.75, rel=1e-6)
    assert report["velocity_amplitude"] == pytest.approx(1.5 * np.pi, rel=1e-6)
