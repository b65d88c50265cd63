"""The theory of a running drive, computed in a process of its own when parameters change."""

import os
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from math import ceil, copysign, log2
from multiprocessing import active_children, get_context
from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from stickslip_ros.app.dashboard.run_state import RunState
from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError, StickslipError
from stickslip_ros.model.drive import Drive
from stickslip_ros.nodes.base.child_process import end_with
from stickslip_ros.scenarios.parameters import CONTROLLER_PARAMETERS
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.theory.bifurcation_branches import BifurcationBranches
from stickslip_ros.theory.gain_intervals import gains_of, why_no_gains
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop, why_no_linear_loop
from stickslip_ros.theory.stability_map import StabilityMap

Values = Mapping[str, Any]
"""Parameters of a node by flat name."""

_SETTLING_TIME = 0.3
"""Time, s, without a change before a computation starts: a slider may still move."""
_SPEEDS = 30
_POINTS = 61


class FrictionCurve(NamedTuple):
    """Friction coefficient in steady slip over the relative speed."""

    relative_speed: FloatArray
    """m/s, shape (n,)."""
    coefficient: FloatArray
    """Shape (n,); at rest both limits."""


class Decay(NamedTuple):
    """How small deviations from the equilibrium of the sampled loop decay."""

    uncontrolled: list[complex]
    """Exponents without control, 1/s: a deviation changes like exp(s t)."""
    uncontrolled_rate: float
    """Decay rate without control, 1/s; below zero the deviation grows."""
    controlled: list[complex]
    """Exponents with control; empty for a drive that expects none."""
    rate: float | None
    """Decay rate with control, 1/s."""


def bifurcation(plant: Values) -> BifurcationBranches:
    """Return the equilibria and limit cycles over the belt speed, without control.

    Raises InvalidInputError for friction with a memory, too, which takes up to minutes.
    """
    drive = _drive(plant)
    if drive.friction.states:
        raise InvalidInputError(
            "with this friction law the diagram takes up to minutes: `stickslip stability SCENARIO "
            "--no-control --plot FILE` draws it"
        )
    return BifurcationBranches.around(drive, _SPEEDS)


def stability_map(plant: Values, law: str, controller: Values) -> StabilityMap:
    """Return the decay rates over the gains, around those in use."""
    model = CONTROLLER_PARAMETERS[law].changed(controller, law).control_law
    gains = gains_of(model)
    if gains is None:
        raise InvalidInputError(f"{why_no_gains(model)}")
    return StabilityMap.around(_loop(plant), gains, _POINTS)


def decay(plant: Values, law: str, controller: Values) -> Decay:
    """Return the exponents of the sampled loop, and its decay rate."""
    loop = _loop(plant)
    exponents = np.linalg.eigvals(loop.jacobian) * loop.drive.angular_frequency
    uncontrolled, slowest = exponents.tolist(), -float(exponents.real.max())
    if not (controller and plant.get("expects_control")):
        return Decay(uncontrolled, slowest, [], None)
    model = CONTROLLER_PARAMETERS[law].changed(controller, law).control_law
    multipliers = np.linalg.eigvals(loop.transition_matrix(model)).astype(complex)
    lasting = multipliers[np.abs(multipliers) > 0.0]
    controlled = (loop.rate * np.log(lasting)).tolist()
    return Decay(uncontrolled, slowest, controlled, loop.decay_rate(model))


def friction_curve(plant: Values) -> FrictionCurve:
    """Return the friction curve around the belt speed, in both directions."""
    drive = _drive(plant)
    farthest = 2.0 * (abs(drive.belt_speed) or drive.speed_scale)
    side = farthest * np.linspace(0.0, 1.0, 121) ** 2
    speed = np.concatenate([-side[::-1], side])
    sign = np.repeat([-1.0, 1.0], len(side))
    return FrictionCurve(speed, np.array(drive.friction.coefficient(speed, sign), dtype=float))


def _drive(plant: Values) -> Drive:
    return PlantParameters().changed(plant, "plant").as_drive()


