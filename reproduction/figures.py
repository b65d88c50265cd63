"""The paper's figures 2 to 13 as data, computed from the equations.

Everything is dimensionless: the drives have mass and normal force 1, so that their SI values are
those of the paper. Parameter values that the paper does not print are chosen to show the behaviour
that its text describes.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from stickslip_ros.arrays import BoolArray, FloatArray
from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.measures.cycle_measures import Cycle, Measures, Regime
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, FrictionLaw, Linear, Stribeck
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.options import SettlingOptions
from stickslip_ros.studies.plan import ListedAxis
from stickslip_ros.studies.runner import compute_columns
from stickslip_ros.studies.settling import CYCLES, ControlledDrive
from stickslip_ros.studies.study import Study, sweep_study
from stickslip_ros.studies.transitions import hopf_margin, transitions

STRIBECK = Stribeck(static=0.4, minimum=0.25, minimum_speed=0.5)
"""The paper's friction law with the paper's constants."""

PRINTED_SLOPE = 3.0 * (STRIBECK.static - STRIBECK.minimum) / STRIBECK.minimum_speed
"""Slope of the linear law as printed in section 3.3."""

TANGENT_SLOPE = PRINTED_SLOPE / 2.0
"""Slope of the cubic law, eq. 3, at zero relative speed."""

PERIODS = 300.0
"""Default duration of a trajectory, in natural periods."""

SAMPLES_PER_PERIOD = 64
"""Samples in a natural period."""

LAST_CYCLES = 5
"""Number of cycles at the end of a trajectory that are measured."""

SETTLED = 0.01
"""Largest deviation of the speed amplitude of a settled cycle, as a share of the belt speed."""

POINTS = 1000
"""Number of drives in a bifurcation diagram."""

SETTLING = SettlingOptions(transient=300.0, cycles=6)
"""Settling of the motions of a bifurcation diagram."""


def unit_drive(
    belt_speed: float,
    *,
    damping: float = 0.02,
    stiffness: float = 1.0,
    friction: FrictionLaw = STRIBECK,
) -> Drive:
    """Return a drive whose SI values are the paper's: `damping` 2 beta, `stiffness` gamma."""
    return Drive(1.0, damping, stiffness, 1.0, belt_speed, friction)


class PortraitCase(NamedTuple):
    """A motion from rest at X = 0."""

    label: str
    """The parameters that distinguish it from the other cases of its panel."""
    drive: Drive
    gains: Washout | None = None
    """Gains of a washout controller, active from the start without sampling (eq. 19); SI units."""
    duration: float | None = None
    """Duration, s; None for `PERIODS` natural periods."""


@dataclass(frozen=True)
class Portrait:
    """The trajectory of a case, and its measures."""

    case: PortraitCase
    trajectory: Breakpoints
    """The motion from rest, finely sampled, to its end or until it diverges."""
    measures: Measures
    """Means of the last cycles, `LAST_CYCLES` at most."""
    settling_time: float | None
    """Start (s) of the first cycle from which on all have the speed amplitude of the last ones,
    within `SETTLED` belt speeds. None if the motion may not have settled: except in equilibrium,
    half of the trajectory must be settled."""

    @property
    def drive(self) -> Drive:
        """The drive of the case."""
        return self.case.drive

    @property
    def amplitude(self) -> float:
        """The final displacement amplitude, zero at rest."""
        at_rest = self.measures.regime is Regime.EQUILIBRIUM
        return 0.0 if at_rest else self.measures.amplitude or 0.0

    @property
    def runs_away(self) -> bool:
        """Whether the motion diverges."""
        return self.measures.regime is Regime.UNBOUNDED

    @property
    def vibrates(self) -> bool:
        """Whether it ends in a limit cycle."""
        return self.measures.regime in CYCLES

    @property
    def last_cycles(self) -> Breakpoints:
        """The end of the trajectory: `LAST_CYCLES` cycles, or natural periods if there are none."""
        time = self.trajectory.time
        period = self.measures.period or self.drive.natural_period
        return self.trajectory[time >= time[-1] - LAST_CYCLES * period]

    @property
    def least_relative_speed(self) -> float | None:
        """Smallest |X' - v0| in the last cycles, m/s: 0 if it sticks, None if it diverges."""
        if self.runs_away:
            return None
        return float(np.abs(self.last_cycles.velocity - self.drive.belt_speed).min())

    def time_beyond(self, speed: float) -> float | None:
        """Return the time (s) when |X'| first exceeds `speed` (m/s); None if it does not."""
        speeds = np.abs(self.trajectory.velocity)
        beyond = np.flatnonzero(speeds > speed)
        if len(beyond) == 0:
            return None
        samples = slice(max(int(beyond[0]) - 1, 0), int(beyond[0]) + 1)
        return float(np.interp(speed, speeds[samples], self.trajectory.time[samples]))


