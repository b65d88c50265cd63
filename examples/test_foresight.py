"""Effect of Foresight on the feed drive when its forces come 20 ms late."""

import pytest
from foresight import Foresight


@pytest.mark.parametrize("belt_speed", [0.02, 0.04])
def test_the_vibration_goes(closed_loop, belt_speed):
    """Within three seconds, and no force is left."""
    drive = ("feed_drive", "plant.force_delay=0.02", f"plant.belt_speed={belt_speed}")
    loop = closed_loop(*drive, controller=Foresight)
    loop.run(3.0)  # s, simulated
    result = loop.run(1.0)
    assert result.late_forces == 0
    assert result.measures.regime == "equilibrium"
    assert result.resting_force < 0.1  # N
