"""A friction law whose constants differ between the directions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from inspect import signature
from typing import Any, ClassVar, Self

from typing_extensions import override

from stickslip_ros.model.friction.base import FrictionLaw
from stickslip_ros.text import renamed


def _of_direction(method: Callable[..., Any]) -> Any:
    """Return a method that asks the law of the direction of slip.

    Where the sign is an array or an expression it asks both laws.
    """
    name, parameters = method.__name__, list(signature(method).parameters)[1:]
    place = parameters.index("sign" if "sign" in parameters else "relative_speed")

    @wraps(method, updated=())
    def ask(self: "Directional", *arguments: Any, **named: Any) -> Any:
        if named:
            arguments = (*arguments, *(named[name] for name in parameters[len(arguments) :]))
        sign = arguments[place]
        if isinstance(sign, (int, float)):
            law = self.forward if sign > 0.0 else self.reverse
            return getattr(law, name)(*arguments)
        ahead, back = (getattr(law, name)(*arguments) for law in (self.forward, self.reverse))
        return _blended(sign, ahead, back)

    return ask


def _blended(sign: Any, ahead: Any, back: Any) -> Any:
    """Return the value of forward slip where the sign is 1, and of backward slip where it is -1."""
    if isinstance(ahead, Sequence):
        return [_blended(sign, *pair) for pair in zip(ahead, back, strict=True)]
    return 0.5 * ((1.0 + sign) * ahead + (1.0 - sign) * back)


@dataclass(frozen=True)
class Directional(FrictionLaw):
    """Two friction laws of one class: for forward slip (v_r > 0) and for backward slip (v_r < 0).

    Its memory and its switches are those of the class: a change of direction keeps the memory.
    """

    static: ClassVar[Any]  # type: ignore[misc]

    forward: Any
    """Law of forward slip."""
    reverse: Any
    """Law of backward slip."""

    coefficient = _of_direction(FrictionLaw.coefficient)
    friction = _of_direction(FrictionLaw.friction)
    memory_rates = _of_direction(FrictionLaw.memory_rates)
    initial_memory = _of_direction(FrictionLaw.initial_memory)
    memory_at = _of_direction(FrictionLaw.memory_at)
    memory_after = _of_direction(FrictionLaw.memory_after)
    margins = _of_direction(FrictionLaw.margins)
    switches_at = _of_direction(FrictionLaw.switches_at)
    switches_after = _of_direction(FrictionLaw.switches_after)
    switches_following = _of_direction(FrictionLaw.switches_following)

    def __post_init__(self) -> None:
        if type(self.forward) is not type(self.reverse):
            raise TypeError("a directional law needs two laws of one class")
        for shared in ("name", "package", "states", "switches", "nonsmooth"):
            object.__setattr__(self, shared, getattr(self.forward, shared))

    @property
    def static(self) -> Any:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The larger static coefficient."""
        return max(self.limits)

    @property
    def limits(self) -> tuple[Any, Any]:
        """The limit of each law in its direction; see `SteadyFriction.limits`."""
        return self.forward.limits[0], self.reverse.limits[1]

    @property
    def characteristic_speed(self) -> float:
        """The smaller one of both laws, m/s."""
        return min(self.forward.characteristic_speed, self.reverse.characteristic_speed)

    def warning(self) -> str | None:
        """Return the warning of either law; see `SteadyFriction.warning`."""
        return self.forward.warning() or self.reverse.warning()

    def refusal(self) -> str | None:
        """Return the refusal of either law; see `SteadyFriction.refusal`."""
        if (refusal := self.forward.refusal()) is not None:
            return refusal
        for name in self.forward.direction_independent:
            ahead, back = (getattr(law, name) for law in (self.forward, self.reverse))
            if ahead != back:
                return f"reverse.{name} = {back} must equal {name} = {ahead}"
        refusal = self.reverse.refusal()
        names = {name: f"reverse.{name}" for name in self.reverse.constants()}
        return refusal and renamed(refusal, names)

    @override
    def multiplied(self, factor: float) -> Self | None:
        forward, reverse = (law.multiplied(factor) for law in (self.forward, self.reverse))
        if forward is None or reverse is None:
            return None
        return replace(self, forward=forward, reverse=reverse)

    @override
    def scaled(self, speed: float, length: float = 1.0) -> Self:
        return replace(
            self,
            forward=self.forward.scaled(speed, length),
            reverse=self.reverse.scaled(speed, length),
        )
