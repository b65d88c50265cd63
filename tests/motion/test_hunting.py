"""PID control of a mass with LuGre friction hunts; what the laws for positioning make of it.

The drive and the gains are those of C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, A
new model for control of systems with friction, IEEE Transactions on Automatic Control 40(3), 1995.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from stickslip_ros.arrays import FloatArray
from stickslip_ros.model.control import ControlLaw, LugreObserver, Pid, ResetIntegral
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Exponential, LuGre
from stickslip_ros.model.signals import step
from stickslip_ros.motion import Motion
from stickslip_ros.motion.controller import Controller, answer
from stickslip_ros.motion.sampled_loop import SampledLoop
from stickslip_ros.studies.case_outcome import hunting

STIFFNESS, DAMPING, VISCOUS = 1e5, np.sqrt(1e5), 0.4
CURVE = Exponential(1.5, kinetic=1.0, decay_speed=1e-3, viscous=VISCOUS, exponent=2.0)
DRIVE = Drive(1.0, 0.0, 0.0, 1.0, 0.0, LuGre(CURVE, STIFFNESS, DAMPING))
GAINS: dict[str, Any] = {"position_gain": 3.0, "integral_gain": 4.0, "velocity_gain": 6.0}
START, RATE = 50.0, 1000.0
pytestmark = pytest.mark.long


def errors(law: ControlLaw, duration: float) -> FloatArray:
    """Return the error of the displacement after a step of 1 m, from `START` on."""
    motion = Motion(DRIVE, 0.0, 0.0)
    loop = SampledLoop(motion, RATE, 10**9)
    controller = Controller(law, step(1.0, 0.0, 1e9).reference)
    found: list[float] = []
    for _ in range(round(duration * RATE)):
        found.append(motion.position - 1.0)
        answer(loop, controller)
        loop.advance()
    return np.array(found[round(START * RATE) :])


def test_pid_control_hunts_with_the_period_of_the_continuous_solution() -> None:
    def rates(time: float, state: Sequence[float]) -> list[float]:
        x, v, z, integral = state
        size = 1.0 + 0.5 * np.exp(-((v / 1e-3) ** 2))
        yields = v - STIFFNESS * abs(v) * z / size
        force = 3.0 * (1.0 - x) + 4.0 * integral - 6.0 * v
        return [v, force - STIFFNESS * z - DAMPING * yields - VISCOUS * v, yields, 1.0 - x]

    times = np.arange(START, 110.0, 1e-2)
    solved: Any = solve_ivp(
        rates, (0.0, 110.0), np.zeros(4), "LSODA", t_eval=times, rtol=1e-8, atol=1e-11
    )
    amplitude, period = hunting(solved.y[0] - 1.0, 1e-3, 100.0)
    assert period == pytest.approx(24.44, rel=1e-3)
    found = hunting(errors(Pid(**GAINS), 110.0), 1e-3, RATE)
    assert found == pytest.approx((amplitude, period), rel=0.01)


def test_the_reset_integral_does_not_hunt() -> None:
    error = errors(ResetIntegral(**GAINS, reset_share=0.5, reset_band=1e-4), 80.0)
    assert hunting(error, 2e-4, RATE) == (0.0, None)
    assert np.abs(error[-20_000:]).max() < 2e-4


def test_the_observer_helps_and_with_forces_30_percent_off_harms() -> None:
    """PID control hunts with 64 mm."""

    def amplitude(share: float) -> float:
        law = LugreObserver(
            **GAINS,
            nominal_mass=1.0,
            static_force=1.5 * share,
            kinetic_force=share,
            decay_speed=1e-3,
            exponent=2.0,
            viscous_damping=VISCOUS * share,
            bristle_stiffness=STIFFNESS,
            bristle_damping=DAMPING,
        )
        return float(np.ptp(errors(law, 80.0))) / 2.0

    assert amplitude(1.0) < 3e-3
    assert amplitude(1.3) == pytest.approx(0.0919, rel=0.02)
