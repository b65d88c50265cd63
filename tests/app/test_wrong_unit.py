"""Belt speeds that may be in another unit than m/s."""

from tests.app.conftest import Run

FAST = "a belt speed of 30 m/s is refused: more than 10 times 0.1 m/s, the scale of speed of this "


def test_they_are_refused(stickslip: Run) -> None:
    for command in (
        "design feed_drive --belt-speed 2:30",
        "sweep feed_drive --over plant.belt_speed=2:30:20",
        "sweep feed_drive --over plant.damping=0:30:20 --over plant.belt_speed=-30:2:20",
        "basin feed_drive -p plant.belt_speed=30",
        "stability feed_drive -p plant.belt_speed=30",
        "simulate feed_drive -p plant.belt_speed=-30",
        "run feed_drive -p plant.belt_speed=30",
        "simulate feed_drive -p plant.belt.kind=sine -p plant.belt.amplitude=29.96",
    ):
        done = stickslip(*command.split())
        assert (done.returncode, done.stdout) == (2, ""), command
        (line,) = done.stderr.splitlines()
        assert FAST in line
        assert line.endswith("add --yes")


def test_what_is_meant_is_taken(stickslip: Run) -> None:
    for scenario in (
        "feed_drive -p plant.belt_speed=1",
        "feed_drive -p plant.belt_speed=30 --yes",
        "feed_drive -p plant.belt_speed=30 -p plant.friction.minimum_speed=3",
        "paper -p plant.belt_speed=10",
    ):
        done = stickslip("simulate", *scenario.split(), "--no-control", "--duration", "0.1")
        assert done.returncode == 0, done.stderr
