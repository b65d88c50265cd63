"""The rate-and-state law."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import expm1
from math import log as float_log
from typing import Any, ClassVar

import numpy as np

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction.base import FrictionLaw, Numbers, Values
from stickslip_ros.model.functions import exp, log, sqrt

_LARGEST_RATIOS = {"kinetic": 200.0, "evolution_effect": 10.0}
"""Largest ratios of constants to the direct effect: its exponentials must not overflow."""
_LARGEST_LOG_AGE = 10.0
"""Logarithm of the age, in L/v_0, of a contact whose friction counts as the limit of the law."""
_SMALLEST_SPEED = 1e-20
"""Speed, in v_0, below which steady slip is not asked for."""


@dataclass(frozen=True)
class RateState(FrictionLaw):
    """Rate-and-state law with ageing: mu = -a asinh(v_r/(2 v_0) exp((f_0 + b ln(v_0 th/L))/a)).

    th is the age of the contact, th' = 1 - |v_r| th / L; the memory is ln(v_0 th/L), whose range
    is smaller. Fast slip has |mu| = f_0 + a ln(|v_r|/v_0) + b ln(v_0 th/L). J. H. Dieterich,
    Journal of Geophysical Research 84, 1979; A. Ruina, Journal of Geophysical Research 88, 1983;
    the regular form at v_r = 0 is that of J. R. Rice, N. Lapusta, K. Ranjith, Journal of the
    Mechanics and Physics of Solids 49, 2001.

    The slide never sticks: it creeps under every load. There is no bound on the friction of an old
    contact. Its constants hold for some decades of speed around v_0 only.

    Examples
    --------
    >>> from stickslip_ros.model.friction import RateState
    >>> law = RateState(kinetic=0.6, direct_effect=0.01, evolution_effect=0.015)
    >>> round(float(law.coefficient(1e-6, 1.0)), 9), round(float(law.coefficient(1e-5, 1.0)), 4)
    (-0.6, -0.5885)
    """

    name: ClassVar[str] = "rate_state"
    states: ClassVar[Mapping[str, str | None]] = {"log_age": None}
    direction_independent: ClassVar[Sequence[str]] = ("slip_distance", "reference_speed")
    static: ClassVar[Any]  # type: ignore[misc]

    kinetic: Any = constant(0.25, "Kinetic coefficient mu_k.", at_least=0.0)
    direct_effect: Any = constant(
        0.01, "Increase a of the coefficient with the logarithm of the speed.", positive=True
    )
    evolution_effect: Any = constant(
        0.015, "Increase b of the coefficient with the logarithm of the age.", at_least=0.0
    )
    slip_distance: Any = constant(
        1e-3, "Distance L of slip that renews the contact.", "m", positive=True
    )
    reference_speed: Any = constant(
        1e-6, "Speed v_0 at which steady slip has the kinetic coefficient.", "m/s", positive=True
    )

    @property
    def static(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Friction of an old contact that starts to slip at v_0."""
        return self.kinetic + _LARGEST_LOG_AGE * self.evolution_effect

    @property
    def rate_sensitivity(self) -> Any:
        """The direct effect."""
        return self.direct_effect

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r) in steady slip, th = L/|v_r|; see `SteadyFriction.coefficient`."""
        speed = np.maximum(relative_speed * sign / self.reference_speed, _SMALLEST_SPEED)
        return self.friction(relative_speed, sign, (-log(speed),), ())

    def friction(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Any:
        """Return mu; see `FrictionMemory.friction`."""
        strength, limit = self._strength(memory), self.creep_limit(relative_speed, sign, memory)
        speed = (sign * relative_speed + limit) / (2.0 * self.reference_speed)
        return -sign * self.direct_effect * (strength + log(speed))

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Values, switches: Values
    ) -> Values:
        """Return the rate of ln(v_0 th/L); see `FrictionMemory.memory_rates`."""
        ageing = self.reference_speed * exp(-memory[0])
        return ((ageing - sign * relative_speed) / self.slip_distance,)

    def memory_at(self, relative_speed: float, sign: float) -> Numbers:
        """Return ln(v_0/|v_r|); see `FrictionMemory.memory_at`."""
        speed = max(abs(relative_speed) / self.reference_speed, _SMALLEST_SPEED)
        return (-float_log(speed),)

    def initial_memory(self, relative_speed: float) -> Numbers:
        """Return the memory of the age L/max(|v_r|, v_0); see `FrictionMemory.initial_memory`."""
        return (-float_log(max(abs(relative_speed) / self.reference_speed, 1.0)),)

    def memory_after(
        self, relative_speed: float, memory: Numbers, switches: Numbers, duration: float
    ) -> Numbers:
        """Return the memory of the age then; see `FrictionMemory.memory_after`."""
        path = abs(relative_speed) * duration / self.slip_distance
        grown = -expm1(-path) / path if path > 0.0 else 1.0
        age = exp(memory[0] - path) + self.reference_speed * duration / self.slip_distance * grown
        return (float_log(age),)

    def creep_speed(self, coefficient: Any, sign: Any, memory: Values) -> Any:
        """Return v_r = -2 v_0 sinh(mu/a) exp(-strength); see `FrictionCreep.creep_speed`."""
        strength, load = self._strength(memory), coefficient / self.direct_effect
        return self.reference_speed * (exp(-load - strength) - exp(load - strength))

    def creep_limit(self, relative_speed: Any, sign: Any, memory: Values) -> Any:
        """Return a divided by the viscosity; see `FrictionCreep.creep_limit`."""
        least = 2.0 * self.reference_speed * exp(-self._strength(memory))
        return sqrt(relative_speed * relative_speed + least * least)

    def refusal(self) -> str | None:
        """Refuse a direct effect that is too small for numbers; see `SteadyFriction.refusal`."""
        for name, ratio in _LARGEST_RATIOS.items():
            value = getattr(self, name)
            if value > ratio * self.direct_effect:
                return (
                    f"direct_effect = {self.direct_effect} must be at least {name} = {value} "
                    f"divided by {ratio:g}"
                )
        return None

    def _strength(self, memory: Values) -> Any:
        """Return (f_0 + b ln(v_0 th/L))/a."""
        return (self.kinetic + self.evolution_effect * memory[0]) / self.direct_effect
