"""The frames that the page draws."""

import json
import struct
from typing import Any, NamedTuple

import numpy as np
import pytest

from stickslip_ros.app.dashboard.frames import PERIODS, Frames
from stickslip_ros.app.dashboard.run_state import RunState
from stickslip_ros.record.topics import AMPLITUDE, FREQUENCY, STICK_FRACTION
from stickslip_ros.samples import ForceColumns, SampleColumns
from stickslip_ros.scenarios.files import load_scenario


class Decoded(NamedTuple):
    body: dict[str, Any]
    lines: dict[str, tuple[np.ndarray, np.ndarray]]


def decoded(frame: bytes) -> Decoded:
    """Read a frame as the page does; fail if a byte is left."""
    (size,) = struct.unpack_from("<I", frame)
    assert size % 4 == 0
    body = json.loads(frame[4 : 4 + size])
    floats = np.frombuffer(frame, "<f4", offset=4 + size)
    lines = {}
    for name, count in (body["motion"] or {"counts": {}})["counts"].items():
        lines[name] = floats[:count], floats[count : 2 * count]
        floats = floats[2 * count :]
    assert not len(floats)
    return Decoded(body, lines)


def observed(parameters: dict[str, Any]) -> RunState:
    run = RunState("/test")
    run.parameters = {**run.parameters, "plant": parameters}
    for topic, value in ((AMPLITUDE, 4e-4), (STICK_FRACTION, 0.1), (FREQUENCY, 8.0)):
        run.take_cycle(topic, value)
    return run


def fed(parameters: dict[str, Any], seconds: float, rate: float) -> Frames:
    frames = Frames(observed(parameters))
    time = np.arange(round(seconds * rate)) / rate
    stamp = 1_000_000_000 + np.rint(time * 1e9).astype(np.int64)
    x = 4e-4 * np.sin(100.0 * time)
    belt = np.full_like(x, 0.04)
    states = SampleColumns(stamp, x, 100.0 * x, x, belt, belt)
    none = ForceColumns(stamp[:0], x[:0])
    frames.feed(states, ForceColumns(stamp, 1e5 * x), none)
    return frames


def test_before_the_first_sample_there_are_only_cycles() -> None:
    body, lines = decoded(Frames(observed({})).frame(50))
    assert body["motion"] is None
    assert not lines
    assert body["cycles"]["count"] == 1


@pytest.mark.parametrize(
    ("scenario", "units", "scales"),
    [
        ("feed_drive", ["µm", "mm/s", "N", "s"], (1e6, 1e3, 1.0)),
        ("paper", ["dimensionless"] * 4, (1.0, 1.0, 1.0)),
    ],
)
def test_values_are_in_the_units_of_their_axes(
    scenario: str, units: list[str], scales: tuple[float, float, float]
) -> None:
    plant = load_scenario(scenario).plant
    body, lines = decoded(fed(plant.flat(), 5.0, 1000.0).frame(50))
    motion, drive = body["motion"], plant.as_drive()
    length, speed, force = scales
    names = "displacement", "velocity", "control force", "time before now"
    labels = [f"{name} ({unit})" for name, unit in zip(names, units, strict=True)]
    assert [*motion["labels"], motion["time_label"]] == labels
    assert body["cycles"]["label"] == f"amplitude ({units[0]})"
    assert body["cycles"]["amplitude"] == [pytest.approx(4e-4 * length)]
    assert motion["window"] == pytest.approx(50.0 * drive.natural_period)
    assert motion["equilibrium"] == pytest.approx(drive.equilibrium_position * length)
    assert motion["belt_speed"] == pytest.approx(0.04 * speed)
    for name, largest in (
        ("position", 4e-4 * length),
        ("velocity", 4e-2 * speed),
        ("force", 40.0 * force),
        ("orbit", 4e-2 * speed),
    ):
        assert lines[name][1].max() == pytest.approx(largest, rel=1e-2), name
    time = lines["position"][0]
    assert time[-1] == 0.0
    assert time.min() >= -motion["window"]


def test_a_drive_that_is_not_known_is_shown_by_its_own_frequency() -> None:
    frames = fed({}, 80.0, 500.0)
    assert frames.table(10, 2.0).count("\n") == 627  # however fast the time of a run passes
    body, _ = decoded(frames.frame(PERIODS[0]))
    assert body["motion"]["window"] == pytest.approx(PERIODS[0] / 8.0)
    assert body["motion"]["equilibrium"] is None
    assert body["motion"]["labels"][0] == "displacement (m)"


def test_on_a_belt_at_rest_no_place_is_the_equilibrium() -> None:
    plant = load_scenario("feed_drive", ["plant.belt_speed=0"]).plant
    body, _ = decoded(fed(plant.flat(), 1.0, 1000.0).frame(PERIODS[0]))
    assert body["motion"]["equilibrium"] is None


def test_a_cycle_that_does_not_tell_its_stick_has_none() -> None:
    frames = fed({}, 5.0, 1000.0)
    frames._run.take_cycle(STICK_FRACTION, float("nan"))
    body, _ = decoded(frames.frame(PERIODS[0]))
    assert body["cycles"]["stick_fraction"] == [0.1, None]


def test_any_published_frequency_is_accepted() -> None:
    frames = fed({}, 5.0, 1000.0)
    for frequency in (0.0, 1e-300, 1e300, float("inf"), float("nan"), -1.0):
        frames._run.cycles[FREQUENCY].append(frequency)
        body, _ = decoded(frames.frame(PERIODS[0]))
        assert body["motion"]["window"] == PERIODS[0], frequency
