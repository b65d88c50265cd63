"""Records from samples whose clock jitters and has gaps."""

import numpy as np
import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.record import Record, evenly_spaced


def _columns(time: np.ndarray) -> dict[str, np.ndarray]:
    return {
        "position": np.sin(time),
        "belt_velocity": np.full(len(time), 0.04),
        "force": np.floor(1000.0 * time),
    }


def _stamps(time: np.ndarray) -> np.ndarray:
    return np.rint(1e9 * time).astype(np.int64)


def test_even_samples_are_kept_as_they_are() -> None:
    time = 0.001 * np.arange(800)
    (record,) = evenly_spaced("log", _stamps(time), _columns(time))
    assert record.period == pytest.approx(0.001, rel=1e-9)
    assert np.array_equal(record.position, np.sin(time))
    assert record.reference is None


def test_jitter_is_interpolated_and_forces_are_held() -> None:
    even = 0.001 * np.arange(800)
    time = even + np.random.default_rng(1).uniform(0.0, 2e-4, len(even))
    time[0] = 0.0
    (record,) = evenly_spaced("log", _stamps(time), _columns(time))
    own = record.period * np.arange(len(record.position))
    assert record.position == pytest.approx(np.sin(own), abs=1e-6)
    assert record.force is not None
    assert set(np.diff(record.force)) <= {0.0, 1.0, 2.0}


def test_a_gap_makes_two_records_and_single_losses_are_bridged() -> None:
    time = 0.001 * np.arange(2000)
    kept = np.ones(2000, bool)
    kept[900:1000] = False
    kept[300] = False
    columns = _columns(time)
    columns["position"][500] = columns["force"][510] = np.nan
    own = {name: values[kept] for name, values in columns.items()}
    first, second = evenly_spaced("log", _stamps(time[kept]), own)
    assert (len(first.position), len(second.position)) == (900, 1000)
    assert first.position[300] == pytest.approx(np.sin(0.3), abs=1e-6)
    assert first.position[500] == pytest.approx(np.sin(0.5), abs=1e-6)
    assert first.force is not None
    assert first.force[510] == first.force[509]


def test_too_few_samples_are_refused() -> None:
    time = 0.001 * np.arange(100)
    with pytest.raises(InvalidInputError, match=r"has 100 samples: .* at least 500"):
        evenly_spaced("log", _stamps(time), _columns(time))
    time = np.concatenate([time[:90] + 10.0 * number for number in range(8)])
    with pytest.raises(InvalidInputError, match="without a gap"):
        evenly_spaced("log", _stamps(time), _columns(time))


def test_a_part_has_all_columns() -> None:
    record = Record("log", 0.001, np.arange(10.0), np.zeros(10), disturbance=np.ones(10))
    part = record.part(2, 5)
    assert part.position.tolist() == [2.0, 3.0, 4.0]
    assert part.held_force.tolist() == [1.0, 1.0, 1.0]
    assert part.force is None
