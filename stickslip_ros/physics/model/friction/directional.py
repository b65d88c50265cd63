"""A friction law whose constants differ between the directions."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from typing_extensions import override

from stickslip_ros.physics.model.friction.base import FrictionLaw


@dataclass(frozen=True)
class Directional(FrictionLaw):
    """Two friction laws of one class: for forward slip (v_r > 0) and for backward slip (v_r < 0).

    Its memory and its switches are those of the class: a change of direction keeps the memory.

    Examples
    --------
    >>> from stickslip_ros.physics.model.friction import Coulomb, Directional
    >>> law = Directional(forward=Coulomb(static=0.4), reverse=Coulomb(static=0.3))
    >>> law.coefficient(0.1, 1.0), law.coefficient(-0.1, -1.0)
    (-0.4, 0.3)
    >>> law.limits
    (0.4, 0.3)
    """

    static: ClassVar[Any]  # type: ignore[misc]

    forward: Any
    """Law of forward slip."""
    reverse: Any
    """Law of backward slip."""

    def __post_init__(self) -> None:
        if type(self.forward) is not type(self.reverse):
            raise TypeError("a directional law needs two laws of one class")
        for shared in ("name", "states", "switches", "nonsmooth"):
            object.__setattr__(self, shared, getattr(self.forward, shared))

    @property
    def static(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The larger static coefficient."""
        return max(self.limits)

    @property
    def limits(self) -> tuple[Any, Any]:
        """The limit of each law in its direction; see `FrictionLaw.limits`."""
        return self.forward.limits[0], self.reverse.limits[1]

    @property
    def characteristic_speed(self) -> float:
        """The smaller one of both laws, m/s."""
        return min(self.forward.characteristic_speed, self.reverse.characteristic_speed)

    @override
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        return self._of(sign, lambda law: law.coefficient(relative_speed, sign))

    @override
    def friction(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Any:
        return self._of(sign, lambda law: law.friction(relative_speed, sign, memory, switches))

    @override
    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        return self._each(
            sign, lambda law: law.memory_rates(relative_speed, sign, memory, switches)
        )

    @override
    def margins(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        return self._each(sign, lambda law: law.margins(relative_speed, sign, memory, switches))

    @override
    def switches_at(
        self, relative_speed: float, sign: float, memory: Sequence[float]
    ) -> Sequence[float]:
        return self._of(sign, lambda law: law.switches_at(relative_speed, sign, memory))

    @override
    def switches_after(
        self, margin: int, sign: float, switches: Sequence[float]
    ) -> Sequence[float]:
        return self._of(sign, lambda law: law.switches_after(margin, sign, switches))

    @override
    def memory_at(self, relative_speed: float, sign: float) -> Sequence[float]:
        return self._of(sign, lambda law: law.memory_at(relative_speed, sign))

    @override
    def initial_memory(self, relative_speed: float) -> Sequence[float]:
        return self._of(relative_speed, lambda law: law.initial_memory(relative_speed))

    @override
    def switches_following(
        self,
        switches: Sequence[float],
        relative_speed: float,
        sign: float,
        memory: Sequence[float],
    ) -> Sequence[float]:
        return self._of(
            sign, lambda law: law.switches_following(switches, relative_speed, sign, memory)
        )

    @override
    def memory_after(
        self,
        relative_speed: float,
        memory: Sequence[float],
        switches: Sequence[float],
        duration: float,
    ) -> Sequence[float]:
        return self._of(
            relative_speed,
            lambda law: law.memory_after(relative_speed, memory, switches, duration),
        )

    @property
    def rate_sensitivity(self) -> Any:
        """The smaller one of both laws."""
        return min(self.forward.rate_sensitivity, self.reverse.rate_sensitivity)

    @override
    def creep_speed(self, coefficient: Any, sign: Any, memory: Sequence[Any]) -> Any:
        return self._of(sign, lambda law: law.creep_speed(coefficient, sign, memory))

    @override
    def creep_limit(self, relative_speed: Any, sign: Any, memory: Sequence[Any]) -> Any:
        return self._of(sign, lambda law: law.creep_limit(relative_speed, sign, memory))

    def warning(self) -> str | None:
        """Return the warning of either law; see `FrictionLaw.warning`."""
        return self.forward.warning() or self.reverse.warning()

    def refusal(self) -> str | None:
        """Return the refusal of either law; see `FrictionLaw.refusal`."""
        refusal = self.forward.refusal()
        if refusal is not None:
            return refusal
        refusal = self.reverse.refusal()
        for name in self.forward.direction_independent:
            ahead, back = (getattr(law, name) for law in (self.forward, self.reverse))
            if ahead != back:
                return f"reverse.{name} = {back} must equal {name} = {ahead}"
        names = "|".join(self.reverse.constants())
        return refusal and re.sub(rf"\b({names})(?= = )", r"reverse.\1", refusal)

    @override
    def scaled(self, speed: float, length: float = 1.0) -> Self:
        return replace(
            self,
            forward=self.forward.scaled(speed, length),
            reverse=self.reverse.scaled(speed, length),
        )

    def _of(self, sign: Any, value: Callable[[FrictionLaw], Any]) -> Any:
        """Return a value of the law of a direction; for an array or an expression of both laws."""
        if isinstance(sign, int | float):
            return value(self.forward if sign > 0.0 else self.reverse)
        ahead, back = value(self.forward), value(self.reverse)
        return 0.5 * ((1.0 + sign) * ahead + (1.0 - sign) * back)

    def _each(self, sign: Any, values: Callable[[FrictionLaw], Sequence[Any]]) -> Sequence[Any]:
        count = len(values(self.forward))
        return [self._of(sign, lambda law, i=i: values(law)[i]) for i in range(count)]
