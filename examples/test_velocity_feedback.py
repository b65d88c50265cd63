"""Effect of VelocityFeedback on the feed drive."""

import pytest
from velocity_feedback import VelocityFeedback


@pytest.mark.parametrize("belt_speed", [0.02, 0.04])
def test_the_vibration_goes(closed_loop, belt_speed):
    """Within a second, and without much force."""
    loop = closed_loop("feed_drive", f"plant.belt_speed={belt_speed}", controller=VelocityFeedback)
    first = loop.run(1.0)  # s, simulated
    assert first.late_forces == 0
    assert first.peak_force < 200.0  # N
    result = loop.run(0.5)
    assert result.measures.regime == "equilibrium"


def test_a_blow_is_forgotten(closed_loop):
    """A push of 100 N for 10 ms, and the slide comes back to where it was."""
    loop = closed_loop("feed_drive", controller=VelocityFeedback)
    resting = loop.run(1.0).states.position[-1]
    loop.disturb(100.0)  # N
    assert max(loop.run(0.01).states.velocity) > 1e-3  # m/s
    loop.disturb(0.0)
    assert loop.run(1.0).states.position[-1] == pytest.approx(resting, abs=1e-9)
