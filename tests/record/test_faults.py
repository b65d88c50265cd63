"""Faults of sensors in recordings: dropouts, wraps, velocities that contradict the positions."""

from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.record.faults import Jumps, velocity_fault
from stickslip_ros.record.table_file import read_table
from tests.record.runs import csv_of

TIME = 1e-3 * np.arange(4000, dtype=np.float64)
ANGLE = 2.0 * np.pi * 1.5 * TIME
POSITION = 0.05 * np.sin(ANGLE) + 0.01 * np.sin(3.7 * ANGLE)
VELOCITY: FloatArray = np.gradient(POSITION, TIME)
COARSE = np.round(POSITION / 1e-5) * 1e-5


def sawtooth(rate: float) -> FloatArray:
    """Stick-slip whose slips take 20 ms."""
    time = np.arange(0.0, 20.0, 1.0 / rate) % 0.9
    return np.where(time < 0.88, 0.01 * time, 0.0088 * (0.9 - time) / 0.02)


@pytest.mark.parametrize("position", [POSITION, COARSE])
def test_jumps_away_and_back_are_dropouts(position: FloatArray) -> None:
    lost = {700, 1500, 1501, 1502, 1506, 2000, *range(3000, 3020)}
    position = position + 0.2
    position[[*lost]] = 0.0
    assert set(Jumps(position).dropouts().tolist()) == lost


@pytest.mark.parametrize("rate", [1000.0, 100.0, 20.0, 7.0])
@pytest.mark.parametrize("step", [0.0, 1e-4])
@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_motions_have_no_faults(rate: float, step: float, noise: float) -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 20.0, 1.0 / rate)
    hit = np.where(time > 5.0, np.exp(5.0 - time) * np.sin(200.0 * (time - 5.0)), 0.0)
    moved = 0.1 * np.clip(np.abs(time % 8.0 - 4.0), 1.0, 3.0)
    for motion in (sawtooth(rate), hit, moved, np.sin(40.0 * time), np.zeros_like(time)):
        signal = motion + noise * rng.standard_normal(len(motion))
        signal = np.round(signal / step) * step if step else signal
        assert not len(Jumps(signal).dropouts())
        assert Jumps(signal).shifts() == []
        assert Jumps(signal).wrap() is None


def test_an_encoder_behind_a_command_flickers_by_a_step_without_a_fault(tmp_path: Path) -> None:
    command = np.round(70.0 * TIME, 4)
    lag = 0.07 + 0.0008 * np.exp(-TIME) * np.sin(ANGLE)
    path = csv_of(tmp_path / "log.csv", t=TIME, cmd=command, act=np.round(command - lag, 3))
    found = read_table(path, {"time": "t", "position": "(cmd-act)*1e-3"})
    assert not any("jumps" in note for note in found.notes)
    assert found.samples.is_valid.all()


def test_jumps_by_a_turn_against_the_motion_are_a_wrap() -> None:
    wrap = Jumps((COARSE + 0.02) % 0.03).wrap()
    assert wrap is not None
    assert wrap[0] == pytest.approx(0.03, rel=1e-6)
    forward = Jumps(np.round(3e5 * TIME**2 + 2e5 * TIME) % 65536.0).wrap()
    assert forward is not None
    assert (forward[0], len(forward[1])) == (65536.0, 85)


def test_a_velocity_that_contradicts_the_positions_is_known() -> None:
    late = np.interp(TIME - 0.01, TIME, VELOCITY)
    answers = {
        "is 1000 times": VELOCITY * 1e3,
        "is -1 times": -VELOCITY,
        "is 9.8 ms later": late,
        "does not follow": np.cos(0.31 * ANGLE),
    }
    for position in (POSITION, COARSE):
        for sentence, velocity in answers.items():
            assert (velocity_fault(TIME, position, velocity) or "")[: len(sentence)] == sentence
        noisy = VELOCITY + 0.05 * np.random.default_rng(1).standard_normal(len(TIME))
        backward: FloatArray = np.diff(position, prepend=position[0]) / 1e-3
        for velocity in (VELOCITY, noisy, backward):
            assert velocity_fault(TIME, position, velocity) is None
        assert velocity_fault(TIME[::100], position[::100], VELOCITY[::100]) is None


def test_what_is_left_out_of_a_table_is_said(tmp_path: Path) -> None:
    position, velocity = POSITION.copy(), VELOCITY.copy()
    position[100:102] = 0.7
    velocity[[300, 900]] = 50.0
    columns = {"time": "t", "position": "x", "velocity": "v"}
    path = csv_of(tmp_path / "log.csv", t=TIME, x=position, v=velocity)
    found = read_table(path, columns)
    assert "away and back, as no motion does, in 2 rows, the first is line 102" in found.notes[1]
    assert "as the positions do not, in 2 rows, the first is line 302" in found.notes[2]
    assert np.flatnonzero(~found.samples.is_valid).tolist() == [100, 101]
    assert found.samples.velocity[[300, 900]] == pytest.approx(VELOCITY[[300, 900]], abs=1e-3)
    path = csv_of(tmp_path / "log.csv", t=TIME, x=POSITION, v=1e3 * VELOCITY)
    found = read_table(path, columns)
    assert "the velocity is 1000 times that of the positions: it is left out" in found.notes
    assert found.velocity_estimated


def test_a_jump_from_which_it_does_not_come_back_is_said(tmp_path: Path) -> None:
    position = POSITION + 0.3 * (TIME >= 1.5)
    path = csv_of(tmp_path / "log.csv", t=TIME, x=position)
    found = read_table(path, {"time": "t", "position": "x"})
    sentence = "the position jumps by 300 mm, at line 1502, 1.5 s after the first row, and does not"
    assert found.notes[1].startswith(sentence)
    assert np.array_equal(found.samples.position, position)


def test_a_counter_that_wraps_is_refused_with_the_expression_that_unwraps_it(
    tmp_path: Path,
) -> None:
    counts = np.round(POSITION / 1e-6) % 16384.0
    path = csv_of(tmp_path / "log.csv", t=TIME, n_um=counts)
    for column, unwrapped in (
        ("n_um", "unwrap(n_um, 16384)*1e-06"),
        ("n_um*1e-6", "unwrap(n_um*1e-6, 0.016384)"),
    ):
        with pytest.raises(InvalidInputError, match="counter that wraps") as refused:
            read_table(path, {"time": "t", "position": column})
        assert str(refused.value).endswith(f": position={unwrapped}")
        found = read_table(path, {"time": "t", "position": unwrapped}).samples.position
        assert found - found[0] == pytest.approx(POSITION - POSITION[0], abs=2e-6)
