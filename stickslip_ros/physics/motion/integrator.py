"""heyoka integrators for the two modes of a motion, slip and stick, compiled once for each law."""

from collections.abc import Callable
from typing import Any

import heyoka as hy

from stickslip_ros.physics.model.equations import Equations
from stickslip_ros.physics.model.friction import FrictionLaw

# heyoka warns on standard output, which is for results, where a marker's polynomial is only
# rounding, as in equilibrium.
hy.set_logger_level_error()

UNBOUNDED_SPEED = 1e3
"""Dimensionless speed of the slide above which the motion counts as unbounded."""

BELT_SPEED_REACHED, UNBOUNDED_SPEED_REACHED = 0, 1
"""The terminal events of the slip integration, in heyoka's numbering."""

Marks = list[tuple[float, float, float]]
"""Time, X and Y at the instants during a slip at which Y or Y' is zero."""


class Integrator:
    """Compiled integrator with views of its arrays, which cost as much to create as a short step.

    Reading or writing an element of a memoryview takes half the time of an array's.
    """

    __slots__ = ("parameters", "state", "taylor", "variables")

    def __init__(self, taylor: Any, variables: int) -> None:
        """Wrap a heyoka integrator whose state begins with so many `variables` of the motion."""
        self.taylor = taylor
        self.state = taylor.state
        self.variables: memoryview[float] = self.state[:variables].data
        """X, Y and, with continuous control, W."""
        self.parameters: memoryview[float] = taylor.pars.data


class Integrators:
    """The integrators of one motion; each is compiled when it is first requested."""

    def __init__(self, *, continuous_control: bool, with_derivatives: bool) -> None:
        """Prepare the integrators for `continuous_control`, or for a held force.

        `with_derivatives` also integrates the variational equations.
        """
        self.marks: Marks = []
        """Marks of the most recent slip, if it is recorded."""
        self._continuous_control = continuous_control
        self._with_derivatives = with_derivatives
        self._stick: dict[type[FrictionLaw], tuple[Equations, Integrator | None]] = {}
        self._slip: dict[tuple[type[FrictionLaw], bool], Integrator] = {}

    def stick(self, law: type[FrictionLaw]) -> tuple[Equations, Integrator | None]:
        """Return the equations for a law, and the integrator for stick.

        The integrator is None if the slide moves with the belt in a straight line, so that nothing
        needs to be integrated.
        """
        if law not in self._stick:
            equations = Equations(law, self._continuous_control)
            curved = self._continuous_control or self._with_derivatives
            self._stick[law] = equations, self._compile_stick(equations) if curved else None
        return self._stick[law]

    def slip(self, law: type[FrictionLaw], *, recording: bool) -> Integrator:
        """Return the integrator for slip; it fills `marks` if it is `recording`."""
        key = law, recording
        if key not in self._slip:
            self._slip[key] = self._compile_slip(self.stick(law)[0], recording)
        return self._slip[key]

    def _compile_slip(self, equations: Equations, recording: bool) -> Integrator:
        # The slide diverges in the direction of the slip. The event is of the order of one, since
        # heyoka's error is relative to the largest of states and events.
        unbounded = 1.0 - equations.sign * equations.slip[0][1] / UNBOUNDED_SPEED
        markers = []
        if recording:
            markers = [
                hy.nt_event(equations.slip[0][1], callback=_marker(self.marks, turning=True)),
                hy.nt_event(equations.acceleration, callback=_marker(self.marks)),
            ]
        return self._compile(
            equations.slip,
            [equations.sign * equations.relative_speed, unbounded],
            nt_events=markers,
            fast_math=True,  # a quarter faster; the error stays below 2e-12 over 190 periods
        )

    def _compile_stick(self, equations: Equations) -> Integrator:
        return self._compile(
            equations.stick,
            [equations.static - equations.reaction, equations.static + equations.reaction],
        )

    def _compile(self, system: Any, falling: list[Any], **options: Any) -> Integrator:
        """Compile a system that ends where one of the `falling` expressions reaches zero."""
        variables = len(system)
        if self._with_derivatives:
            system = hy.var_ode_sys(system, hy.var_args.vars, order=1)
        downward = hy.event_direction.negative
        ends = [hy.t_event(expression, direction=downward) for expression in falling]
        taylor = hy.taylor_adaptive(system, [0.0] * variables, t_events=ends, **options)
        return Integrator(taylor, variables)


def _marker(marks: Marks, *, turning: bool = False) -> Callable[[Any, float, int], None]:
    """Return a callback that records the state at an event; at a turning point Y is zero.

    It is a plain function, not a method: heyoka copies its callbacks, and with a method its object.
    """

    def mark(integrator: Any, now: float, _: int) -> None:
        x, y = integrator.update_d_output(now)[:2].tolist()
        marks.append((now, x, 0.0 if turning else y))

    return mark
