"""Records from bags and tables, whose clock may jitter and have gaps."""

from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.errors import BagError, InvalidInputError
from stickslip_ros.identification import recordings as module
from stickslip_ros.identification.even_clock import evenly_spaced
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.recordings import read_all, read_records
from stickslip_ros.record.codec import pack_joint_state, pack_reference, pack_wrench
from stickslip_ros.record.table_columns import Table, TableFormat
from stickslip_ros.samples import Reference
from tests.record.runs import FORCES, STATES, write_bag


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


def test_on_a_clock_that_wanders_a_force_is_the_mean_of_what_is_held() -> None:
    steps = np.random.default_rng(3).choice([0.010, 0.012], p=[0.7, 0.3], size=800)
    time = np.cumsum(steps)
    (record,) = evenly_spaced("log", _stamps(time), _columns(time) | {"force": time})
    even = time[0] + record.period * (0.5 + np.arange(len(record.position)))
    assert record.force is not None
    late = even - record.force
    assert late[:-1].min() > 0.0
    assert late[:-1].mean() == pytest.approx(0.5 * np.mean(steps**2) / np.mean(steps), rel=0.01)


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


def test_the_weight_of_positions_that_an_encoder_does_not_tell_apart() -> None:
    time = 1e-3 * np.arange(2000)
    swing = 3e-4 * np.sin(100.0 * time)
    swing[800:1400] = 4.4e-6  # at rest
    record = Record("log", 1e-3, np.rint(swing / 1e-6) * 1e-6, np.zeros(2000))
    speed = np.abs(np.gradient(swing, 1e-3))
    fast = speed > 2e-3
    assert np.mean(record.weight[fast] == 1.0) > 0.97
    assert np.sum(record.weight[820:1380] ** 2) == pytest.approx(1.0, rel=0.1)
    turning = (speed < 5e-4) & (np.abs(swing) > 2.9e-4)
    assert (record.weight[turning][1:-1] == 0.0).all()


def test_positions_with_noise_of_more_than_a_step_all_count() -> None:
    random = np.random.default_rng(1)
    noisy = np.rint(1e-6 * random.normal(size=1000) / 1e-6) * 1e-6
    assert (Record("log", 1e-3, noisy, np.zeros(1000)).weight == 1.0).all()


@pytest.mark.parametrize("span", [1, 2, 5])
def test_velocities_that_are_differences_are_no_measurements(span: int) -> None:
    time = 1e-3 * np.arange(800)
    columns = _columns(time)
    velocity = np.zeros(800)
    velocity[span:] = (columns["position"][span:] - columns["position"][:-span]) / (span * 1e-3)
    (record,) = evenly_spaced("log", _stamps(time), {**columns, "velocity": velocity})
    assert record.velocity is None
    noisy = np.cos(time) + 1e-3 * np.random.default_rng(1).normal(size=800)
    (record,) = evenly_spaced("log", _stamps(time), {**columns, "velocity": noisy})
    assert record.velocity is not None
    gap = np.where(np.arange(800) == 5, np.nan, noisy)
    (record,) = evenly_spaced("log", _stamps(time), {**columns, "velocity": gap})
    assert record.velocity is not None
    assert np.flatnonzero(record.lost).tolist() == [5]
    most = np.where(np.arange(800) % 3, np.nan, noisy)
    (record,) = evenly_spaced("log", _stamps(time), {**columns, "velocity": most})
    assert record.velocity is None
    assert len(record.position) == 800


def test_samples_that_are_missing_have_no_weight() -> None:
    time = 0.001 * np.arange(1500)
    columns = _columns(time)
    columns["position"][::3] = np.nan
    columns["position"][-1] = 0.0
    (record,) = evenly_spaced("log", _stamps(time), columns)
    assert record.period == pytest.approx(0.001)
    lost = np.arange(1, 1500) % 3 == 0
    lost[-1] = False
    assert (record.lost == lost).all()
    assert (record.weight[lost] == 0.0).all()
    assert (record.weight[~lost] > 0.0).any()
    assert record.part(3, 9).lost.tolist() == lost[3:9].tolist()


def test_the_share_of_samples_in_parts_that_are_too_short() -> None:
    time = np.concatenate([0.001 * np.arange(900), 5.0 + 0.001 * np.arange(100)])
    (record,) = evenly_spaced("log", _stamps(time), _columns(time))
    assert len(record.position) == 900
    assert record.left_out == pytest.approx(0.1)


