"""The laws that follow a reference give what an independent statement of each does."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.linalg import expm

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import (
    ControlLaw,
    DisturbanceObserver,
    FrictionFeedforward,
    LugreObserver,
    Pid,
    Reference,
    ResetIntegral,
    SlidingMode,
)
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import (
    Coulomb,
    Directional,
    Exponential,
    FrictionLaw,
    LuGre,
    Stribeck,
)
from stickslip_ros.motion.controller import Controller
from stickslip_ros.samples import Sample

BELT_SPEED = 0.03
GAINS: dict[str, Any] = {"position_gain": 3e5, "integral_gain": 4e6, "velocity_gain": 2e3}
CURVE: dict[str, Any] = {
    "kinetic_force": 250.0,
    "static_force": 400.0,
    "decay_speed": 0.02,
    "viscous_damping": 150,
}
FEEDFORWARD = FrictionFeedforward(**GAINS, **CURVE, nominal_mass=90.0, exponent=1.7)
BRISTLES = LugreObserver(
    **GAINS, **CURVE, nominal_mass=90.0, exponent=2.0,
    bristle_stiffness=4e7, bristle_damping=1e4, observer_gain=3.0,
)  # fmt: skip
OBSERVER = DisturbanceObserver(
    nominal_mass=80.0, bandwidth=120.0, position_gain=2e5, velocity_gain=3e3
)


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


def random_record(scale: float) -> Record:
    """Return displacements of about `scale` (m) and velocities of about 100 times that per s."""
    rng, count = np.random.default_rng(0), 200
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


def pid(record: Record) -> FloatArray:
    integral = np.cumsum(record.elapsed * record.error)
    return 3e5 * record.error + 4e6 * integral + 2e3 * record.rate


def limited_pid(record: Record) -> FloatArray:
    """At the limit the integral follows what is left."""
    integral, expected = 0.0, []
    for step, error, rate in zip(record.elapsed, record.error, record.rate, strict=True):
        integral += 4e6 * step * error
        force = 3e5 * error + integral + 2e3 * rate
        left = np.clip(force, -300.0, 300.0)
        integral += (1.0 - np.exp(-step / 0.02)) * (left - force)
        expected.append(left)
    assert np.count_nonzero(np.abs(expected) == 300.0) > 20
    return np.array(expected)


def reset_integral(record: Record, share: float, band: float) -> FloatArray:
    """The integral turns where the error changes its sign."""
    error = record.error
    last = np.maximum.accumulate(np.where(np.abs(error) > band, np.arange(len(error)), -1))
    side = np.where(last < 0, 0.0, np.sign(error[last]))
    turns = np.concatenate([[False], side[1:] * side[:-1] < 0.0])
    assert turns.sum() > 10
    # Each share of the integral is turned at every later change of sign.
    later = [
        sum(
            4e6 * record.elapsed[k] * error[k] * np.prod(np.where(turns[k + 1 : n + 1], -share, 1))
            for k in range(n + 1)
        )
        for n in range(len(error))
    ]
    return 3e5 * error + np.array(later) + 2e3 * record.rate


def sliding_mode(record: Record, layer: float) -> FloatArray:
    distance = record.rate + 40.0 * record.error
    inside = np.clip(distance / layer, -1.0, 1.0) if layer else np.sign(distance)
    return 70.0 * (record.reference[2] + 40.0 * record.rate) + 500.0 * inside


def disturbance_observer(record: Record, limit: float) -> FloatArray:
    """The estimate is the low-pass of the force that is not known.

    P' = g (u + g m x' - p), for the pair of p and the held input as a matrix exponential.
    """
    g, m = 120.0, 80.0
    p = held = g * m * record.velocity[0]
    expected = []
    for step, x, y, (r, r1, r2) in zip(*record[:3], record.reference.T, strict=True):
        p = (expm(step * np.array([[-g, g], [0.0, 0.0]])) @ [p, held])[0]
        force = 2e5 * (r - x) + 3e3 * (r1 - y) + m * r2 - (g * m * y - p)
        expected.append(np.clip(force, -limit, limit))
        held = expected[-1] + g * m * y
    return np.array(expected)


def friction_feedforward(record: Record) -> FloatArray:
    """The friction of the reference is added to PID control."""
    v = record.reference[1] - BELT_SPEED
    friction = np.sign(v) * (250.0 + 150.0 * np.exp(-(np.abs(v / 0.02) ** 1.7))) + 150.0 * v
    return pid(record) + friction + 90.0 * record.reference[2]


def lugre_observer(record: Record) -> FloatArray:
    """With z' = v + k e - a z, and (z, 1) as a linear system over each time between samples."""
    z, friction = 0.0, []
    for step, y, e in zip(record.elapsed, record.velocity, record.error, strict=True):
        v = y - BELT_SPEED
        a = 4e7 * abs(v) / (250.0 + 150.0 * np.exp(-((v / 0.02) ** 2)))
        z = (expm(step * np.array([[-a, v + 3.0 * e], [0.0, 0.0]])) @ [z, 1.0])[0]
        friction.append(4e7 * z + 1e4 * (v + 3.0 * e - a * z) + 150.0 * v)
    return pid(record) + np.array(friction) + 90.0 * record.reference[2]


