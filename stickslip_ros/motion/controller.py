"""A control law at work: the one place where a sample meets a controller."""

from collections.abc import Callable
from contextlib import suppress
from math import dist, inf, isfinite, isnan, nan
from numbers import Real
from typing import Any

from stickslip_ros.errors import RunError, in_words
from stickslip_ros.model.control import NO_REFERENCE, ControlLaw, Reference
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.samples import Sample
from stickslip_ros.stamps import STAMP_ROUNDING
from stickslip_ros.text import shown

_STATE = "which must be a tuple of finite numbers, as many at every sample"

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
            Force, N; None for no answer.

        Raises
        ------
        RunError
            If the law raises anything, or returns no finite force or no state of the size that it
            had. The next sample continues from the last one whose state was good.
        """
        stamp, last = sample.stamp, self._stamp
        law, before, starts = self.law, self.state, last is None
        if last is None:
            self._first_stamp = last = stamp
        elif stamp <= last:
            return self._answer_older(sample, last)
        since = (stamp - self._first_stamp) * 1e-9
        if law.follows_reference:
            self.reference = self.follows(since)
        try:
            if starts:
                before = self._first_state or law.initial_state(sample, self.reference)
                self._first_state = None
            force, state = law.respond(before, (stamp - last) * 1e-9, sample, self.reference)
        except (Exception, SystemExit) as error:  # the code of others: anything
            raise _failure(law, since, in_words(error)) from None
        try:
            fits = dist(state, before) < inf  # the quickest way to see size and values
        except (TypeError, ValueError, OverflowError):
            fits = False
        if not fits:
            raise _failure(law, since, f"its state is {shown(state)}, {_STATE}")
        self._stamp, self.state, self._older = stamp, state, None
        if since < law.start_after - STAMP_ROUNDING:
            return 0.0
        limit = law.force_limit
        if isinstance(force, float) and -limit < force < limit:
            return force
        return _limited(law, since, force)

    def continues(self, stamp: int, period: int) -> bool:
        """Return whether a sample follows the last by a period, and the force acts.

        Parameters
        ----------
        stamp : int
            Stamp of the sample, ns.
        period : int
            Sample period, ns.
        """
        since = (stamp - self._first_stamp) * 1e-9
        acts = since >= self.law.start_after - STAMP_ROUNDING
        return self._stamp == stamp - period and acts

    def skip(self, stamp: int, state: tuple[float, ...]) -> None:
        """Continue after samples that were answered elsewhere.

        Parameters
        ----------
        stamp : int
            Stamp of the last of them, ns.
        state : tuple[float, ...]
            State of the law after it.
        """
        self._stamp, self.state, self._older = stamp, state, None

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
        Control force, N; 0 without an answer, and the last one where the sample asks for none.
    """
    if controller is None:
        return 0.0
    if loop.answered:
        return loop.answers.force
    force = controller.answer(loop.sample)
    if force is None:
        return 0.0
    loop.answers.accept(loop.sample_number, force)
    return force


def _limited(law: ControlLaw, since: float, force: Any) -> float:
    """Return a force within the limit as a float; refuse what is no number, or infinite then."""
    limit, value = law.force_limit, nan
    if not isinstance(force, bool) and isinstance(force, Real):
        with suppress(OverflowError):
            value = float(force)
    limited = max(-limit, min(limit, value))
    if isnan(value) or not isfinite(limited):
        raise _failure(law, since, f"its force is {shown(force)}, which must be a finite number")
    return limited


def _failure(law: ControlLaw, since: float, reason: str) -> RunError:
    package = f" of package {law.package}" if law.package else ""
    return RunError(f"the control law {law.name}{package} fails at {since:.6g} s: {reason}")