def test_a_clock_that_is_not_even_is_refused() -> None:
    for time in (
        np.cumsum(np.where(np.arange(1200) % 2, 1e-3, 3e-3)),
        np.cumsum(np.where(np.arange(1201) % 2, 1e-3, 3e-3)),
        np.cumsum(np.random.default_rng(0).uniform(1e-4, 3e-3, 1200)),
        np.where(np.arange(1200) < 600, 0.0, -0.3) + 1e-3 * np.arange(1200),
        np.zeros(1200),
    ):
        with pytest.raises(InvalidInputError, match="must be even up to gaps"):
            evenly_spaced("log", _stamps(time), _columns(time))


def test_stamps_that_repeat_are_one_sample() -> None:
    time = np.repeat(0.001 * np.arange(800), 2)
    (record,) = evenly_spaced("log", _stamps(time), _columns(time))
    assert len(record.position) == 800


_NAMES = {"time": "t", "position": "x", "force": "u", "disturbance": "d"}


@pytest.fixture
def tables(tmp_path: Path) -> list[Path]:
    """Two tables, of which the second one has a disturbance."""
    time = 1e-3 * np.arange(700)
    rows = np.column_stack([time, np.sin(time), np.cos(time), np.ones(700)])
    paths = [tmp_path / "one.csv", tmp_path / "two.csv"]
    np.savetxt(paths[0], rows[:, :3], delimiter=",", header="t,x,u", comments="")
    np.savetxt(paths[1], rows, delimiter=",", header="t,x,u,d", comments="")
    return paths


def test_each_table_is_read_once(tables: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Path] = []
    own = module.table_of

    def counted(path: Path, form: TableFormat) -> Table:
        asked.append(path)
        return own(path, form)

    monkeypatch.setattr(module, "table_of", counted)
    found = read_all(tables, _NAMES)
    assert asked == tables
    one, two = (found[path][0] for path in tables)
    assert one.disturbance is None
    assert two.disturbance is not None


def test_the_belt_speed_of_a_table(tables: list[Path]) -> None:
    columns = {"time": "t", "position": "x"}
    (plain,) = read_records(tables[0], columns)
    assert not plain.belt_velocity.any()
    (moved,) = read_records(tables[0], columns, belt_speed=0.04)
    assert set(moved.belt_velocity) == {0.04}


def test_a_part_that_is_not_there_is_refused(tables: list[Path]) -> None:
    columns = {"time": "t", "position": "x"}
    with pytest.raises(InvalidInputError, match=r"no samples from 5 s on: it lasts 0\.699 s"):
        read_records(tables[0], columns, start=5.0)
    with pytest.raises(InvalidInputError, match="no samples from 5 s to 6 s: it lasts"):
        read_records(tables[0], columns, start=5.0, end=6.0)


def test_forces_of_a_bag_are_those_that_the_actuator_applies(tmp_path: Path) -> None:
    """Limited to 2 N, rounded to 0.5 N and lagging by a sampling period."""
    start, period = 10**9, 1_000_000
    messages: list[tuple[str, int, bytes]] = []
    for number in range(600):
        stamp = start + number * period
        state = pack_joint_state(stamp, (1e-6 * number, 0.0), (0.0, 0.0), (0.0, 0.0))
        messages.append((STATES, stamp, state))
        force = {0: 0.9, 300: 5.0}.get(number)
        if force is not None:
            messages.append((FORCES, stamp, pack_wrench(stamp, force)))
    at = start + 100 * period
    messages.append(("/feed_drive/applied_disturbance", at, pack_wrench(at, 7.0)))
    messages.append(("/feed_drive/reference", start, pack_reference(start, Reference(0.25, None))))
    actuator = {"limit": "2.0", "resolution": "0.5", "time_constant": "0.001"}
    plant = {f"actuator.{name}": value for name, value in actuator.items()}
    plant["force_delay"] = "0.002"
    write_bag(tmp_path / "bag", messages, tables={"stickslip_ros/plant": plant})
    (record,) = read_records(tmp_path / "bag", {})
    assert record.delay == 0.002
    held = np.where(np.arange(600) < 300, 1.0, 2.0)
    settled = np.abs(np.arange(600) % 300) > 40
    assert record.force[settled] == pytest.approx(held[settled], rel=1e-12)
    # The mean over a period of a lag of one period, from rest: 1 - (1 - exp(-1)).
    assert record.force[[0, 300]] == pytest.approx([np.exp(-1.0), 1.0 + np.exp(-1.0)])
    assert record.disturbance.tolist() == [0.0] * 100 + [7.0] * 500
    assert set(record.reference) == {0.25}


def test_a_bag_without_a_motion_is_refused(tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", [(FORCES, 1, pack_wrench(1, 0.0))])
    with pytest.raises(BagError, match="holds no joint states"):
        read_records(tmp_path / "bag", {})
