"""An analyzer that ends twice, once killed; `python -m benchmarks.restarts` restarts each node."""

from pathlib import Path

import pytest

from benchmarks.restarts import restarts
from stickslip_ros.record.bag_files import runs_of
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import report_of_recording


@pytest.mark.long
@pytest.mark.process
def test_bags_of_an_analyzer_that_is_restarted_are_sound_and_one_run(tmp_path: Path) -> None:
    first, *lines = restarts("analyzer", "realtime", 2, tmp_path)
    assert "2 restarts, 3 bags" in first
    assert any("plant: active" in line for line in lines)
    bag, *others = (tmp_path / name for name in ("bag", "bag_2", "bag_3"))
    runs = runs_of([bag, *others])
    assert list(runs) == [bag]
    assert list(runs[bag]) == others
    assert all(gap > 0.0 for gap in runs[bag].values())
    stamps: list[int] = []
    for path in (bag, *others):
        with Recording(path) as recording:
            stamps += recording.joint_states.stamp.tolist()
    report = report_of_recording(bag, continued=runs[bag])
    assert report["samples"] == len(stamps)
    periods = (stamps[-1] - stamps[0]) / 1e6
    assert report["lost_samples"] == round(periods) + 1 - len(stamps)
