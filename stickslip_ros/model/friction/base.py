"""The base of the friction laws: friction in steady slip, its memory, and what follows that."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from math import inf, isinf
from typing import Any, ClassVar, Self

import numpy as np

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.constants import Scales, constant, scaled

Values = Sequence[Any]
"""Values of several states or switches: numbers or expressions."""

Numbers = Sequence[float]
"""The same, numbers only."""

_SPEEDS = np.concatenate([[0.0], np.geomspace(1e-6, 1e6, 4001)])
"""Speeds, in the characteristic one, at which the size of a law is asked for."""


class SteadyFriction(ABC):
    """Friction in steady slip: all that a law without a memory gives.

    `name` and `coefficient` are needed, and `characteristic_speed` unless the law is a polynomial.
    """

    name: ClassVar[str]
    """Name of the law in the parameters."""
    package: ClassVar[str] = ""
    """Installed package whose entry point names the law; empty for a law of this package."""
    nonsmooth: ClassVar[bool] = False
    """Whether friction has no second derivative in steady slip: no Lyapunov coefficient exists."""
    proportional: ClassVar[Sequence[str]]
    """Constants that friction is proportional to, all together; optional."""
    direction_independent: ClassVar[Sequence[str]] = ()
    """Constants that must be the same in both directions of slip: otherwise friction would jump."""

    static: Any
    """Static (break-away) coefficient mu_s."""

    @abstractmethod
    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return the friction coefficient during steady slip, mu(v_r) = F/N.

        `sign` is a separate argument so that the branch is smooth up to and beyond v_r = 0, as the
        integrator needs.

        Parameters
        ----------
        relative_speed : float, array or expression
            Speed v_r of the slide relative to the belt, m/s.
        sign : float, array or expression
            sgn(v_r), -1 or 1.

        Returns
        -------
        float, array or expression
            Coefficient with the sign of the force on the slide, dimensionless.
        """

    @property
    def limits(self) -> tuple[Any, Any]:
        """Largest |F|/N during stick before the slide slips forward (v_r > 0), and backward.

        By default both are `static`. Friction is continuous where slip starts if they are
        -coefficient(0, 1) and coefficient(0, -1).
        """
        return self.static, self.static

    @property
    def characteristic_speed(self) -> float:
        """Speed that may change the coefficient by a factor, m/s; infinite for polynomials."""
        return inf

    def refusal(self) -> str | None:
        """Return a sentence that says which constants do not fit together, or None.

        It has names, values and what is allowed; bounds of one constant are not its subject.
        """
        return None

    def warning(self) -> str | None:
        """Return a sentence that says what a user of the law should know, or None."""
        return None


