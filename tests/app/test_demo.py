"""`make demo`, including the set-up."""

import subprocess
import sys
from pathlib import Path

import pytest

from stickslip_ros.record.report import report_of_recording
from tests.nodes.graph import PATIENCE

pytestmark = [pytest.mark.long, pytest.mark.process]


def test_before_and_after_a_bag_and_a_picture(
    process_environment: dict[str, str], tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "stickslip_ros.app.demo"],
        cwd=tmp_path,
        env=process_environment,
        capture_output=True,
        text=True,
        timeout=4 * PATIENCE,
    )
    assert done.returncode == 0, done.stderr
    for shown in ("before", "after", "434.1 µm", "stick-slip", "steady sliding", "119.8 N"):
        assert shown in done.stdout
    (bag,) = (tmp_path / "bags").glob("feed_drive-*Z")
    (picture,) = (tmp_path / "bags").glob("*.png")
    assert str(bag.relative_to(tmp_path)) in done.stdout
    assert str(picture.relative_to(tmp_path)) in done.stdout
    report = report_of_recording(bag)
    assert report["samples"] == 10_001
    assert report["lost_samples"] == 0
    assert report["complete"]
