"""Random samples and references, and what a law answers to them."""

from typing import Any, NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import ControlLaw, Reference
from stickslip_ros.motion.controller import Controller
from stickslip_ros.samples import Sample

BELT_SPEED = 0.03
PID_AND_CURVE = {
    "position_gain": 3e5,
    "integral_gain": 4e6,
    "velocity_gain": 2e3,
    "nominal_mass": 90.0,
    "kinetic_force": 250.0,
    "static_force": 400.0,
    "decay_speed": 0.02,
    "viscous_damping": 150.0,
}
"""Constants that laws which know of friction share."""


class Record(NamedTuple):
    """Samples at uneven times, and the reference at each."""

    elapsed: FloatArray
    """Time since the sample before, s; 0 at the first one."""
    position: FloatArray
    velocity: FloatArray
    reference: FloatArray
    """Position, velocity and acceleration; shape (3, samples)."""

    @property
    def error(self) -> FloatArray:
        return self.reference[0] - self.position

    @property
    def rate(self) -> FloatArray:
        return self.reference[1] - self.velocity


def random_record(seed: int, count: int = 200, scale: float = 1e-3) -> Record:
    """Return displacements of about `scale` (m) and velocities of about 100 times that per s."""
    rng = np.random.default_rng(seed)
    elapsed: FloatArray = 1e-9 * rng.integers(200_000, 2_000_000, count).astype(float)
    elapsed[0] = 0.0
    x, y = rng.normal(size=(2, count)) * [[scale], [100.0 * scale]]
    reference = rng.normal(size=(3, count)) * [[scale], [100.0 * scale], [1.0]]
    return Record(elapsed, x, y, reference)


def answers(law: ControlLaw, record: Record) -> FloatArray:
    """Return the forces of a controller, N."""
    stamps = np.rint(1e9 * np.cumsum(record.elapsed)).astype(int).tolist()
    rows: list[Any] = np.array([record.position, record.velocity]).T.tolist()
    references = dict(zip(stamps, record.reference.T.tolist(), strict=True))
    controller = Controller(law, lambda time: Reference(*references[round(1e9 * time)]))
    forces = [
        controller.answer(Sample(stamp, x, y, 0.0, 0.0, BELT_SPEED))
        for stamp, (x, y) in zip(stamps, rows, strict=True)
    ]
    return np.array(forces, dtype=float)


def assert_same(found: FloatArray, expected: FloatArray) -> None:
    """Compare forces to 1e-12 of the largest."""
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
