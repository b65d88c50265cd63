"""A control law at work: the one place where a sample meets a controller."""

from collections.abc import Callable

from stickslip_ros.physics.loop.sampled_loop import SampledLoop
from stickslip_ros.physics.model.control import NO_REFERENCE, ControlLaw, Reference
from stickslip_ros.samples import Sample

ReferenceSource = Callable[[float], Reference]
"""Returns the reference at a time since the first sample, s."""


def no_reference(time: float) -> Reference:
    """Return no reference, as a `ReferenceSource`."""
    return NO_REFERENCE


class Controller:
    """Answers samples by a control law, one after the other.

    The law may be replaced while it works; its state stays.

    Parameters
    ----------
    law : ControlLaw
        Control law.
    reference : callable, optional
        Returns the reference at a time (s) since the first sample, for a law that follows one. By
        default there is none.
    state : tuple of float, optional
        State of the law at the first sample. By default it is `ControlLaw.initial_state`.

    Examples
    --------
    >>> from stickslip_ros.physics.loop.controller import Controller
    >>> from stickslip_ros.physics.model.control import VelocityFeedback
    >>> from stickslip_ros.samples import Sample
    >>> controller = Controller(VelocityFeedback(velocity_gain=-500.0, force_limit=10.0))
    >>> controller.answer(Sample(0, 0.0, 0.04, 0.0, 0.0, 0.04))
    -10.0
    """

    def __init__(
        self,
        law: ControlLaw,
        reference: ReferenceSource = no_reference,
        state: tuple[float, ...] | None = None,
    ) -> None:
        self.law = law
        """Control law; a new one acts from the next sample on, with the state of the last."""
        self.reference = NO_REFERENCE
        """Reference at the newest sample."""
        self.follows = reference
        """Returns the reference at a time (s) since the first sample."""
        self._first_state = state
        self.state: tuple[float, ...] = state or ()
        """State of the law after the newest sample."""
        self._stamp: int | None = None
        self._first_stamp = 0
        self._older: Sample | None = None

    def answer(self, sample: Sample) -> float | None:
        """Return the control force for a sample.

        A stamp that was already answered is not answered again. Neither is an older one, unless the
        next sample continues from it: then time has gone back, and the law restarts from that older
        one. A law in its initial state answers a stamp that is not later than the first: it may
        start a run whose next sample waits for the answer.

        Parameters
        ----------
        sample : Sample
            Sample to answer; position and velocity are finite.

        Returns
        -------
        float or None
            Force, N, not finite if it overflows; None for no answer.
        """
        stamp, last, law = sample.stamp, self._stamp, self.law
        if last is None:
            self._start(sample)
            elapsed = 0.0
        elif stamp > last:
            elapsed = (stamp - last) * 1e-9
            if law.follows_reference:
                self.reference = self.follows((stamp - self._first_stamp) * 1e-9)
        else:
            return self._answer_older(sample, last)
        self._stamp = stamp
        self._older = None
        force, self.state = law.respond(self.state, elapsed, sample, self.reference)
        if (stamp - self._first_stamp) * 1e-9 < law.start_after:
            return 0.0
        limit = law.force_limit
        if -limit < force < limit:
            return force
        return max(-limit, min(limit, force))

    def _start(self, sample: Sample) -> None:
        self._stamp = self._first_stamp = sample.stamp
        if self.law.follows_reference:
            self.reference = self.follows(0.0)
        first_state, self._first_state = self._first_state, None
        if first_state is None:
            first_state = self.law.initial_state(sample, self.reference)
        self.state = first_state

    def _answer_older(self, sample: Sample, newest: int) -> float | None:
        """Answer a sample that is not later than the newest answered one."""
        stamp, first = sample.stamp, self._first_stamp
        older, self._older = self._older, None
        # After the beginning, the newest one again is only a sample that came twice.
        if older and older.stamp < stamp and (stamp < newest or older.stamp <= first):
            self._stamp = None
            self.answer(older)
            return self.answer(sample)
        if stamp == newest:
            return None
        self._older = sample
        return Controller(self.law, self.follows).answer(sample) if stamp <= first else None


def answer(loop: SampledLoop, controller: Controller | None) -> float:
    """Let a controller answer the present sample of a loop.

    Parameters
    ----------
    loop : SampledLoop
        Loop whose sample is answered.
    controller : Controller or None
        Controller; None for no control.

    Returns
    -------
    float
        Control force, N; 0 without an answer.
    """
    if controller is None:
        return 0.0
    sample = loop.sample
    force = controller.answer(sample)
    if force is None:
        return 0.0
    loop.offer(sample.stamp, force)
    return force