class Portraits(tuple[Portrait, ...]):
    """Some portraits, and a quantity of each."""

    __slots__ = ()

    @property
    def belt_speeds(self) -> list[float]:
        """The belt speeds."""
        return [each.drive.belt_speed for each in self]

    @property
    def regimes(self) -> list[Regime | None]:
        """The final regimes."""
        return [each.measures.regime for each in self]

    @property
    def amplitudes(self) -> list[float]:
        """The final displacement amplitudes, zero at rest."""
        return [each.amplitude for each in self]

    @property
    def stick_fractions(self) -> list[float]:
        """The stick fractions of the vibrating motions."""
        return [each.measures.stick_fraction or 0.0 for each in self if each.vibrates]

    def between(self, low: float, high: float) -> "Portraits":
        """Return those with a belt speed above `low` and below `high`."""
        return Portraits(each for each in self if low < each.drive.belt_speed < high)


@dataclass(frozen=True)
class BifurcationPlan:
    """What a bifurcation diagram varies."""

    title: str
    label: str
    """Name and symbol of the quantity on the axis."""
    ends: tuple[float, float]
    """Its first and last value."""
    parameter: str
    """Parameter of a scenario that it determines."""
    belt_speed: float = 0.4
    to_parameter: Callable[[float], float] = float
    """Returns the parameter for a value of the quantity."""
    from_parameter: Callable[[float], float] = float
    """Returns the quantity for a value of the parameter."""


@dataclass(frozen=True)
class BifurcationFigure:
    """A figure of one bifurcation diagram: a sweep, computed when it is first needed."""

    number: int
    values: FloatArray
    """Values of the quantity on the axis of the figure."""

    @property
    def plan(self) -> "BifurcationPlan":
        """What is varied."""
        return _BIFURCATIONS[self.number]

    @property
    def title(self) -> str:
        """Title of the figure."""
        return self.plan.title

    @cached_property
    def study(self) -> Study:
        """The sweep over the parameter of the drive that the quantity determines."""
        scenario = load_scenario("paper").changed(
            {"plant.expects_control": False, "plant.belt_speed": self.plan.belt_speed}
        )
        listed = tuple(map(self.plan.to_parameter, self.values.tolist()))
        axis = ListedAxis(self.plan.parameter, listed[0], listed[-1], len(listed), listed=listed)
        return sweep_study(scenario, [axis], settling=SETTLING)

    @cached_property
    def columns(self) -> Columns:
        """The motion that each drive settles on from rest at X = 0."""
        return compute_columns(self.study)

    @cached_property
    def drives(self) -> list[Drive]:
        """The drive of each value."""
        return [self.study.case(row)[0].drive for row in range(len(self.values))]

    @property
    def vibrating(self) -> BoolArray:
        """Whether each drive ends in a limit cycle."""
        return np.array([regime in CYCLES for regime in self.columns.regime])

    @property
    def transitions(self) -> dict[str, float]:
        """The values of the quantity at the transitions that the diagram shows, by name."""
        (axis,) = self.study.plan.axes
        found = transitions(self.study, axis)
        return {name: self.plan.from_parameter(places[-1]) for name, places in found.items()}

    @property
    def unstable_equilibria(self) -> FloatArray:
        """The displacement of the unstable equilibrium for each drive, NaN if it is stable."""
        margins = [hopf_margin(ControlledDrive(drive)) for drive in self.drives]
        rest = [drive.equilibrium_position for drive in self.drives]
        return np.where(np.less(margins, 0.0), rest, np.nan)


class Panel(NamedTuple):
    """A group of phase portraits."""

    title: str
    """The parameters that they share."""
    portraits: Portraits


@dataclass(frozen=True)
class PortraitFigure:
    """A figure of phase portraits."""

    number: int
    title: str
    panels: tuple[Panel, ...]

    @property
    def portraits(self) -> Portraits:
        """The portraits of all panels, in order."""
        return Portraits(portrait for panel in self.panels for portrait in panel.portraits)


PaperFigure = BifurcationFigure | PortraitFigure


