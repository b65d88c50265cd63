"""Properties of every motion, for any drive, law, belt direction and forces."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.physics.model.friction import (
    Directional,
    Exponential,
    FrictionLaw,
    Stribeck,
    Table,
)
from tests.examples import examples
from tests.physics.courses import Course, courses

# Gauss-Legendre quadrature: eight nodes are exact to rounding for what changes by a factor of e, or
# by a radian, from one end of a panel to the other.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


def finest_speed(law: FrictionLaw) -> float:
    """Return the speed within which a law changes, for the quadrature."""
    if isinstance(law, Directional):
        return min(finest_speed(law.forward), finest_speed(law.reverse))
    if isinstance(law, Table):  # the curvature jumps at its points
        return float(np.diff([speed for speed, _ in law.points]).min()) / 50.0
    return law.characteristic_speed


def has_fractional_power(law: FrictionLaw) -> bool:
    """Return whether the law has a power of the speed that is no whole number."""
    if isinstance(law, Directional):
        return has_fractional_power(law.forward) or has_fractional_power(law.reverse)
    return isinstance(law, Exponential) and law.exponent % 1.0 != 0.0


class Works:
    """Works (J) of all that acts on the slide, by quadrature over the motion itself."""

    def __init__(self, course: Course) -> None:
        self.course = course
        self.motion = course.motion()
        self.total = 0.0
        self.turnover = 0.0
        """Sum of the magnitudes, the scale of rounding."""
        self.largest_sticking_friction = 0.0

    def add(self, duration: float, speeds: tuple[float, float]) -> None:
        """Go on for `duration` (s) while the motion is smooth and its speed between those two."""
        panels = max(1, int(np.ceil(duration * max(self._rate(speed) for speed in speeds))))
        # A law changes within a certain speed, however fast that is passed.
        finest = finest_speed(self.course.drive.friction)
        panels = max(panels, int(np.ceil(4.0 * abs(speeds[1] - speeds[0]) / finest)))
        edges = np.linspace(0.0, 1.0, panels + 1)
        if has_fractional_power(self.course.drive.friction):
            # The series ends where the slide turns on the belt: at an end of the motion.
            close = edges[1] * 0.25 ** np.arange(1.0, 9.0)
            edges = np.unique([*edges, *close, *(1.0 - close)])
        for width in np.diff(edges).tolist():
            self._add_panel(width * duration)

    def _rate(self, speed: float) -> float:
        """How fast (1/s) anything can change at a speed of the slide, at most."""
        drive = self.course.drive
        unit = drive.speed_scale
        steepest = 0.0
        for relative_speed in (0.0, speed - drive.belt_speed):
            sign = np.copysign(1.0, relative_speed)
            rise = drive.friction.coefficient(relative_speed + 1e-6 * unit, sign)
            rise -= drive.friction.coefficient(relative_speed, sign)
            steepest = max(steepest, abs(rise) / 1e-6)
        return drive.angular_frequency * (1.0 + drive.damping_coefficient + steepest)

    def _add_panel(self, duration: float) -> None:
        drive, motion = self.course.drive, self.motion
        works = np.zeros(4)
        now = 0.0
        for node, weight in zip((1.0 + NODES) / 2.0, WEIGHTS / 2.0, strict=True):
            motion.advance(node * duration - now)
            now = node * duration
            forces = np.array(
                [
                    motion.friction_force,
                    -drive.damping * motion.velocity,
                    -drive.stiffness * motion.position,
                    motion.force,
                ]
            )
            works += weight * duration * forces * motion.velocity
            if motion.sticking:
                self.largest_sticking_friction = max(
                    self.largest_sticking_friction, abs(motion.friction_force)
                )
        motion.advance(duration - now)
        self.total += works.sum()
        self.turnover += np.abs(works).sum()


def measured_works(course: Course) -> Works:
    """The works over a course, split where slip begins and ends."""
    outcome = course.run()
    assume(outcome is not None)
    assert outcome is not None
    works = Works(course)
    done = 0.0
    for force, duration, breakpoints in zip(
        course.forces, course.durations, outcome[1], strict=True
    ):
        works.motion.force = force
        splits = np.clip(breakpoints.time - done, 0.0, duration).tolist()
        speeds = [works.motion.velocity, *breakpoints.velocity.tolist()]
        for (before, after), ends in zip(pairwise([0.0, *splits]), pairwise(speeds), strict=True):
            works.add(after - before, ends)
        done += duration
    return works


# The slide starts at the speed of the belt, where a power of the relative speed has no series.
STARTING = Course(
    drive=Drive(1.0, 0.0, 1.0, 1.0, 1.0, Exponential(1.0, 0.0, 1.0, 0.1, exponent=1.5)),
    position=2.0,
    velocity=1.0,
    forces=(0.0,),
    durations=(1.0,),
)


def check_energy(course: Course) -> None:
    works = measured_works(course)
    drive = course.drive
    start, end = course.velocity, works.motion.velocity
    gained = drive.mass * (end**2 - start**2) / 2.0
    scale = works.turnover + drive.normal_force * drive.length_scale
    assert gained == pytest.approx(works.total, rel=0.0, abs=1e-9 * scale)


@given(courses())
@example(course=STARTING)
@examples(quick=15, thorough=300)
def test_energy_gained_is_the_work_done(course: Course) -> None:
    check_energy(course)


@given(courses())
@examples(quick=15, thorough=100)
def test_friction_holds_no_more_than_its_limit(course: Course) -> None:
    works = measured_works(course)
    limit = course.drive.friction.static * course.drive.normal_force
    assert works.largest_sticking_friction <= limit * (1.0 + 1e-12)


def check_cutting(course: Course, cuts: list[float]) -> None:
    """Advance in one go, in steps ending at `cuts` (0 to 1), and from breakpoint to breakpoint."""
    outcome = course.run()
    assume(outcome is not None)
    assert outcome is not None
    in_one_go, pieces = outcome
    by_cuts, by_breakpoints = course.motion(), course.motion()
    done = 0.0
    for force, duration, breakpoints in zip(course.forces, course.durations, pieces, strict=True):
        by_cuts.force = by_breakpoints.force = force
        for before, after in pairwise([0.0, *sorted(cuts), 1.0]):
            by_cuts.advance((after - before) * duration)
        for before, after in pairwise([done, *breakpoints.time.tolist()]):
            by_breakpoints.advance(after - before)
        done += duration
    length = max(float(np.abs(breakpoints.position).max()) for breakpoints in pieces)
    speed = max(float(np.abs(breakpoints.velocity).max()) for breakpoints in pieces)
    length += course.drive.length_scale
    speed += course.drive.speed_scale
    for cut in (by_cuts, by_breakpoints):
        assert cut.position == pytest.approx(in_one_go.position, rel=0.0, abs=1e-9 * length)
        assert cut.velocity == pytest.approx(in_one_go.velocity, rel=0.0, abs=1e-9 * speed)


cuts = st.lists(st.floats(0.0, 1.0), max_size=30)


# Friction rises from nothing to its static coefficient within a hundredth of the time that the
# rest of the motion takes to change: a step of the integrator must not be longer.
SUDDEN = Course(
    drive=Drive(1.0, 0.0, 1.0, 1.0, 1.0, Exponential(1.0, 0.0, 0.21875, -0.5)),
    position=0.0,
    velocity=1.0,
    forces=(0.0, 0.0, 1.0),
    durations=(2.0, 2.0, 8.0),
)

# The power of the speed has no series at zero, where the slide turns.
TURNING = Course(
    drive=Drive(1.0, 0.0, 1.0, 1.0, 0.0, Exponential(1.0, 0.0, 1.0, 0.1, exponent=1.5)),
    position=2.0,
    velocity=1.0,
    forces=(0.0,),
    durations=(1.0,),
)


@given(courses(), cuts)
@example(course=SUDDEN, cuts=[])
@example(course=TURNING, cuts=[])
@examples(quick=15, thorough=300)
def test_cutting_into_steps_changes_nothing(course: Course, cuts: list[float]) -> None:
    check_cutting(course, cuts)


# Where a step ends, time is the sum of the steps, and a breakpoint of the next may follow at once.
ROUNDED = Course(
    drive=Drive(1.0, 0.0, 1e8, 1.0, 0.0, Stribeck(1.0, 0.0, 1e-4)),
    position=0.0,
    velocity=0.0,
    forces=(0.0, 0.0),
    durations=(9.112469373472214e-05, 1e-4),
)


@given(courses(), cuts)
@example(course=ROUNDED, cuts=[0.71875, 2.2250738585e-313])
@examples(quick=15, thorough=100)
def test_breakpoints_never_run_back(course: Course, cuts: list[float]) -> None:
    motion = course.motion()
    times: list[float] = []
    for force, duration in zip(course.forces, course.durations, strict=True):
        motion.force = force
        for before, after in pairwise([0.0, *sorted(cuts), 1.0]):
            motion.advance((after - before) * duration)
            times += motion.take_breakpoints().time.tolist()
    assume(not motion.unbounded)
    assert all(earlier <= later for earlier, later in pairwise(times))
    # The last step ends with a breakpoint.
    assert times[-1] == pytest.approx(sum(course.durations), rel=1e-12)


@given(courses())
@examples(quick=15, thorough=100)
def test_si_units_give_the_dimensionless_motion(course: Course) -> None:
    outcome = course.run()
    assume(outcome is not None)
    assert outcome is not None
    si, unit = outcome[0], course.dimensionless().run()
    assume(unit is not None)
    assert unit is not None
    drive = course.drive
    speed = max(1.0, *(float(np.abs(breakpoints.velocity).max()) for breakpoints in unit[1]))
    length = max(1.0, *(float(np.abs(breakpoints.position).max()) for breakpoints in unit[1]))
    assert si.position / drive.length_scale == pytest.approx(
        unit[0].position, rel=0.0, abs=1e-9 * length
    )
    assert si.velocity / drive.speed_scale == pytest.approx(
        unit[0].velocity, rel=0.0, abs=1e-9 * speed
    )
    assert si.friction_force / drive.normal_force == pytest.approx(
        unit[0].friction_force, rel=1e-9, abs=1e-9 * length
    )