def _loop(plant: Values) -> LinearSampledLoop:
    parameters = PlantParameters().changed(plant, "plant")
    drive, sampling = parameters.as_drive(), parameters.linear_sampling
    loop = LinearSampledLoop.from_drive(drive, *sampling)
    if loop is None:
        raise InvalidInputError(f"{why_no_linear_loop(drive, *sampling)}")
    return loop


@dataclass
class Result:
    """The newest result of a computation, and what is to be computed next."""

    compute: Callable[..., Any]
    value: Any = None
    refusal: str = ""
    """Why there is none; empty while nothing was computed."""
    version: int = 0
    """Number of results so far."""
    asked: tuple[Any, ...] = ()
    changed_at: float = 0.0
    answered: str = ""
    """Inputs of the result, as text: a NaN that was received twice is no change."""

    @property
    def is_stale(self) -> bool:
        """Whether it is that of other inputs than those asked for."""
        return bool(self.asked) and repr(self.asked) != self.answered


class Theory:
    """Computes what the charts of the theory show, one computation at a time.

    Nothing is computed while no page asks: `follow` is called by each open page.
    """

    def __init__(self, run: RunState) -> None:
        self._run = run
        self._results = {
            compute: Result(compute)
            for compute in (friction_curve, decay, stability_map, bifurcation)
        }
        self._pool: ProcessPoolExecutor | None = None
        self._running: tuple[Result, tuple[Any, ...], Future[Any]] | None = None
        self._closed = False

    def result(self, computation: Callable[..., Any]) -> Result:
        """Return the newest result of one of the computations of this module."""
        return self._results[computation]

    def follow(self) -> None:
        """Take a finished result, and start the next computation whose parameters changed."""
        if self._closed:
            return
        now = monotonic()
        for result in self._results.values():
            inputs = self._inputs(result.compute)
            if repr(inputs) != repr(result.asked):
                result.asked, result.changed_at = inputs, now
        self._take()
        for result in self._results.values():
            due = result.is_stale and now - result.changed_at > _SETTLING_TIME
            if self._running is None and due:
                self._running = result, result.asked, self._submit(result)

    def close(self) -> None:
        """End the process; nothing is computed from then on."""
        self._closed = True
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
            for process in active_children():  # what it computes would be waited for at the exit
                process.terminate()

    def _inputs(self, computation: Callable[..., Any]) -> tuple[Any, ...]:
        """Return the arguments of a computation; empty if they are not known.

        The ranges of map and diagram follow gains and belt speed by octaves, so that the present
        point moves in a figure that stays.
        """
        plant = dict(self._run.parameters["plant"])
        if not plant:
            return ()
        if computation is friction_curve:
            return (plant,)
        if computation is bifurcation:
            return (plant | {"belt_speed": _octave(plant.get("belt_speed"))},)
        controller = dict(self._run.parameters[self._run.controller])
        if computation is stability_map:
            if not controller:
                return ()
            gains = "corner_frequency", "linear_gain"
            controller |= {name: _octave(controller[name]) for name in gains if name in controller}
        return (plant, self._run.law, controller)

    def _submit(self, result: Result) -> Future[Any]:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(1, get_context("spawn"), _begin, (os.getpid(),))
        return self._pool.submit(result.compute, *result.asked)

    def _take(self) -> None:
        if self._running is None or not self._running[2].done():
            return
        result, inputs, future = self._running
        self._running = None
        result.answered = repr(inputs)
        result.version += 1
        result.value, result.refusal = None, ""
        try:
            result.value = future.result()
        except StickslipError as error:
            result.refusal = str(error)
        except BrokenProcessPool:
            self._pool = None
            result.refusal = "the computation was ended"


def _octave(value: Any) -> Any:
    """Return the next power of two away from zero; 0 and what is not known stay."""
    return copysign(2.0 ** ceil(log2(abs(value))), value) if value else value


def _begin(parent: int) -> None:
    end_with(parent)
    with suppress(OSError):
        os.nice(9)
