"""Play and force ripple that a recording shows, and recordings without them."""

from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.record.imperfections import play_note, ripple_note
from stickslip_ros.record.table_columns import TableFormat
from stickslip_ros.record.table_file import read_table

TIME = np.arange(3000) / 500.0
UNITS = ("m", "N")
SINES = ((0.05, 0.3, 0.3), (0.017, 0.71, 1.1), (0.006, 1.9, 2.0), (0.0015, 4.7, 0.4))
POSITION, SPEED, BEND = (
    sum(
        size * (2.0 * np.pi * rate) ** order * np.sin(2.0 * np.pi * rate * TIME + phase + turn)
        for size, rate, phase in SINES
    )
    for order, turn in enumerate((0.0, np.pi / 2.0, np.pi))
)


def forces(seed: int) -> np.ndarray:
    """Return the force of an axis of 12 kg with friction."""
    noise = 0.2 * np.random.default_rng(seed).standard_normal(len(TIME))
    return 12.0 * BEND + 60.0 * SPEED + 9.0 * np.sign(SPEED) + noise


@pytest.mark.parametrize(
    ("size", "period", "said"), [(4.0, 2e-3, "amplitude 4 N, period 2 mm"), (1.0, 5e-3, "period 5")]
)
def test_a_force_that_ripples_over_the_position_is_said(
    size: float, period: float, said: str
) -> None:
    force = forces(0) + size * np.sin(2.0 * np.pi * POSITION / period + 1.0)
    (note,) = ripple_note(TIME, np.round(POSITION, 6), force, UNITS)
    assert said in note


def test_other_forces_are_no_ripple() -> None:
    """Noise, friction, a vibration in time, friction of a part of the way, few or no samples."""
    others = [
        0.0,
        7.0 * np.sign(SPEED) * np.exp(-np.abs(SPEED) / 0.01),
        3.0 * np.sin(2.0 * np.pi * 40.0 * TIME),
        3.0 * np.sign(SPEED) * (POSITION > 0.02),
        np.convolve(np.random.default_rng(9).standard_normal(len(TIME)), np.ones(25) / 5, "same"),
    ]
    for seed, other in enumerate(others):
        assert not [*ripple_note(TIME, np.round(POSITION, 6), forces(seed) + other, UNITS)]
    for count in (0, 1, 300):
        assert not [*ripple_note(TIME[:count], 0.0 * TIME[:count], TIME[:count], UNITS)]


def test_a_vibration_from_each_reversal_on_is_no_ripple() -> None:
    """At one speed, there and back, it has the phase of the position in each direction."""
    phase = TIME % 2.0
    position = 0.1 * np.clip(np.minimum(phase, 2.0 - phase), 0.05, 0.95)
    moving = np.gradient(position, TIME)
    force = 9.0 * np.sign(moving) + 2.0 * np.sin(2.0 * np.pi * 17.3 * (TIME % 1.0))
    force += 0.1 * np.random.default_rng(1).standard_normal(len(TIME))
    assert not [*ripple_note(TIME, position, force, UNITS)]


def with_play(play: float) -> np.ndarray:
    """Return the position of a table that a motor moves through a play."""
    table = [POSITION[0]]
    for motor in POSITION[1:].tolist():
        table.append(min(max(table[-1], motor - play / 2.0), motor + play / 2.0))
    return np.array(table)


def test_play_is_said_with_its_size() -> None:
    noise = 1e-6 * np.random.default_rng(2).standard_normal(len(TIME))
    (note,) = play_note(POSITION, with_play(2e-4) + noise, "m")
    assert "until the reference has moved by 200 µm: that is play between them" in note


def test_other_differences_are_no_play() -> None:
    """A lag, noise, a constant difference, one direction, stick-slip behind a spring."""
    noise = 2e-5 * np.random.default_rng(3).standard_normal(len(TIME))
    lag = POSITION - SPEED / 200.0
    sawtooth = 2e-3 * np.sign(SPEED) + 1e-3 * ((np.abs(POSITION) / 5e-3) % 1.0)
    for other in (lag, POSITION + noise, POSITION - 1e-3, POSITION - sawtooth, 0.0 * TIME):
        assert not [*play_note(POSITION, other, "m")]
    assert not [*play_note(TIME, TIME - 1e-4, "m")]
    assert not [*play_note(TIME[:0], TIME[:0], "m")]


def lines(*columns: np.ndarray) -> str:
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return "".join(",".join(map(repr, row)) + "\n" for row in rows)


def test_tables_have_the_sentences_and_files_two_clocks(tmp_path: Path) -> None:
    first, second = tmp_path / "motion.csv", tmp_path / "force.csv"
    ripple = forces(4) + 4.0 * np.sin(2.0 * np.pi * POSITION / 0.002)
    motion = lines(1e3 * TIME, 1e3 * POSITION, 1e3 * with_play(2e-4))
    first.write_text(f"t [ms],motor [mm],table [mm]\n{motion}")
    second.write_text(f"t,F [N]\n{lines(TIME + 100.0, ripple)}")
    columns = {"time": "t", "position": "table", "reference": "motor", "force": "2:F"}
    with pytest.raises(InvalidInputError, match="--shift -100 lets both start together"):
        read_table(first, columns, form=TableFormat(second=second))
    recording = read_table(first, columns, form=TableFormat(second=second, shift=-100.0))
    assert recording.forces.force == pytest.approx(ripple, abs=1e-9)
    notes = " ".join(recording.notes)
    assert "until the reference has moved by 200 µm" in notes
    assert "N, period 2 mm" in notes
    assert "force has times of its own, those of column 2:t" in notes
    del columns["reference"]
    unasked = read_table(first, columns, form=TableFormat(second=second, shift=-100.0))
    assert "until column motor [mm] has moved by 200 µm" in " ".join(unasked.notes)
    first.write_text(f"t [ms],motor [mm],table [mm]\n{motion}0.0,,0.0\n".replace("0.0,,", "1e9,,"))
    assert "motor" not in " ".join(read_table(first, {"time": "t", "position": "table"}).notes)
    first.write_text(f"t [ms],motor [mm],table [mm]\n{motion}")
    half = read_table(first, columns, form=TableFormat(second=second, shift=-104.0))
    assert "and is not known at 67% of the others" in " ".join(half.notes)
    assert np.isnan(half.forces.force[-900:]).all()
    second.write_text(f"s,F [N]\n{lines(TIME + 100.0, ripple)}")
    with pytest.raises(InvalidInputError, match=r"the second table has no column t .ms., that of"):
        read_table(first, columns, form=TableFormat(second=second))
    second.write_text(f"t,F [N]\n{lines(TIME + 100.0, ripple)}")
    with pytest.raises(InvalidInputError, match=r"column table .mm. and column 2:F .N. have"):
        read_table(first, columns | {"position": "table-2:F"}, form=TableFormat(second=second))
    with pytest.raises(InvalidInputError, match="shift is for columns with times of their own"):
        read_table(first, {"time": "t", "position": "table"}, form=TableFormat(shift=1.0))
