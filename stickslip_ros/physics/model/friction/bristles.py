"""What the laws share whose contact is a spring that yields: bristles."""

from math import exp
from typing import Any

from stickslip_ros.physics.model.constants import constant

LEAST_SIZE = 1e-12
"""Least coefficient at which bristles yield."""


def bristle_stiffness() -> Any:
    """Describe the constant of this name."""
    return constant(
        1000.0, "Stiffness S of the contact, per unit of normal force.", "1/m", positive=True
    )


def approached(deflection: float, steady: float, path: float) -> float:
    """Return the deflection after a path (m), with z' = v_r (1 - s z / |steady|)."""
    return steady + (deflection - steady) * exp(-path / abs(steady))
