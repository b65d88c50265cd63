"""A friction law whose constants differ between the directions."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

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
        for shared in ("name", "states", "switches", "kinked"):
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

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r); see `FrictionLaw.coefficient`.

        Parameters
        ----------
        relative_speed : float, array or expression
            Speed v_r of the slide relative to the belt, m/s.
        sign : float, array or expression
            sgn(v_r), -1 or 1.

        Returns
        -------
        float, array or expression
            Coefficient, dimensionless.
        """
        return self._of(sign, lambda law: law.coefficient(relative_speed, sign))

    def friction(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Any:
        """Return the friction coefficient during slip; see `FrictionLaw.friction`.

        Parameters
        ----------
        relative_speed : float, array or expression
            Speed v_r of the slide relative to the belt, m/s.
        sign : float, array or expression
            sgn(v_r), -1 or 1.
        memory : sequence of float or expression
            Values of `states`.
        switches : sequence of float or expression
            Values of `switches`.

        Returns
        -------
        float, array or expression
            Coefficient, dimensionless.
        """
        return self._of(sign, lambda law: law.friction(relative_speed, sign, memory, switches))

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        """Return the derivatives of the memory; see `FrictionLaw.memory_rates`.

        Parameters
        ----------
        relative_speed : float or expression
            Speed v_r of the slide relative to the belt, m/s.
        sign : float or expression
            sgn(v_r), -1 or 1.
        memory : sequence of float or expression
            Values of `states`.
        switches : sequence of float or expression
            Values of `switches`.

        Returns
        -------
        sequence of float or expression
            Rate of each of `states`.
        """
        return self._each(
            sign, lambda law: law.memory_rates(relative_speed, sign, memory, switches)
        )

    def margins(
        self, relative_speed: Any, sign: Any, memory: Sequence[Any], switches: Sequence[Any]
    ) -> Sequence[Any]:
        """Return the margins of a mode; see `FrictionLaw.margins`.

        Parameters
        ----------
        relative_speed : float or expression
            Speed v_r of the slide relative to the belt, m/s.
        sign : float or expression
            sgn(v_r), -1 or 1.
        memory : sequence of float or expression
            Values of `states`.
        switches : sequence of float or expression
            Values of `switches`.

        Returns
        -------
        sequence of float or expression
            Margins.
        """
        return self._each(sign, lambda law: law.margins(relative_speed, sign, memory, switches))

    def switches_at(
        self, relative_speed: float, sign: float, memory: Sequence[float]
    ) -> Sequence[float]:
        """Return the switches of a mode that starts; see `FrictionLaw.switches_at`.

        Parameters
        ----------
        relative_speed : float
            Speed v_r of the slide relative to the belt, m/s.
        sign : float
            sgn(v_r) from now on, -1 or 1.
        memory : sequence of float
            Values of `states`.

        Returns
        -------
        sequence of float
            Values of `switches`.
        """
        return self._of(sign, lambda law: law.switches_at(relative_speed, sign, memory))

    def switches_after(
        self, margin: int, sign: float, switches: Sequence[float]
    ) -> Sequence[float]:
        """Return the switches of the next mode; see `FrictionLaw.switches_after`.

        Parameters
        ----------
        margin : int
            Index of the margin.
        sign : float
            sgn(v_r), -1 or 1.
        switches : sequence of float
            Values of `switches` so far.

        Returns
        -------
        sequence of float
            Values of `switches` from then on.
        """
        return self._of(sign, lambda law: law.switches_after(margin, sign, switches))

    def memory_at(self, relative_speed: float, sign: float) -> Sequence[float]:
        """Return the memory in steady slip; see `FrictionLaw.memory_at`.

        Parameters
        ----------
        relative_speed : float
            Speed v_r of the slide relative to the belt, m/s.
        sign : float
            sgn(v_r), -1 or 1.

        Returns
        -------
        sequence of float
            Values of `states`.
        """
        return self._of(sign, lambda law: law.memory_at(relative_speed, sign))

    def initial_memory(self, relative_speed: float) -> Sequence[float]:
        """Return the memory at the start of a motion; see `FrictionLaw.initial_memory`.

        Parameters
        ----------
        relative_speed : float
            Speed v_r of the slide relative to the belt, m/s.

        Returns
        -------
        sequence of float
            Values of `states`.
        """
        return self._of(relative_speed, lambda law: law.initial_memory(relative_speed))

    def switches_following(
        self,
        switches: Sequence[float],
        relative_speed: float,
        sign: float,
        memory: Sequence[float],
    ) -> Sequence[float]:
        """Return the switches of a state that follows; see `FrictionLaw.switches_following`."""
        return self._of(
            sign, lambda law: law.switches_following(switches, relative_speed, sign, memory)
        )

    def memory_after(
        self,
        relative_speed: float,
        memory: Sequence[float],
        switches: Sequence[float],
        duration: float,
    ) -> Sequence[float]:
        """Return the memory after a duration; see `FrictionLaw.memory_after`."""
        return self._of(
            relative_speed,
            lambda law: law.memory_after(relative_speed, memory, switches, duration),
        )

    @property
    def rate_sensitivity(self) -> Any:
        """The smaller one of both laws."""
        return min(self.forward.rate_sensitivity, self.reverse.rate_sensitivity)

    def creep_speed(self, coefficient: Any, sign: Any, memory: Sequence[Any]) -> Any:
        """Return the speed in creep; see `FrictionLaw.creep_speed`."""
        return self._of(sign, lambda law: law.creep_speed(coefficient, sign, memory))

    def creep_limit(self, relative_speed: Any, sign: Any, memory: Sequence[Any]) -> Any:
        """Return a measure of the viscosity; see `FrictionLaw.creep_limit`."""
        return self._of(sign, lambda law: law.creep_limit(relative_speed, sign, memory))

    def warning(self) -> str | None:
        """Return the warning of either law; see `FrictionLaw.warning`."""
        return self.forward.warning() or self.reverse.warning()

    def refusal(self) -> str | None:
        """Return the refusal of either law; see `FrictionLaw.refusal`.

        Returns
        -------
        str or None
            Sentence; names of the law of backward slip begin with `reverse.`.
        """
        refusal = self.forward.refusal()
        if refusal is not None:
            return refusal
        refusal = self.reverse.refusal()
        for name in self.forward.undirected:
            ahead, back = (getattr(law, name) for law in (self.forward, self.reverse))
            if ahead != back:
                return f"reverse.{name} = {back} must equal {name} = {ahead}"
        names = "|".join(self.reverse.constants())
        return refusal and re.sub(rf"\b({names})(?= = )", r"reverse.\1", refusal)

    def scaled(self, speed: float, length: float = 1.0) -> Self:
        """Return the same law in other units; see `FrictionLaw.scaled`.

        Parameters
        ----------
        speed : float
            New unit of speed, m/s.
        length : float, optional
            New unit of length, m.

        Returns
        -------
        Directional
            Both laws in these units.
        """
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
