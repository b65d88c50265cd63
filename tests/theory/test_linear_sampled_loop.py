"""The linear sampled loop: against the loop itself, against brute force and in its limits."""

from dataclasses import replace
from itertools import product
from math import copysign, cos, log, pi, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from scipy.linalg import expm

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.control import SlidingMode, VelocityFeedback, Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Exponential, Linear, LuGre
from stickslip_ros.model.sensor import EXACT_SENSOR, MeasuredVelocity, Sensor
from stickslip_ros.motion import Motion
from stickslip_ros.motion.controller import Controller, answer
from stickslip_ros.motion.sampled_loop import LOCKSTEP_START, SampledLoop
from stickslip_ros.theory.linear_sampled_loop import (
    LONGEST_DELAY,
    LinearSampledLoop,
    settling_time,
    why_no_linear_loop,
)
from tests.drives import FEED_DRIVE, PAPER
from tests.examples import examples
from tests.theory.closed_forms import CubicLoop


def loop_of(
    drive: Drive, rate: float, force_delay: float = 0.0, sensor: Sensor = EXACT_SENSOR
) -> LinearSampledLoop:
    return LinearSampledLoop.from_drive(drive, rate, force_delay, sensor)


@pytest.mark.parametrize("rate", [1e6, 1000.0, 20.0, 1.0, 0.05])
def test_between_samples_an_undamped_drive_turns(rate: float) -> None:
    loop = loop_of(replace(FEED_DRIVE, friction=Coulomb(0.4), damping=0.0), rate)
    angle = FEED_DRIVE.angular_frequency / rate
    slide, starting, _ = loop.held
    cosine, sine = cos(angle), sin(angle)
    near = {"rel": 1e-13 * max(1.0, angle), "abs": 1e-15 * angle}
    assert slide == pytest.approx(np.array([[cosine, sine], [-sine, cosine]]), **near)
    assert starting == pytest.approx(np.array([2.0 * sin(angle / 2.0) ** 2, sine]), **near)


rates = st.floats(0.2, 200.0)
speeds = st.floats(0.1, 0.7)
corners = st.floats(0.02, 10.0)


NEUTRAL = [
    replace(PAPER, friction=Coulomb(0.4), damping=0.0),
    replace(PAPER, friction=Linear(0.4, 0.02), damping=0.02),
]
"""Without control these vibrate for ever: zero is an end of their stable gains."""

drives = st.one_of(
    speeds.map(lambda speed: replace(PAPER, belt_speed=speed)),
    speeds.map(lambda speed: replace(PAPER, belt_speed=speed, damping=0.0)),
    st.floats(1e-6, 10.0).map(lambda damping: replace(NEUTRAL[0], damping=damping)),
    st.floats(-1e-8, 1e-8).map(lambda slope: replace(PAPER, friction=Linear(0.4, 0.02 + slope))),
    st.sampled_from(NEUTRAL),
)
in_step = st.fractions("1/5", 8, max_denominator=5).map(lambda share: float(share) / (2.0 * pi))
"""Rates in a simple ratio to the natural frequency."""


@given(drives, st.one_of(rates, in_step), st.floats(0.0, 12.0), corners)
@examples(quick=15, thorough=70)
@example(NEUTRAL[0], 0.2354, 0.2354 * 4.2438, 2.0)
@example(NEUTRAL[0], 4.0 / (2.0 * pi), 0.0, 1.0)
@example(NEUTRAL[1], 2.0 / (2.0 * pi), 2.64, 0.2)
@example(NEUTRAL[1], 1.0 / (2.0 * pi), 0.0, 0.2)
def test_the_stable_gains_are_those_with_a_spectral_radius_below_one(
    drive: Drive, rate: float, periods: float, corner_frequency: float
) -> None:
    loop = loop_of(drive, rate, periods / rate)
    intervals = loop.stable_linear_gains(corner_frequency)
    magnitudes = np.geomspace(1e-6, 1e4, 100)
    gains = np.concatenate([np.linspace(-4.0, 4.0, 201), -magnitudes, magnitudes])
    # At an end itself it is neither, and near it rounding decides.
    ends = np.array([end for interval in intervals for end in interval])
    clear = np.array([np.all(np.abs(gain - ends) > 1e-6 * abs(gain)) for gain in gains])
    inside = np.array([any(low < gain < high for low, high in intervals) for gain in gains])
    rates = loop.decay_rates(np.array([corner_frequency]), gains)[0] / rate
    decided = clear & (np.abs(rates) > 1e-9)
    assert np.array_equal(inside[decided], (rates > 0.0)[decided])


@pytest.mark.parametrize("drive", NEUTRAL)
@pytest.mark.parametrize(("rate", "force_delay"), [(100.0, 0.0), (0.2354, 4.2438), (1e6, 1e-5)])
def test_without_any_damping_zero_is_the_critical_gain(
    drive: Drive, rate: float, force_delay: float
) -> None:
    loop = loop_of(drive, rate, force_delay)
    assert str(loop.critical_linear_gain(2.0)) == "0.0"


