"""Actuators of the tests."""

from stickslip_ros.physics.model.actuator import Actuator


def lag(time_constant: float) -> Actuator:
    """An actuator that only lags, by a time constant in s."""
    return Actuator(time_constant=time_constant)
