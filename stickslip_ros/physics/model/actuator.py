"""The actuator between the control force that is commanded and the force on the slide."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Actuator:
    """What exerts the control force on the slide; it exerts exactly what is commanded.

    An actuator is a frozen dataclass of its constants, each described by `constant`. They become
    the parameters `actuator.*` of the plant. A command passes `limiter` when it arrives. An
    actuator with `states`, such as a lag, is a part of the drive: its equations accept floats and
    heyoka expressions, in the scales of the drive. A disturbance does not pass the actuator.
    """

    @property
    def states(self) -> Sequence[str]:
        """Names of the states: forces, zero at the start. The constants may decide about them."""
        return ()

    @property
    def limiter(self) -> Callable[[float], float] | None:
        """What turns a command (N) into the force (N) that is held; None if they are equal."""
        return None

    def state_rates(self, held: Any, states: Sequence[Any]) -> Sequence[Any]:
        """Return the rates of the states.

        Parameters
        ----------
        held : float or expression
            Held force, see `limiter`.
        states : sequence of float or expression
            Values of `states`.

        Returns
        -------
        sequence of float or expression
            Rates.
        """
        return ()

    def force(self, held: Any, states: Sequence[Any]) -> Any:
        """Return the force on the slide.

        Parameters
        ----------
        held : float or expression
            Held force, see `limiter`.
        states : sequence of float or expression
            Values of `states`.

        Returns
        -------
        float or expression
            Force.
        """
        return held


IDEAL_ACTUATOR = Actuator()
"""The actuator that exerts what is commanded."""
