"""The names of version 0.1 for the washout law."""

import warnings
from typing import Any

from stickslip_ros.physics.loop.controller import Controller
from stickslip_ros.physics.model.control import Washout as _Law
from stickslip_ros.samples import Sample


def __getattr__(name: str) -> Any:
    if name == "WashoutParameters":
        _warn("WashoutParameters", "stickslip_ros.physics.model.control.Washout")
        return _Law
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


class Washout:
    """Washout controller of version 0.1; use `Controller` with the law."""

    def __init__(self, parameters: _Law, low_passed: float | None = None) -> None:
        _warn("Washout", "stickslip_ros.physics.loop.controller.Controller")
        state = None if low_passed is None else (low_passed, low_passed)
        self._controller = Controller(parameters, state=state)

    @property
    def parameters(self) -> _Law:
        """Control law."""
        law = self._controller.law
        assert isinstance(law, _Law)
        return law

    @parameters.setter
    def parameters(self, parameters: _Law) -> None:
        self._controller.law = parameters

    @property
    def low_passed(self) -> float:
        """Low-passed speed z at the newest measurement, m/s."""
        state = self._controller.state
        return state[0] if state else 0.0

    def answer(self, stamp: int, velocity: float) -> float | None:
        """Return the force (N) for a stamp (ns) and a velocity (m/s), or None for no answer."""
        nan = float("nan")
        return self._controller.answer(Sample(stamp, nan, velocity, nan, nan, nan))


def _warn(old: str, new: str) -> None:
    warnings.warn(
        f"{__name__}.{old} is now {new}; the old name will be removed in 0.3",
        DeprecationWarning,
        stacklevel=3,
    )