def compute_figure(number: int, *, points: int = POINTS) -> PaperFigure:
    """Return the data of figure `number`, one of `NUMBERS`.

    `points` is the number of drives in a bifurcation diagram.
    """
    if number in _BIFURCATIONS:
        return BifurcationFigure(number, np.linspace(*_BIFURCATIONS[number].ends, points))
    title, panels = _PORTRAITS[number]
    computed = (Panel(name, Portraits(map(portrait_of, cases))) for name, cases in panels.items())
    return PortraitFigure(number, title, tuple(computed))


def portrait_of(case: PortraitCase) -> Portrait:
    """Return the trajectory of a case, and its measures."""
    drive = case.drive
    motion = RecordedMotion(drive, 0.0, 0.0, case.gains)
    duration = PERIODS * drive.natural_period if case.duration is None else case.duration
    samples = round(duration / drive.natural_period * SAMPLES_PER_PERIOD)
    for _ in range(samples):
        motion.advance(duration / samples)
        if motion.unbounded:
            break
    breakpoints = motion.take_breakpoints()
    trajectory = replace(breakpoints, time=breakpoints.time - breakpoints.time[0])
    meter = CycleMeter(LAST_CYCLES)
    cycles = meter.feed(trajectory, drive.belt_speed)
    if motion.unbounded:
        meter.unbounded = True
    measures = meter.measures()
    settling_time = (
        None if motion.unbounded else _settling_time(trajectory, cycles, measures, drive)
    )
    return Portrait(case, trajectory, measures, settling_time)


def _settling_time(
    trajectory: Breakpoints, cycles: Sequence[Cycle], measures: Measures, drive: Drive
) -> float | None:
    if not cycles:
        return None
    amplitudes = np.array([cycle.velocity_amplitude for cycle in cycles])
    final = amplitudes[-LAST_CYCLES:].mean()
    off = np.flatnonzero(np.abs(amplitudes - final) > SETTLED * abs(drive.belt_speed))
    first = int(off[-1]) + 1 if len(off) > 0 else 0
    time = _first_rise(trajectory) + sum(cycle.period for cycle in cycles[:first])
    at_rest = measures.regime is Regime.EQUILIBRIUM
    return time if at_rest or time <= trajectory.time[-1] / 2.0 else None


def _first_rise(trajectory: Breakpoints) -> float:
    """Return the time when the velocity first rises through zero, the start of the first cycle."""
    falling = int(np.argmax(trajectory.velocity < 0.0))
    rise = falling + int(np.argmax(trajectory.velocity[falling:] >= 0.0))
    return float(trajectory.time[rise])


def _cases(
    parameter: str,
    values: Sequence[float],
    drive: Callable[[float], Drive],
    duration: float | None = None,
) -> list[PortraitCase]:
    return [PortraitCase(f"{parameter} {v:g}", drive(v), duration=duration) for v in values]


def _dampings(
    betas: Sequence[float], belt_speed: float, friction: FrictionLaw = STRIBECK
) -> list[PortraitCase]:
    return _cases(
        "β =", betas, lambda beta: unit_drive(belt_speed, damping=2.0 * beta, friction=friction)
    )


def _stiffnesses(stiffnesses: Sequence[float], belt_speed: float) -> list[PortraitCase]:
    return _cases("γ =", stiffnesses, lambda k: unit_drive(belt_speed, stiffness=k))


def _stribeck(minimum: float) -> Stribeck:
    return Stribeck(STRIBECK.static, minimum, STRIBECK.minimum_speed)


def _gains(corner_frequency: float, gains: Sequence[tuple[float, float]]) -> list[PortraitCase]:
    return [
        PortraitCase(
            f"k1 = {k1:g}, k2 = {k2:g}",
            unit_drive(0.4),
            Washout(corner_frequency, k1, k2),
            duration=_LONG_DURATION,
        )
        for k1, k2 in gains
    ]


_LONG_DURATION = 3000.0
"""Duration in which a slow motion settles too."""

_DRIVE = "drive of the paper, no control"

