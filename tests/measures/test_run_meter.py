import numpy as np
import pytest

from stickslip_ros.measures.run_meter import RunMeter
from stickslip_ros.measures.run_report import report_of
from stickslip_ros.samples import NO_FORCES, ForceColumns
from tests.measures.records import columns

PERIOD = 10_000_000  # of 100 Hz, in ns


def decaying(count: int) -> ForceColumns:
    """Forces of alternating sign that fall off from 1 N."""
    numbers = np.arange(count)
    return ForceColumns(10**9 + PERIOD * numbers, (-1.0) ** numbers / (1.0 + numbers))


def test_what_was_sent_and_what_acted_are_measured_apart() -> None:
    meter = RunMeter(window=5, dropped_known=True)
    forces = decaying(300)
    meter.feed_forces(forces, forces[np.array([0, 299])])
    meter.finish()
    report = report_of(meter)
    assert (report["peak_force"], report["peak_applied_force"]) == (1.0, 0.5)
    assert report["resting_force"] == report["resting_applied_force"] == pytest.approx(1.0 / 271.0)
    assert report["dropped_forces"] == 2


@pytest.mark.parametrize(
    ("later", "note"),
    [
        (9, None),
        (35, "the first control force is 350 ms after the first sample: what acted before is not"),
        (500, "the stamps of the control forces are later than those of all samples"),
    ],
)
def test_forces_that_begin_after_the_samples_are_noted(later: int, note: str | None) -> None:
    """A recorder may hear the plant, and the controller only later."""
    meter = RunMeter(window=5)
    forces = decaying(301)
    zero = np.zeros(301)
    meter.motion.feed(columns(forces.stamp, zero, zero))
    meter.feed_forces(ForceColumns(forces.stamp + later * PERIOD, forces.force), NO_FORCES)
    notes = report_of(meter)["notes"]
    assert [each[: len(note or "")] for each in notes] == ([] if note is None else [note])
