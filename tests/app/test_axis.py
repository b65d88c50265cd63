"""The scenario `axis`, and any other drive without a spring, in the commands."""

from pathlib import Path

import pytest

from tests.app.conftest import Run


@pytest.mark.long
def test_the_servo_gives_way_by_what_exceeds_the_friction(stickslip: Run, tmp_path: Path) -> None:
    measures = stickslip.json("simulate", "axis", "--plot", "axis.png")
    # The largest force less the mean friction, over the gain of the position.
    amplitude = (60.0 - (20.144 + 20.6277) / 2.0) / 1370728.4554
    assert measures["amplitude"] == pytest.approx(amplitude, rel=0.01)
    assert measures["period"] == pytest.approx(1.0, rel=1e-9)
    assert (measures["regime"], measures["steady"]) == ("stick_slip", True)
    assert (tmp_path / "axis.png").stat().st_size > 10_000


def test_the_bias_force_is_all_that_friction_holds_without_control(stickslip: Run) -> None:
    still = ("simulate", "axis", "--no-control", "-p", "plant.disturbance.kind=none")
    measures = stickslip.json(*still)
    assert (measures["regime"], measures["midpoint"]) == ("stuck", 0.0)
    assert stickslip.json(*still, "-p", "plant.bias_force=20.2")["regime"] is None


def test_a_sweep_measures_the_forced_cycles(stickslip: Run) -> None:
    over = "plant.disturbance.amplitude=10:60:2"
    points = stickslip.json("sweep", "axis", "--over", over)
    assert points["regime"] == ["stuck", "stick_slip"]
    assert points["amplitude"] == pytest.approx([0.0, 28.98e-6], rel=1e-3)
    still, moving = ([round(each, 12) for each in turns] for turns in points["turning_points"])
    assert (len(set(still)), len(set(moving))) == (1, 2)
    assert len(moving) < 40  # a rest is one turning point


def test_a_drive_on_a_belt_goes_with_it(stickslip: Run) -> None:
    loose = ("simulate", "feed_drive", "-p", "plant.stiffness=0", "--duration", "2")
    for flags in ((), ("--continuous-control",), ("--no-control",)):
        done = stickslip(*loose, *flags)
        assert done.returncode == 0, done.stderr
        assert "no whole cycle was completed in 2 s: " in done.stdout