_BIFURCATIONS = {
    2: BifurcationPlan(
        f"Bifurcation diagram over the belt speed, {_DRIVE}: β = 0.01",
        "belt speed v0",
        (0.0, 1.0),
        "plant.belt_speed",
    ),
    3: BifurcationPlan(
        f"Bifurcation diagram over the damping, {_DRIVE}: v0 = 0.477",
        "damping β (the coefficient of X' is 2β)",
        (0.0, 0.05),
        "plant.damping",
        0.477,
        lambda beta: 2.0 * beta,
        lambda damping: damping / 2.0,
    ),
    4: BifurcationPlan(
        f"Bifurcation diagram over the stiffness, {_DRIVE}: v0 = 0.2, β = 0.01",
        "stiffness γ (at fixed scales)",
        (0.2, 5.0),
        "plant.stiffness",
        0.2,
    ),
    5: BifurcationPlan(
        f"Bifurcation diagram over the ratio of friction coefficients, {_DRIVE}: "
        "v0 = 0.4, β = 0.01, μs = 0.4",
        "ratio of static to smallest kinetic coefficient, μs / μm",
        (1.0, 2.0),
        "plant.friction.minimum",
        to_parameter=lambda ratio: STRIBECK.static / ratio,
        from_parameter=lambda minimum: STRIBECK.static / minimum,
    ),
}

_PORTRAITS: dict[int, tuple[str, Mapping[str, Sequence[PortraitCase]]]] = {
    6: (
        f"Phase portraits at several belt speeds, {_DRIVE}",
        {"β = 0.01": _cases("v0 =", (0.2, 0.3, 0.42, 0.45, 0.48, 0.495, 0.6), unit_drive)},
    ),
    7: (
        f"Phase portraits with several dampings, {_DRIVE}",
        {"v0 = 0.4": _dampings((0.01, 0.03, 0.045, 0.06, 0.09), 0.4)},
    ),
    8: (
        f"Phase portraits with several dampings and Coulomb friction, {_DRIVE}",
        {"v0 = 0.2": _dampings((0.0, 0.01, 0.05, 0.1), 0.2, Coulomb(STRIBECK.static))},
    ),
    9: (
        f"Phase portraits with friction that falls linearly with speed, {_DRIVE}",
        {
            f"v0 = 0.2, slope {TANGENT_SLOPE:g}: that of the Stribeck law at zero speed": (
                _dampings((0.01, 0.05, 0.1, 0.2, 0.23), 0.2, Linear(STRIBECK.static, TANGENT_SLOPE))
            ),
            f"v0 = 0.2, slope {PRINTED_SLOPE:g}: as printed": (
                _dampings((0.01, 0.1, 0.2, 0.3, 0.44), 0.2, Linear(STRIBECK.static, PRINTED_SLOPE))
            ),
            f"v0 = 0.05, slope {PRINTED_SLOPE:g}: as printed": (
                _dampings((0.01, 0.1, 0.2, 0.3, 0.44), 0.05, Linear(STRIBECK.static, PRINTED_SLOPE))
            ),
        },
    ),
    10: (
        f"Phase portraits with several stiffnesses, {_DRIVE}",
        {
            "v0 = 0.2, β = 0.01": _stiffnesses((0.5, 1.0, 2.0, 4.0, 10.0, 50.0), 0.2),
            "v0 = 0.2, β = 0.01: stiffer": _stiffnesses((100.0, 400.0, 1000.0), 0.2),
            "v0 = 0.439, β = 0.01": _stiffnesses((1.0, 2.0), 0.439),
        },
    ),
    11: (
        f"Phase portraits with several smallest kinetic coefficients, {_DRIVE}",
        {
            "v0 = 0.4, β = 0.01, μs = 0.4": _cases(
                "μm =",
                (0.10, 0.25, 0.35, 0.37, 0.39),
                lambda minimum: unit_drive(0.4, friction=_stribeck(minimum)),
            )
        },
    ),
    12: (
        f"Phase portraits near the critical feed speed, sooner and later, {_DRIVE}",
        {
            f"2β = {damping:g}, up to τ = {duration:g}": (
                _cases("v0 =", (0.48, 0.49, 0.492), partial(unit_drive, damping=damping), duration)
            )
            for damping in (0.01, 0.02)
            for duration in (300.0, _LONG_DURATION)
        },
    ),
    13: (
        "Phase portraits, drive of the paper, washout control",
        {
            "v0 = 0.4, d = 2: linear gain": _gains(
                2.0, [(k1, 0.0) for k1 in (0.0, -0.3, -0.5, -0.7, -0.9, -1.0)]
            ),
            "v0 = 0.4, d = 2: cubic gain": _gains(
                2.0, [(0.0, k2) for k2 in (-5.0, -20.0, -50.0, -100.0)]
            ),
            "v0 = 0.4, d = 0.2: linear gain": _gains(
                0.2, [(k1, 0.0) for k1 in (-0.05, -0.1, -0.13, -0.16)]
            ),
        },
    ),
}

NUMBERS = tuple(sorted([*_BIFURCATIONS, *_PORTRAITS]))
"""The numbers of the figures; figure 1 is a drawing of the model."""
