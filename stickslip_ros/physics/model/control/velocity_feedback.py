"""Velocity feedback: a damper, and optionally a spring, between the slide and the frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.control.base import ControlLaw, LinearFeedback, State
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.samples import Reference, Sample


@dataclass(frozen=True)
class StateFeedback:
    """Force u = k0 x + k1 y, without a state of its own; see `ContinuousControl`."""

    states: ClassVar[Sequence[str]] = ()
    """Names of the states: none."""

    position_gain: Any
    """Gain k0 of the displacement, N/m."""
    velocity_gain: Any
    """Gain k1 of the velocity, N s/m."""

    def scaled(self, drive: Drive) -> "StateFeedback":
        """Convert from SI units to dimensionless values.

        Parameters
        ----------
        drive : Drive
            Drive that defines the scales.

        Returns
        -------
        StateFeedback
            The same control, dimensionless.
        """
        return StateFeedback(
            self.position_gain * drive.length_scale / drive.normal_force,
            self.velocity_gain * drive.speed_scale / drive.normal_force,
        )

    def silenced(self) -> "StateFeedback":
        """Return a control without force."""
        return replace(self, position_gain=0.0, velocity_gain=0.0)

    def rest(self, position: Any, speed: Any) -> Sequence[Any]:
        """Return no states.

        Parameters
        ----------
        position, speed : float, array or expression
            Displacement x and speed y of the slide.

        Returns
        -------
        sequence
            Empty.
        """
        return ()

    def state_rates(self, position: Any, speed: Any, states: Sequence[Any]) -> Sequence[Any]:
        """Return no rates.

        Parameters
        ----------
        position, speed : float, array or expression
            Displacement x and speed y of the slide.
        states : sequence
            Empty.

        Returns
        -------
        sequence
            Empty.
        """
        return ()

    def control_force(self, position: Any, speed: Any, states: Sequence[Any]) -> Any:
        """Return the force u = k0 x + k1 y.

        Parameters
        ----------
        position, speed : float, array or expression
            Displacement x and speed y of the slide.
        states : sequence
            Empty.

        Returns
        -------
        float, array or expression
            Force, in the unit of the gains.
        """
        return self.position_gain * position + self.velocity_gain * speed

    def state_scales(self, drive: Drive) -> Sequence[float]:
        """Return no factors.

        Parameters
        ----------
        drive : Drive
            Drive that defines the scales.

        Returns
        -------
        sequence
            Empty.
        """
        return ()

    def bound(self, speed: Any) -> Any:
        """Return the force on the speed; the spring stores what it takes.

        Parameters
        ----------
        speed : ndarray
            Speeds y.

        Returns
        -------
        ndarray
            Forces, shape of `speed`.
        """
        return self.velocity_gain * speed


@dataclass(frozen=True)
class VelocityFeedback(ControlLaw):
    """Force proportional to velocity and displacement, u = k0 x + k1 x'.

    A negative velocity gain is a damper between the slide and the frame. A position gain moves the
    equilibrium.

    Examples
    --------
    >>> from stickslip_ros.physics.loop.controller import Controller
    >>> from stickslip_ros.physics.model.control import VelocityFeedback
    >>> from stickslip_ros.samples import Reference, Sample
    >>> controller = Controller(VelocityFeedback(velocity_gain=-500.0))
    >>> controller.answer(Sample(0, 1e-4, 0.04, 0.0, 0.0, 0.04))
    -20.0
    """

    name: ClassVar[str] = "velocity_feedback"

    velocity_gain: float = constant(
        -1.0, "Gain k1 of the velocity; a negative gain removes energy.", "N s/m"
    )
    """Gain k1 of the velocity, N s/m."""
    position_gain: float = constant(
        0.0, "Gain k0 of the displacement; it moves the equilibrium.", "N/m"
    )
    """Gain k0 of the displacement, N/m."""

    @property
    def continuous(self) -> StateFeedback:
        """The law without sampling."""
        return StateFeedback(self.position_gain, self.velocity_gain)

    def respond(
        self, state: State, elapsed: float, sample: Sample, reference: Reference
    ) -> tuple[float, State]:
        """Return the force for a sample; see `ControlLaw.respond`.

        Parameters
        ----------
        state : tuple of float
            Empty.
        elapsed : float
            Time since the last sample, s; not used.
        sample : Sample
            Sample to answer.
        reference : Reference
            Not used.

        Returns
        -------
        force : float
            Control force, N.
        state : tuple of float
            Empty.
        """
        return self.position_gain * sample.position + self.velocity_gain * sample.velocity, state

    def linear_feedback(self, period: float) -> LinearFeedback:
        """Return the law itself, which is linear.

        Parameters
        ----------
        period : float
            Sample period, s; not used.

        Returns
        -------
        LinearFeedback
            Law without a state.
        """
        direct = np.array([self.position_gain, self.velocity_gain])
        return LinearFeedback(np.empty((0, 0)), np.empty((0, 2)), np.empty(0), direct)
