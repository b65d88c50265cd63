"""The base of the control laws: a force for each sample, and equations where there are some."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.constants import constant, constants_of, scaled
from stickslip_ros.model.drive import Drive
from stickslip_ros.samples import NO_REFERENCE, Reference, Sample

State = tuple[float, ...]
"""State of a control law between samples."""


TABLE, MOTOR = "table", "motor"
"""The bodies whose motion a law may feed back: the slide of the drive, or its motor."""


def body(default: str, of_what: str) -> Any:
    """Describe the choice of a body, as the default of a field of a control law.

    `of_what` says what of the body is meant, as in "motion is fed back".
    """
    return constant(
        default, f"Body whose {of_what}: the slide (table) or the motor.", choices=(TABLE, MOTOR)
    )


class LinearFeedback(NamedTuple):
    """A sampled control law near the equilibrium: z' = A z + B (x, y), u = C z + D (x, y).

    z is the deviation of the law's state from its value at the equilibrium, and x and y those of
    displacement and velocity of the slide; SI units. Two further columns of B and D are those of
    the motor.
    """

    state: FloatArray
    """A, shape (n, n) for n states."""
    input: FloatArray
    """B, shape (n, 2) or (n, 4)."""
    output: FloatArray
    """C, shape (n,)."""
    direct: FloatArray
    """D, shape (2,) or (4,)."""

    def for_body(self, body: str) -> Self:
        """Return the same feedback of the motion of another body.

        Parameters
        ----------
        body : str
            `TABLE` or `MOTOR`.

        Returns
        -------
        LinearFeedback
            Feedback with columns of the motor if it is that.
        """
        if body == TABLE:
            return self
        none = np.zeros_like(self.input), np.zeros_like(self.direct)
        seen = np.hstack([none[0], self.input]), np.concatenate([none[1], self.direct], axis=-1)
        return self._replace(input=seen[0], direct=seen[1])

    @property
    def holds_position(self) -> bool:
        """Whether the force depends on where slide and motor are together."""
        return any(np.any(by[..., ::2].sum(axis=-1)) for by in (self.direct, self.input))


class ContinuousControl(Protocol):
    """A control law as equations: the force, and the rates of its states, without sampling.

    It is a frozen dataclass of its constants. The equations accept floats, arrays and heyoka
    expressions. All values are in SI units, or dimensionless after `scaled`.
    """

    states: ClassVar[Sequence[str]] = ()
    """Names of the states; a control with states defines `rest`, `state_rates`, `state_scales`."""

    def scaled(self, drive: Drive) -> Self:
        """Return the same control with dimensionless constants, in the scales of `drive`.

        Parameters
        ----------
        drive : Drive
            Drive that defines the scales.
        """
        return self if drive.is_dimensionless else scaled(self, drive.scales)

    def silenced(self) -> Self:
        """Return a control with the same states that gives no force."""
        ...

    def rest(self, position: Any, speed: Any) -> Sequence[Any]:
        """Return the states of a control at rest, where the slide has kept its state for long.

        Parameters
        ----------
        position, speed : float, array or expression
            Displacement x and speed y of the slide.

        Returns
        -------
        sequence
            Values of `states`.
        """
        return ()

    def state_rates(self, position: Any, speed: Any, states: Sequence[Any]) -> Sequence[Any]:
        """Return the rates of the states.

        Parameters
        ----------
        position, speed : float, array or expression
            Displacement x and speed y of the slide.
        states : sequence of float, array or expression
            Values of `states`.
        """
        return ()

    def control_force(self, position: Any, speed: Any, states: Sequence[Any]) -> Any:
        """Return the force on the slide.

        Parameters
        ----------
        position, speed, states
            As in `state_rates`.
        """
        ...

    def state_scales(self, drive: Drive) -> Sequence[float]:
        """Return the factor from each dimensionless state to the sampled law's, in SI units.

        Parameters
        ----------
        drive : Drive
            Drive that defines the scales.
        """
        return ()

    def bound(self, speed: Any) -> Any:
        """Return forces on the speed that give a cycle at least the energy that the control gives.

        Parameters
        ----------
        speed : ndarray
            Speeds y of the slide.

        Returns
        -------
        ndarray
            Forces, shape of `speed`; infinite, as by default, where no bound is known.
        """
        return np.full_like(speed, inf)


class TwoBodyControl(ContinuousControl):
    """Control as equations that feeds back slide and motor.

    Positions and speeds that it receives are pairs: those of the slide, and those of the motor,
    which are the slide's too if the motor is ideal.
    """


def seen_by(
    control: ContinuousControl, position: Any, speed: Any, motor: Sequence[Any]
) -> tuple[Any, Any]:
    """Return the position and the speed that a control receives, or a pair of each.

    Position and speed, numbers or expressions, are those of the slide. `motor` has those of the
    motor; it is empty if that is ideal. A control that is no `TwoBodyControl` feeds back the body
    that its `feedback` names.
    """
    far = (motor[0], motor[1]) if len(motor) else (position, speed)
    if TwoBodyControl in type(control).__mro__:  # a sixth of the time that the protocol takes
        return (position, far[0]), (speed, far[1])
    return far if getattr(control, "feedback", TABLE) == MOTOR else (position, speed)


@dataclass(frozen=True, kw_only=True)
class ControlLaw(ABC):
    """Control law: the force that answers a sample of the drive.

    A law is a frozen dataclass of its constants, each described by `constant`, in SI units. Its
    state is a tuple of floats that it receives and returns. A `Controller` gives it one sample
    after the other; it limits the force to `force_limit`, and sends none during `start_after`.
    """

    name: ClassVar[str]
    """Name in parameters, options and names of nodes."""
    package: ClassVar[str] = ""
    """Installed package whose entry point names the law; empty for a law of this package."""
    follows_reference: ClassVar[bool] = False
    """Whether the law uses a reference: its controller has the parameters `reference.*`.

    A law that does not follow a reference receives none.
    """
    state_units: ClassVar[Mapping[str, str | None]] = {}
    """Unit of each state, by name."""
    accepts_expressions: ClassVar[bool] = False
    """Whether `respond` of this very class accepts heyoka expressions, and decides nothing.

    It is not inherited. Many samples are then answered in one compiled step.
    """
    tuned: ClassVar[Sequence[str]] = ()
    """Gains that a design chooses, see `linear_part`, of either sign where bounds allow it."""

    force_limit: float = constant(inf, "Largest magnitude of the force.", "N", at_least=0.0)
    start_after: float = constant(
        0.0, "Time after the first sample during which the force is zero.", "s", at_least=0.0
    )

    @classmethod
    def constants(cls) -> list[str]:
        """Return the names of the constants, the law's own first."""
        common = constants_of(FeedbackLaw)
        return sorted(constants_of(cls), key=lambda name: name in common)

    def refusal(self) -> str | None:
        """Return why the constants do not fit together, as a sentence, or None."""
        return None

    @property
    def of_motor(self) -> list[str]:
        """Names of the constants that ask for the motion of a motor of finite mass."""
        return [
            name
            for name, described in constants_of(type(self)).items()
            if described.choices == (TABLE, MOTOR) and getattr(self, name) == MOTOR
        ]

    def initial_state(self, sample: Sample, reference: Reference) -> State:
        """Return the state at the first sample.

        Parameters
        ----------
        sample : Sample
            First sample.
        reference : Reference
            Reference at that sample.

        Returns
        -------
        tuple of float
            State; by default zero for each of `state_units`.
        """
        return (0.0,) * len(self.state_units)

    @abstractmethod
    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        """Return the force for a sample, and the state after it.

        Parameters
        ----------
        state : tuple of float
            State after the last sample; at the first one that of `initial_state`.
        elapsed : float
            Time since the last sample, s; 0 at the first one.
        sample : Sample
            Sample to answer. A law uses stamp, position and velocity, which are what a sensor
            measures, of the slide, or of the motor behind it: `sample.body(body)`.
        reference : Reference
            Reference at that sample.

        Returns
        -------
        force : float
            Control force, N.
        state : tuple of float
            State after the sample.
        """

    @property
    def continuous(self) -> ContinuousControl | None:
        """The law as equations, eq. 19: itself if it has them; None if it is for samples only."""
        itself: Any = self
        return itself if ContinuousControl in type(self).__mro__ else None

    def linear_feedback(self, period: float) -> LinearFeedback | None:
        """Return the sampled law near the equilibrium.

        Parameters
        ----------
        period : float
            Sample period, s.

        Returns
        -------
        LinearFeedback or None
            Law near the equilibrium; None if it is not linear there.
        """
        return None

    def linear_part(self, period: float) -> LinearFeedback | None:
        """Return the linear law that a design tunes; by default it is `linear_feedback`.

        A law that resets or compensates a linear one returns that one.

        Parameters
        ----------
        period : float
            Sample period, s.

        Returns
        -------
        LinearFeedback or None
            Linear part of the law; None if it has none.
        """
        return self.linear_feedback(period)

    def for_drive(self, drive: Drive) -> Self:
        """Return the law with the constants that follow from a drive, such as its mass.

        Parameters
        ----------
        drive : Drive
            Drive that the law is to control.
        """
        return self

    def limited(self, force: float) -> float:
        """Return a force within `force_limit`.

        Parameters
        ----------
        force : float
            Force, N.

        Returns
        -------
        float
            The force nearest to it that the limit allows, N.
        """
        return max(-self.force_limit, min(self.force_limit, force))


@dataclass(frozen=True, kw_only=True)
class FeedbackLaw(ControlLaw):
    """Control law that feeds back the motion of one body, which `feedback` names."""

    feedback: str = body(TABLE, "motion is fed back")


def superposed(law: ControlLaw, period: float) -> LinearFeedback:
    """Return the linear form, without limit and reference, of a law: its answers to each unit.

    Force and next state must be linear in state, displacement and velocity while the force is not
    limited; `period` is that of the samples, s.
    """
    free, states = replace(law, force_limit=inf), len(law.state_units)
    columns: list[list[float]] = []
    for unit in np.eye(states + 2).tolist():
        position, velocity = unit[states:]
        sample = Sample(0, position, velocity, 0.0, 0.0, 0.0)
        force, state = free.respond(tuple(unit[:states]), period, sample, NO_REFERENCE)
        columns.append([*state, force])
    matrix = np.array(columns).T
    return LinearFeedback(
        matrix[:-1, :states], matrix[:-1, states:], matrix[-1, :states], matrix[-1, states:]
    )
