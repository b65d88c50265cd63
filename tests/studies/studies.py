"""Short scenarios and studies for the tests, with every kind of result."""

from stickslip_ros.progress import Progress
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.studies.columns import Point
from stickslip_ros.studies.plan import Axis, Continuation, Grid
from stickslip_ros.studies.runner import compute_columns
from stickslip_ros.studies.settling import SettlingOptions
from stickslip_ros.studies.study import Study

SHORT = SettlingOptions(transient=5.0, cycles=2)
"""Long enough to tell one motion from another."""

EXPONENTIAL = (
    *("plant.expects_control=false", "plant.damping=0.1", "plant.friction.law=exponential"),
    *("plant.friction.static=1.0", "plant.friction.kinetic=0.5"),
    *("plant.friction.decay_speed=0.5", "plant.friction.viscous=0.0"),
)
"""A law under which rest and limit cycle coexist, from the Hopf point on."""

HOPF_SPEED = 1.1512925464970229
"""Of that law, where its slope is the damping: 0.5 ln 10 m/s."""

CYCLE_LOST_SPEED = 1.8366
"""Of that law, where its limit cycle meets the unstable one, m/s."""


def paper(*overrides: str) -> Scenario:
    """Return the scenario of the paper, under control."""
    return load_scenario("paper", overrides)


def free(*overrides: str) -> Scenario:
    """Return the scenario of the paper without control."""
    return paper("plant.expects_control=false", *overrides)


def speeds(
    count: int, first: float = 0.2, last: float = 0.6, *, carry: Continuation | None = None
) -> Study:
    """Return a study of the free drive over so many belt speeds."""
    return Study(free(), Grid((Axis("plant.belt_speed", first, last, count),), carry), SHORT)


def points_of(study: Study) -> list[Point]:
    """Return the points of a study that nothing disturbs, computed in this process."""
    return list(compute_columns(study).points())


def stop_at(count: int) -> Progress:
    """Return a progress that interrupts a study when so many of its points are done."""

    def progress(done: float) -> None:
        if done >= count:
            raise KeyboardInterrupt

    return progress