@given(speeds, corners)
@examples(quick=10, thorough=25)
def test_the_critical_gain_tends_to_that_of_the_continuous_loop(
    belt_speed: float, corner_frequency: float
) -> None:
    drive = replace(PAPER, belt_speed=belt_speed)
    cubic = CubicLoop.from_drive(drive)
    assume(abs(cubic.trace * corner_frequency - 1.0) > 0.05)
    expected = cubic.critical_linear_gain(corner_frequency)
    errors = []
    for rate in (1e3, 1e4, 1e6):
        found = loop_of(drive, rate, 0.5 / rate).critical_linear_gain(corner_frequency)
        if expected is None:
            # Only gains that shrink the filter to a few samples can be left.
            assert found is None or abs(found) > 10.0
            return
        errors.append(abs(found - expected) * rate)
    assert max(errors) < 100.0 * (1.0 + corner_frequency) ** 4


def test_the_settling_time_is_that_to_a_hundredth() -> None:
    assert settling_time(0.1) == pytest.approx(10.0 * log(100.0))
    assert settling_time(-0.1) is None


@pytest.mark.parametrize("force_delay", [0.5, 1.0, 2.0])
def test_a_coarser_loop_decays_nearly_alike(force_delay: float) -> None:
    loop = loop_of(PAPER, 100.0, force_delay)
    coarse = loop.coarsened()
    assert coarse.under_way < 27 < loop.under_way
    for linear in (-0.5, -0.2, 0.2):
        gains = Washout(0.3, linear, 0.0)
        assert coarse.decay_rate(gains) == pytest.approx(loop.decay_rate(gains), abs=0.02)


def test_the_reason_for_no_linear_loop_is_given() -> None:
    assert LinearSampledLoop.from_drive(replace(PAPER, belt_speed=0.0), 100.0) is None
    assert "belt rests" in (why_no_linear_loop(replace(PAPER, belt_speed=0.0), 100.0, 0.0) or "")
    assert LinearSampledLoop.from_drive(PAPER, 100.0, 1e4) is None
    reason = why_no_linear_loop(PAPER, 100.0, 1e4)
    assert str(LONGEST_DELAY) in reason
    assert why_no_linear_loop(PAPER, 100.0, 3.0) is None


@pytest.mark.long
def test_the_longest_delay_and_the_highest_rate() -> None:
    assert loop_of(PAPER, 100.0, LONGEST_DELAY / 100.0).critical_linear_gain(0.1) is not None
    critical = loop_of(PAPER, 1e9).critical_linear_gain(2.0)
    cubic = CubicLoop.from_drive(PAPER)
    assert critical == pytest.approx(cubic.critical_linear_gain(2.0), rel=1e-6)


def test_a_law_that_is_not_linear_is_refused_by_name() -> None:
    with pytest.raises(InvalidInputError, match="the control law sliding_mode is not linear"):
        loop_of(PAPER, 10.0).spectral_radius(SlidingMode(boundary_layer=0.0))


LUGRE = replace(FEED_DRIVE, friction=LuGre(Exponential(0.4, 0.25, 0.02), 1e5, 100.0))
CONTROL_LAWS = (Washout(20.0, -3000.0, 0.0), VelocityFeedback(-2500.0))
SAMPLES = 60


def sensor(spans: int) -> Sensor:
    if spans == 0:
        return EXACT_SENSOR
    return Sensor(velocity=MeasuredVelocity.DIFFERENCE, difference_samples=spans)


def response(drive: Drive, law: Any, rate: float, delay: float, spans: int) -> np.ndarray:
    """Displacement after a unit force of one period, by a central difference of the loop itself."""
    ends: list[list[float]] = []
    force = 1e-6 * drive.normal_force
    for sign in (1.0, -1.0):
        motion = Motion(drive, drive.equilibrium_position, 0.0)
        memory = drive.friction.memory_at(-drive.belt_speed, -copysign(1.0, drive.belt_speed))
        motion.restart(drive.equilibrium_position, 0.0, memory)
        loop = SampledLoop(motion, rate, LOCKSTEP_START, force_delay=delay, sensor=sensor(spans))
        controller, found = Controller(law), list[float]()
        for number in range(SAMPLES + 20):
            answer(loop, controller)
            loop.disturb(sign * force if number == 18 else 0.0)
            loop.advance()
            if number >= 19:
                found.append(loop.true_sample.position)
        ends.append(found)
    return np.subtract(*ends) / (2.0 * force)


