"""The actuator between the control force that is commanded and the force on the slide."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import copysign, inf
from typing import Any

from stickslip_ros.model.constants import MOST_STEPS, constant


@dataclass(frozen=True)
class Actuator:
    """The actuator of the control force. By default it exerts exactly the force that is commanded.

    A command passes `limiter` when it arrives: it is limited, rounded to the resolution, half to
    even, and limited again. This held force F acts through a lag of first order, tau F_a' = F - F_a
    with F_a = 0 at the start. A disturbance does not pass the actuator.

    The lag is a part of the drive: its equations accept floats and heyoka expressions, in the
    scales of the drive.
    """

    limit: float = constant(inf, "Largest force of the actuator.", "N", positive=True)
    resolution: float = constant(0.0, "Step of its force; 0 for none.", "N", at_least=0.0)
    time_constant: float = constant(
        0.0,
        "Time constant of its lag of first order; 0 for none.",
        "s",
        at_least=0.0,
        simplifies=True,
    )

    @property
    def states(self) -> Sequence[str]:
        """Names of the states: forces, zero at the start. The constants decide about them."""
        time: Any = self.time_constant  # of the equations, an expression
        return () if isinstance(time, int | float) and time == 0.0 else ("force",)

    @property
    def limiter(self) -> Callable[[float], float] | None:
        """Function from a command (N) to the force (N) that is held; None if they are equal."""
        limit, resolution = self.limit, self.resolution
        if limit == inf and not resolution:
            return None

        def held(force: float) -> float:
            if not -limit < force < limit:
                force = copysign(limit, force)
            if resolution:
                steps = force / resolution
                if -MOST_STEPS < steps < MOST_STEPS:
                    force = round(steps) * resolution
                    if not -limit < force < limit:
                        force = copysign(limit, force)
            return force

        return held

    def state_rates(self, held: Any, states: Sequence[Any]) -> Sequence[Any]:
        """Return the rates of the states.

        Parameters
        ----------
        held : float or expression
            Held force, see `limiter`.
        states : sequence of float or expression
            Values of `states`.
        """
        return [(held - force) / self.time_constant for force in states]

    def force(self, held: Any, states: Sequence[Any]) -> Any:
        """Return the force on the slide.

        Parameters
        ----------
        held : float or expression
            Held force, see `limiter`.
        states : sequence of float or expression
            Values of `states`.
        """
        return states[0] if states else held


IDEAL_ACTUATOR = Actuator()
"""The actuator that exerts what is commanded."""
