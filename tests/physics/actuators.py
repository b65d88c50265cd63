"""Actuators of the tests: a limit, and a lag of first order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

from stickslip_ros.physics.model.actuator import Actuator
from stickslip_ros.physics.model.constants import constant


def _clipped(limit: float, command: float) -> float:
    return max(-limit, min(limit, command))


@dataclass(frozen=True)
class Lag(Actuator):
    """u' = (held - u)/time_constant; with a time constant of zero there is no lag."""

    time_constant: Any = constant(0.0, "Time constant.", "s", at_least=0.0)
    largest: Any = constant(inf, "Largest magnitude of the held force.", "N", at_least=0.0)

    @property
    def states(self) -> Sequence[str]:
        return () if self.time_constant == 0.0 else ("force",)

    @property
    def limiter(self) -> Callable[[float], float] | None:
        return None if self.largest == inf else partial(_clipped, self.largest)

    def state_rates(self, held: Any, states: Sequence[Any]) -> Sequence[Any]:
        return ((held - states[0]) / self.time_constant,)

    def force(self, held: Any, states: Sequence[Any]) -> Any:
        return states[0]