LOOPS = [
    (PAPER, 10.0, 0.0, Washout(0.5, -0.5, -1.0)),
    (PAPER, 10.0, 0.03, Washout(0.5, -0.5, 0.0)),
    (PAPER, 10.0, 0.1, Washout(0.5, -0.5, 0.0)),
    (PAPER, 10.0, 0.25, Washout(0.5, -0.1, 0.0)),
    (PAPER, 1.0, 2.3, Washout(0.2, 0.4, 0.0)),
    (FEED_DRIVE, 1000.0, 0.0035, Washout(20.0, -3000.0, 0.0)),
    (replace(FEED_DRIVE, belt_speed=-0.04), 700.0, 0.01, Washout(20.0, -3000.0, 0.0)),
    (replace(PAPER, friction=Exponential(0.4, 0.25, 0.2, 0.1)), 5.0, 0.5, Washout(1, -0.4, 0)),
    (replace(PAPER, friction=Coulomb(0.4)), 5.0, 0.7, Washout(1.0, 0.1, 0.0)),
]
PARTS = [(0.0, 0.0, 3), (4e-4, 1e-3, 1), (2.7e-3, 5e-3, 0), (4e-4, 0.0, 0), (2.7e-3, 1e-3, 3)]
"""Delay, lag of the actuator, and samples of a difference."""


@pytest.mark.parametrize(
    ("drive", "rate", "delay", "law", "lag", "spans"),
    [
        *((*loop, 0.0, 0) for loop in LOOPS),
        *(
            (drive, 1000.0, delay, law, lag, spans)
            for law, drive, (delay, lag, spans) in product(CONTROL_LAWS, (FEED_DRIVE, LUGRE), PARTS)
        ),
    ],
)
def test_the_matrix_is_that_of_the_loop(
    drive: Drive, rate: float, delay: float, law: Any, lag: float, spans: int
) -> None:
    drive = replace(drive, actuator=Actuator(time_constant=lag))
    loop = loop_of(drive, rate, delay, sensor(spans))
    matrix = loop.transition_matrix(law)
    open_loop, _ = loop.plant
    order = len(open_loop)
    pushed = np.zeros((order + 1, order + 1))
    pushed[:order, :order], pushed[1, order] = open_loop, 1.0
    state = np.zeros(len(matrix))
    state[:order] = expm(pushed * loop.period)[:order, order]
    predicted = []
    for _ in range(SAMPLES + 1):
        predicted.append(state[0] * drive.length_scale / drive.normal_force)
        state = matrix @ state
    found = response(drive, law, rate, delay, spans)
    assert found == pytest.approx(predicted, abs=1e-6 * np.abs(predicted).max())


@pytest.mark.parametrize("drive", [FEED_DRIVE, LUGRE], ids=["static", "memory"])
@pytest.mark.parametrize(
    ("delay", "lag", "spans"),
    [(0.0, 0.0, 8), (0.4e-3, 1e-3, 2), (2.7e-3, 1e-3, 3), (2.7e-3, 0.0, 1), (0.0, 1e-3, 0)],
)
def test_the_stable_gains(drive: Drive, delay: float, lag: float, spans: int) -> None:
    """Against the eigenvalues at very many gains."""
    drive = replace(drive, actuator=Actuator(time_constant=lag))
    loop = loop_of(drive, 1000.0, delay, sensor(spans))
    intervals = loop.stable_linear_gains(20.0)
    scale = max([5000.0, *(abs(end) for interval in intervals for end in interval)])
    gains = np.linspace(-1.47 * scale, 1.43 * scale, 601)
    rates = loop.decay_rates(np.array([20.0]), gains)[0]
    inside = np.any([(low < gains) & (gains < high) for low, high in intervals], axis=0)
    assert np.array_equal(rates > 0.0, np.broadcast_to(inside, rates.shape))
    for end in (end for interval in intervals for end in interval):
        around = [loop.spectral_radius(Washout(20.0, end * g, 0.0)) for g in (0.999999, 1.000001)]
        assert min(around) < 1.0 < max(around)


@pytest.mark.parametrize(("delay", "spans"), [(0.0, 0), (2.7e-3, 0), (2.7e-3, 6), (6e-3, 3)])
def test_the_loop_of_a_slower_controller_is_one_sampled_as_slowly(delay: float, spans: int) -> None:
    loop = LinearSampledLoop.from_drive(FEED_DRIVE, 900.0, delay, sensor(spans), answer_every=3)
    slower = loop_of(FEED_DRIVE, 300.0, delay, sensor(spans // 3))
    law = CONTROL_LAWS[0]
    assert np.array_equal(loop.transition_matrix(law), slower.transition_matrix(law))


def test_a_difference_over_no_multiple_of_the_answers_is_not_covered() -> None:
    sampling = FEED_DRIVE, 1000.0, 0.0, sensor(3), EXACT_SENSOR, 2
    assert LinearSampledLoop.from_drive(*sampling) is None
    assert "a difference over 3 samples, which must be a multiple" in why_no_linear_loop(*sampling)
