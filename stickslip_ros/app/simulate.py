"""`stickslip simulate`: the closed loop without ROS, measured on the motion itself."""

import argparse
from math import ceil, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_picture,
    made_of,
    naming,
    scenario_of,
    seconds,
    writing,
)
from stickslip_ros.app.no_cycle import why_no_cycle
from stickslip_ros.app.output import print_figures, print_json, progress_bar
from stickslip_ros.physics.loop.simulation import Progress, simulate_continuous, simulate_sampled
from stickslip_ros.physics.loop.washout import Washout
from stickslip_ros.physics.measures.breakpoints import Breakpoints
from stickslip_ros.physics.measures.cycles import Cycle, CycleMeter, Measures
from stickslip_ros.physics.model.disturbance import DisturbanceKind
from stickslip_ros.physics.model.equations import WashoutGains
from stickslip_ros.physics.motion.motion import Motion
from stickslip_ros.plots.units import Units
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.settled import check_continuous, sampled_loop

if TYPE_CHECKING:
    from stickslip_ros.plots.run_history import RunHistory

HELP = "run a scenario without ROS and measure its motion"

_DEFAULT_PERIODS = 200.0

_DRAWN_PER_PERIOD = 64
"""Points in a natural period of what is drawn, at least."""
_DRAWN_SHARE, _DRAWN_AT_ONCE = 500, 50
"""Part of the breakpoints so far, and how many at least, between which a cycle's end is told."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario(parser)
    parser.add_argument(
        "--duration",
        type=seconds,
        metavar="S",
        help=f"simulated time, s (default: the scenario's, else {_DEFAULT_PERIODS:g} periods)",
    )
    parser.add_argument(
        "--continuous-control",
        action="store_true",
        help="let the controller act without sampling, as in the paper's eq. 19 "
        "(default: the force is held from sample to sample, as between the nodes)",
    )
    add_plot(parser, "motion, force, cycles and friction law")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    scenario = scenario_of(arguments)
    duration = arguments.duration
    if duration is None and isfinite(scenario.plant.duration):
        duration = scenario.plant.duration
    elif duration is None:
        duration = _DEFAULT_PERIODS * scenario.plant.as_drive().natural_period
    plot: Path | None = arguments.plot
    history = None if plot is None else _history_to_draw(plot)
    units = Units.of(scenario.plant.as_drive())
    shown = f"{duration:g} {units.of_unit('s')}".rstrip()
    with progress_bar(f"simulating {shown}", 1.0) as progress:
        measures = simulate(
            scenario,
            duration,
            continuous=arguments.continuous_control,
            progress=progress,
            history=history,
        )
    if plot is not None and history is not None:
        _draw(plot, scenario, history, measures)
    if arguments.json:
        print_json({**measures.as_dict(), "duration": duration, **made_of(scenario)})
    else:
        print_figures(f"{scenario.name}, {shown}", {"": measures.as_dict()}, {"": units})
        reason = why_no_cycle(measures.regime, duration, scenario.plant.as_drive())
        if reason is not None:
            print(reason)
    return 0


def simulate(
    scenario: Scenario,
    duration: float,
    *,
    continuous: bool = False,
    progress: Progress,
    history: "RunHistory | None" = None,
) -> Measures:
    """Return the measures of the scenario's motion over `duration` (s), put down in `history`.

    Raises InvalidInputError for what continuous control does not have.
    """
    if continuous:
        with naming("--continuous-control:"):
            check_continuous(scenario)
    plant, washout = scenario.plant, scenario.washout_controller.as_washout()
    controlled = washout if plant.expects_control else None
    given: Any = {"continuous_control": continuous, "record": True}
    start = plant.as_drive(), plant.initial.position, plant.initial.velocity
    if history is None:
        motion, meter = Motion(*start, **given), CycleMeter(scenario.analyzer.window)
    else:
        motion = _DrawnMotion(*start, **given)
        meter = _DrawingMeter(scenario.analyzer.window, history, motion)
    if not continuous:
        law = Washout(controlled) if controlled else None
        return simulate_sampled(sampled_loop(plant, motion), motion, law, duration, meter, progress)
    return simulate_continuous(motion, controlled, duration, meter, progress)


class _DrawnMotion(Motion):
    """A motion that notes its forces, its breakpoints no further apart than is drawn."""

    def __init__(self, *start: Any, **given: Any) -> None:
        self.forces: list[tuple[float, float, float, float]] = []
        """Time (s) and force (N) from then on; time, and friction force (N) up to then."""
        self._gains_set: WashoutGains | None = None
        self._now = 0.0
        super().__init__(*start, **given)

    def set_gains(self, corner_frequency: float, linear: float, cubic: float) -> None:
        super().set_gains(corner_frequency, linear, cubic)
        self._gains_set = WashoutGains(corner_frequency, linear, cubic)

    def advance(self, duration: float) -> None:
        pieces = max(1, ceil(duration / self.drive.natural_period * _DRAWN_PER_PERIOD))
        for _ in range(pieces):
            if self.unbounded:
                break
            start, force = self._now, self.force
            if self._gains_set is not None:
                force = self._gains_set.force(self.velocity - self.low_passed)
            super().advance(duration / pieces)
            self._now += duration / pieces
            self.forces.append((start, force, self._now, self.friction_force))


class _DrawingMeter(CycleMeter):
    """A meter that puts down what it measures."""

    def __init__(self, window: int, history: "RunHistory", motion: _DrawnMotion) -> None:
        super().__init__(window)
        self._history, self._motion = history, motion
        self._breakpoints = 0

    def feed(self, breakpoints: Breakpoints, belt_speed: float) -> list[Cycle]:
        completed: list[Cycle] = []
        most = max(_DRAWN_AT_ONCE, self._breakpoints // _DRAWN_SHARE)
        self._breakpoints += len(breakpoints)
        for start in range(0, len(breakpoints), most):
            piece = breakpoints[start : start + most]
            cycles = super().feed(piece, belt_speed)
            self._history.take_breakpoints(piece, belt_speed, cycles)
            completed += cycles
        forces = np.array(self._motion.forces).reshape(-1, 4).T
        self._motion.forces.clear()
        self._history.take_control(forces[0], forces[1])
        self._history.take_friction(forces[2], forces[3])
        return completed


def _history_to_draw(path: Path) -> "RunHistory":
    # Half as long again to import as everything else.
    from stickslip_ros.plots.run_history import RunHistory

    check_picture(path)
    return RunHistory()


def _draw(path: Path, scenario: Scenario, history: "RunHistory", measures: Measures) -> None:
    from stickslip_ros.plots.run_figure import run_figure
    from stickslip_ros.plots.style import save

    disturbed = scenario.plant.disturbance.kind is not DisturbanceKind.NONE
    title = " ".join([scenario.name, *scenario.overrides])
    force = "control force and disturbance" if disturbed else "control force"
    with writing("--plot", path):
        figure = run_figure(history, measures, scenario.plant.as_drive(), title=title, force=force)
        save(figure, path)