class FrictionMemory(SteadyFriction):
    """The memory of a law, and its modes; by default friction is that of steady slip.

    A law with a memory gives `states`, `friction`, `memory_rates` and `memory_at`, and for a
    sampled controller `memory_after`. It has no stick: the slide always slips, however slowly.

    A law in pieces, or whose elements stick and slip, has `switches`: values that are constant in
    each of its modes, such as the polynomial coefficients of a piece. All modes then share one
    compiled flow. A mode ends where one of `margins` falls to zero; `switches_after` then gives the
    next one, and `switches_at` the first.
    """

    states: ClassVar[Mapping[str, str | None]] = {}
    """Unit of each state of the memory by name; empty for a static law."""
    switches: ClassVar[Sequence[str]] = ()
    """Names of the values that are constant in each mode of the law."""

    @property
    def sticks(self) -> bool:
        """Whether the slide can stick to the belt: only without a memory."""
        return not self.states

    def friction(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Any:
        """Return the friction coefficient during slip, steady or not; by default `coefficient`.

        Parameters
        ----------
        relative_speed, sign : float, array or expression
            As in `coefficient`.
        memory, switches : sequence of float or expression
            Values of `states` and of `switches`.

        Returns
        -------
        float, array or expression
            Coefficient with the sign of the force on the slide.
        """
        return self.coefficient(relative_speed, sign)

    def memory_rates(
        self, relative_speed: Any, sign: Any, memory: Values, switches: Values
    ) -> Values:
        """Return the derivatives of the memory by time.

        Parameters
        ----------
        relative_speed, sign, memory, switches
            As in `friction`.
        """
        return ()

    def initial_memory(self, relative_speed: float) -> Numbers:
        """Return the memory at the start of a motion; by default 0.

        Parameters
        ----------
        relative_speed : float
            Speed v_r of the slide relative to the belt, m/s.
        """
        return (0.0,) * len(self.states)

    def memory_at(self, relative_speed: float, sign: float) -> Numbers:
        """Return the memory in steady slip: the start of the search for an equilibrium.

        By default it is 0. A law whose elements stick and slip must define it, so that
        `switches_at` gives the mode of steady slip there.

        Parameters
        ----------
        relative_speed, sign : float
            As in `coefficient`.
        """
        return (0.0,) * len(self.states)

    def memory_after(
        self, relative_speed: float, memory: Numbers, switches: Numbers, duration: float
    ) -> Numbers:
        """Return the memory after a duration at a constant relative speed.

        With it a sampled controller follows the memory; see `FrictionObserver`.

        Parameters
        ----------
        relative_speed : float
            Speed v_r of the slide relative to the belt, m/s.
        memory, switches : sequence of float
            Values of `states` and of `switches` at the start.
        duration : float
            Duration, s.

        Raises
        ------
        InvalidInputError
            If the law has a memory and does not define this.
        """
        if self.states:
            raise InvalidInputError(
                f"the friction law {self.name} does not say what its memory is after a duration: "
                "it must define memory_after"
            )
        return ()

    def margins(self, relative_speed: Any, sign: Any, memory: Values, switches: Values) -> Values:
        """Return what is above zero in a mode; where one falls to zero the mode ends.

        The sign of v_r need not be among them: the drive follows it.

        Parameters
        ----------
        relative_speed, sign, memory, switches
            As in `friction`.

        Returns
        -------
        sequence of float or expression
            Margins of the order of one; as many in every mode. Where a mode lacks one it must be a
            constant above zero, made from the switches, for example slips + (1 - slips) * margin.
        """
        return ()

    def switches_at(self, relative_speed: float, sign: float, memory: Numbers) -> Numbers:
        """Return the switches of the mode that starts in a state.

        It is called at the start of a motion, and when the relative speed changes its sign.

        Parameters
        ----------
        relative_speed, sign, memory
            As in `friction`; the sign is that from now on.
        """
        return ()

    def switches_after(self, margin: int, sign: float, switches: Numbers) -> Numbers:
        """Return the switches of the mode that follows where a margin has fallen to zero.

        Parameters
        ----------
        margin : int
            Index of the margin.
        sign, switches
            As in `friction`; the switches are those so far.
        """
        return switches

    def switches_following(
        self, switches: Numbers, relative_speed: float, sign: float, memory: Numbers
    ) -> Numbers:
        """Return the switches of a state that follows others, in the same direction of slip.

        By default they are those of the state, as `switches_at` gives them.

        Parameters
        ----------
        switches : sequence of float
            Values of `switches` before.
        relative_speed, sign, memory
            As in `friction`.
        """
        return self.switches_at(relative_speed, sign, memory)


@dataclass(frozen=True)
class FrictionLaw(FrictionMemory):
    """Friction law: the friction coefficient as a function of the relative speed.

    A law is a frozen dataclass of its constants, each described by `constant`. Its equations are
    written once; they accept floats, numpy arrays and heyoka expressions, and so do the constants.
    Coefficients have the sign of the force on the slide: below zero while v_r > 0.

    What a law gives is said by `SteadyFriction`, and for one with a memory or in pieces also by
    `FrictionMemory`.
    """

    static: Any = constant(0.4, "Static (break-away) coefficient mu_s.", at_least=0.0)

    def above_static(self, name: str) -> str | None:
        """Return the refusal of a constant above the static coefficient, or None.

        Parameters
        ----------
        name : str
            Name of the constant.

        Returns
        -------
        str or None
            Sentence with both values, as `refusal` returns it.
        """
        value = getattr(self, name)
        if value <= self.static:
            return None
        return f"{name} = {value} must not exceed static = {self.static}"

    def at_rest(self, belt_speed: Any) -> Any:
        """Return mu(-v_belt), eq. 6: the coefficient for a slide at rest on a moving belt.

        Parameters
        ----------
        belt_speed : float or array
            Belt speed, m/s.

        Returns
        -------
        float or array
            Coefficient with the sign of the force on the slide, dimensionless.
        """
        return self.coefficient(-belt_speed, -np.sign(belt_speed))

    def multiplied(self, factor: float) -> Self | None:
        """Return the law with another size of friction; None if `proportional` does not say how.

        Parameters
        ----------
        factor : float
            What all coefficients are multiplied by.
        """
        if "proportional" not in vars(type(self)):  # a class derived from one that says it
            return None
        return replace(self, **{name: factor * getattr(self, name) for name in self.proportional})

    @property
    def dry(self) -> Self:
        """The law without its viscous part, the constant `viscous`."""
        return replace(self, viscous=0.0) if "viscous" in self.constants() else self

    @property
    def size_range(self) -> tuple[float, float]:
        """Smallest and largest |mu| in steady slip at any speed."""
        speeds = _SPEEDS * (1.0 if isinf(self.characteristic_speed) else self.characteristic_speed)
        signs = np.ones(speeds.shape)
        sizes = [-sign * self.coefficient(sign * speeds, sign * signs) for sign in (1.0, -1.0)]
        return float(np.min(sizes)), float(np.max(sizes))

    def scaled(self, speed: float, length: float = 1.0) -> Self:
        """Return the same law in other units of speed and length.

        Parameters
        ----------
        speed : float
            New unit of speed, m/s.
        length : float, optional
            New unit of length, m; a static law does not depend on it.
        """
        return scaled(self, Scales(length, speed))

    @classmethod
    def constants(cls) -> tuple[str, ...]:
        """Return the names of the law's constants."""
        return tuple(field.name for field in fields(cls))


class FrictionObserver:
    """Follows the memory of a friction law, as a sampled controller needs it.

    Parameters
    ----------
    law : FrictionLaw
        Law in SI units; a static one has no memory, but may be used, too.
    memory : sequence of float, optional
        Values of its `states`; by default its initial memory at rest.
    """

    def __init__(self, law: FrictionLaw, memory: Numbers | None = None) -> None:
        self.law = law
        """Law that is followed."""
        self.memory = tuple(law.initial_memory(0.0) if memory is None else memory)
        """Present values of its `states`."""
        self._switches = tuple[float, ...]()
        self._sign = 0.0

    def step(self, relative_speed: float, duration: float) -> float:
        """Follow the memory over a sample at a constant speed; return the coefficient at its end.

        Parameters
        ----------
        relative_speed : float
            Speed v_r of the slide relative to the belt, m/s.
        duration : float
            Duration, s.

        Returns
        -------
        float
            Coefficient with the sign of the force on the slide, dimensionless.

        Raises
        ------
        InvalidInputError
            If the law has a memory and does not define `memory_after`.
        """
        law, sign = self.law, -1.0 if relative_speed < 0.0 else 1.0
        switches = law.switches_at(relative_speed, sign, self.memory)
        if sign == self._sign:
            switches = law.switches_following(self._switches, relative_speed, sign, self.memory)
        self.memory = tuple(law.memory_after(relative_speed, self.memory, switches, duration))
        switches = law.switches_following(switches, relative_speed, sign, self.memory)
        self._switches, self._sign = tuple(switches), sign
        return float(law.friction(relative_speed, sign, self.memory, switches))
