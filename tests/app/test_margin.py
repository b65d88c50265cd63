"""`stickslip margin` and `ss.margin`."""

from pathlib import Path

import pytest

import stickslip_ros as ss
from tests.app.conftest import Run
from tests.docs.test_json import differences

HOPF = 0.0488763
"""Of feed_drive, m/s."""


def logged(folder: Path, feed: float, **parameters: float) -> Path:
    """Write a run of feed_drive with a tap of 30 um at 3 s, by an encoder of 0.5 um."""
    drive = ss.scenario(
        "feed_drive",
        belt_speed=feed,
        expects_control=False,
        sensor_position_resolution=5e-7,
        disturbance_kind="impulse",
        disturbance_amplitude=300.0,
        disturbance_start=3.0,
        **parameters,
    )
    path = folder / f"{1e3 * feed:g}.csv"
    ss.simulate(drive, duration=5.0).to_pandas().to_csv(path)
    return path


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("logs")
    return [str(logged(folder, feed)) for feed in (0.052, 0.054, 0.056)]


def test_safe_runs_tell_the_onset(logs: list[str], stickslip: Run, tmp_path: Path) -> None:
    done = stickslip("margin", *logs, "--plot", "margin.png", "--html", "margin.html")
    assert done.returncode == 0
    assert "vibration starts at" in done.stdout
    assert "the least feed with a margin of 0.1" in done.stdout
    assert (tmp_path / "margin.png").stat().st_size > 1000
    assert "vibration starts at" in (tmp_path / "margin.html").read_text(encoding="utf-8")
    assert all(line in done.stdout for line in repr(ss.margin(*logs)).splitlines())
    found = ss.margin(*logs, margin=0.2)
    lower, upper = found.onset.lower, found.onset.upper
    assert lower is not None
    assert upper is not None
    assert lower < HOPF < upper
    assert found.onset.speed == pytest.approx(HOPF, rel=0.03)
    assert found.least_feed == pytest.approx(upper / 0.8)
    printed = stickslip.json("margin", *logs, "--margin", "0.2")
    assert printed == found.to_dict()
    assert differences("margin", printed) == []
    assert [each.decay_rate for each in found.onset.feeds] == pytest.approx(
        [2.84, 4.74, 6.72], rel=0.02
    )
    assert "rad/s" in stickslip("margin", *logs, "--rotary").stdout


def test_a_sentence_says_what_would_tell_it(logs: list[str], stickslip: Run) -> None:
    done = stickslip("margin", logs[0])
    assert done.returncode == 0
    assert "the onset of vibration cannot be told" in done.stdout
    assert "a run at another feed, such as" in done.stdout
    assert "no family" not in done.stdout
    done = stickslip("margin", logs[0], "--belt-speed", "0")
    assert done.returncode == 2
    assert done.stdout == ""
    assert "the belt is at rest" in done.stderr
    assert "at least 0 and below 1" in stickslip("margin", logs[0], "--margin", "1").stderr


def test_a_machine_that_may_never_vibrate_has_no_lower_end(stickslip: Run, tmp_path: Path) -> None:
    """Friction falls by 0.66 of the damping at the most."""
    feeds = 0.035, 0.04, 0.045, 0.05
    names = [str(logged(tmp_path, feed, friction_static=0.2544)) for feed in feeds]
    said = stickslip("margin", *names, "--plot", "margin.png").stdout
    assert "vibration starts below" in said
    assert "mm/s, if at all; the least feed" in said
    assert "stribeck                 none" in said
    printed = stickslip.json("margin", *names)
    assert printed["onset_speed"] is printed["interval"][0] is None
    assert printed["families"][0]["onset_speed"] is None
    assert differences("margin", printed) == []


def test_both_directions_are_refused(logs: list[str], stickslip: Run, tmp_path: Path) -> None:
    drive = ss.scenario("feed_drive", belt_speed=-0.05, expects_control=False)
    back = tmp_path / "back.csv"
    ss.simulate(drive, duration=2.0).to_pandas().to_csv(back)
    assert "both directions" in stickslip("margin", logs[0], str(back)).stderr