SLIDING = SlidingMode(nominal_mass=70.0, slope=40.0, switching_force=500.0)
CASES: list[tuple[ControlLaw, Callable[[Record], FloatArray]]] = [
    (Pid(**GAINS), pid),
    (Pid(**GAINS, tracking_time=0.02, force_limit=300.0), limited_pid),
    *(
        (
            ResetIntegral(**GAINS, reset_share=share, reset_band=band),
            partial(reset_integral, share=share, band=band),
        )
        for share, band in ((1.0, 0.0), (0.4, 5e-4), (0.0, 1e-3))
    ),
    *(
        (replace(SLIDING, boundary_layer=layer), partial(sliding_mode, layer=layer))
        for layer in (0.05, 1e-9, 0.0)
    ),
    *(
        (replace(OBSERVER, force_limit=limit), partial(disturbance_observer, limit=limit))
        for limit in (np.inf, 250.0)
    ),
    (FEEDFORWARD, friction_feedforward),
    (BRISTLES, lugre_observer),
]


@pytest.mark.parametrize(("law", "stated"), CASES)
def test_the_forces_are_those_of_an_independent_statement(
    law: ControlLaw, stated: Callable[[Record], FloatArray]
) -> None:
    record = random_record(scale=1e-6 if isinstance(law, LugreObserver) else 1e-3)
    expected = stated(record)
    largest = np.abs(expected).max()
    np.testing.assert_allclose(answers(law, record), expected, rtol=0.0, atol=1e-12 * largest)


def test_what_switches_has_no_linear_form_and_a_reset_integral_that_of_its_pid_control() -> None:
    assert replace(SLIDING, boundary_layer=0.0).linear_feedback(1e-3) is None
    law = ResetIntegral(**GAINS)
    assert law.linear_feedback(1e-3) is None
    linear = Pid(**GAINS).linear_feedback(1e-3) or ()
    for part, expected in zip(law.linear_part(1e-3), linear, strict=True):
        np.testing.assert_array_equal(part, expected)


@pytest.mark.parametrize(
    "law",
    [
        Exponential(0.4, kinetic=0.25, decay_speed=0.02, viscous=0.3, exponent=2.0),
        LuGre(Exponential(0.4, kinetic=0.25, decay_speed=0.02), bristle_stiffness=1e4),
        Directional(Coulomb(0.3, viscous=0.5), Coulomb(0.4)),
        Stribeck(0.4, 0.25, 0.05),
    ],
)
def test_a_law_takes_over_mass_and_friction_of_a_drive(law: FrictionLaw) -> None:
    """An exponential law exactly; another one where its fall begins, has 1/e left and ends."""
    drive = Drive(90.0, 100.0, 1e6, 1000.0, 0.03, law)
    found = replace(FEEDFORWARD, nominal_mass=1.0).for_drive(drive)
    exact = not isinstance(law, Stribeck)
    speeds = np.array([1e-9, 0.004, 0.02, 0.05]) if exact else np.array([1e-9, 0.05])
    expected = -1000.0 * law.coefficient(speeds, np.ones(len(speeds)))
    forces = [found.size(v) + found.viscous_damping * v for v in speeds.tolist()]
    np.testing.assert_allclose(forces, expected, rtol=1e-6 if exact else 0.15)
    assert found.nominal_mass == OBSERVER.for_drive(drive).nominal_mass == 90.0


def test_a_law_takes_the_bristles_of_a_drive() -> None:
    curve = Exponential(0.4, kinetic=0.25, decay_speed=0.02)
    found = BRISTLES.for_drive(Drive(90.0, 0.0, 1e6, 1000.0, 0.03, LuGre(curve, 2e4, 5.0)))
    assert (found.bristle_stiffness, found.bristle_damping) == (2e7, 5e3)
    assert (found.static_force, found.kinetic_force) == (400.0, 250.0)
