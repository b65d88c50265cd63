from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from math import nan, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.arrays import FloatArray
from stickslip_ros.measures.breakpoints import Breakpoints
from stickslip_ros.measures.cycle_measures import Cycle, Measures, Regime, Trend
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.model.drive import Drive
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.quantities import quantities_of
from tests.drives import PAPER
from tests.examples import examples

ABOVE_HOPF = replace(PAPER, belt_speed=0.6)
OVERDAMPED = replace(PAPER, damping=3.0)
AT_REST = replace(PAPER, belt_speed=0.0)


def vibration(cycles: float, speed: float = 1.0, centre: float = 0.0) -> Breakpoints:
    """Breakpoints of x = centre - speed cos t, from the lowest point on, a quarter cycle apart."""
    quarters = np.arange(round(4 * cycles) + 1)
    velocity = speed * np.array([0.0, 1.0, 0.0, -1.0])[quarters % 4]
    position = centre - speed * np.array([1.0, 0.0, -1.0, 0.0])[quarters % 4]
    return Breakpoints(quarters * pi / 2.0, position, velocity, np.zeros(len(quarters), dtype=bool))


@cache
def recorded(drive: Drive, position: float, velocity: float, duration: float) -> Breakpoints:
    """Breakpoints at every 0.1 s as well, as a loop that is sampled has them."""
    motion = RecordedMotion(drive, position, velocity)
    for _ in range(round(duration / 0.1)):
        motion.advance(0.1)
    return motion.take_breakpoints()


def measured(breakpoints: Breakpoints, belt_speed: float, window: int = 20) -> Measures:
    meter = CycleMeter(window)
    for block in blocks(breakpoints, range(50, len(breakpoints), 50)):
        meter.feed(block, belt_speed)
    return meter.measures()


def blocks(breakpoints: Breakpoints, starts: range | list[int]) -> Iterator[Breakpoints]:
    for start, end in zip([0, *starts], [*starts, len(breakpoints)], strict=True):
        yield breakpoints[start:end]


def test_cycles_of_a_vibration() -> None:
    meter = CycleMeter(window=20)
    # The first cycle starts at the first crossing, which is at the second trough.
    breakpoints = vibration(3.25, speed=0.5, centre=2.0)
    assert meter.feed(Breakpoints.empty(), 1.0) == []
    (first, second) = meter.feed(breakpoints, belt_speed=1.0)
    expected = Cycle(0.5, 0.5, 2.0, 2 * pi, 1 / (2 * pi), 0.0)
    for cycle in (first, second):
        assert vars(cycle) == pytest.approx(vars(expected), rel=1e-12)
    measures = meter.measures()
    assert measures.cycles == 2
    assert measures.regime is Regime.PURE_SLIP
    assert measures.period == pytest.approx(2 * pi, rel=1e-12)
    breakpoints.sticking[[5, 6, 9]] = True  # two quarters of the first cycle, one of the second
    found = CycleMeter(window=20).feed(breakpoints, belt_speed=1.0)
    assert [cycle.stick_fraction for cycle in found] == pytest.approx([0.5, 0.25])


def test_measures_are_means_over_the_last_cycles_of_the_window() -> None:
    breakpoints = recorded(PAPER, 0.0, 0.0, 60.0)
    meter = CycleMeter(window=3)
    cycles = meter.feed(breakpoints, 0.4)
    measures = meter.measures()
    assert len(cycles) > 6
    assert measures.cycles == 3
    for name in vars(cycles[0]):
        mean = np.mean([getattr(cycle, name) for cycle in cycles[-3:]])
        assert getattr(measures, name) == pytest.approx(mean, rel=1e-12)
    assert measures.stick_fraction > 0.0
    assert measures.regime is Regime.STICK_SLIP


def test_the_error_of_a_mean_follows_from_the_scatter_of_the_cycles() -> None:
    meter = CycleMeter(window=4)
    cycles = meter.feed(recorded(ABOVE_HOPF, 0.1, 0.0, 60.0), 0.6)  # they decay
    errors = meter.measures().errors
    assert errors is not None
    for name in ("amplitude", "midpoint"):
        scatter = np.std([getattr(cycle, name) for cycle in cycles[-4:]], ddof=1)
        assert scatter > 1e-5
        assert errors[name] == pytest.approx(scatter / 2.0, rel=1e-9)


@pytest.mark.parametrize(
    ("speed", "regime"), [(0.9e-3, Regime.EQUILIBRIUM), (1.1e-3, Regime.PURE_SLIP)]
)
@pytest.mark.parametrize("belt_speed", [1.0, -1.0])
def test_less_than_a_thousandth_of_the_belt_speed_is_equilibrium(
    speed: float, regime: Regime, belt_speed: float
) -> None:
    measures = measured(vibration(5.25, speed), belt_speed)
    assert measures.regime is regime
    assert measures.amplitude == pytest.approx(speed)
    assert measures.cycles == 4
    assert (measures.period is None) == (regime is Regime.EQUILIBRIUM)
    assert (measures.frequency is None) == (regime is Regime.EQUILIBRIUM)


def check_equilibrium(measures: Measures, position: float) -> None:
    assert measures.regime is Regime.EQUILIBRIUM
    assert measures.period is None
    assert measures.frequency is None
    assert measures.stick_fraction == 0.0
    assert measures.midpoint == pytest.approx(position, abs=1e-3)
    assert measures.amplitude < 1e-3


@pytest.mark.parametrize(
    ("drive", "duration", "position"), [(ABOVE_HOPF, 200.0, 0.2596), (OVERDAMPED, 60.0, 0.2584)]
)
def test_a_motion_that_dies_out_or_never_turns_ends_in_equilibrium(
    drive: Drive, duration: float, position: float
) -> None:
    """Where the friction is mu(-v) = 0.4 - 0.45 v + 0.6 v^3 for v = 0.6 and v = 0.4."""
    check_equilibrium(measured(recorded(drive, 0.0, 0.0, duration), drive.belt_speed), position)


def test_cycles_of_long_ago_do_not_count() -> None:
    """Ten periods ago it cycled; since then, strongly damped, it never turned."""
    motion = RecordedMotion(PAPER, 0.0, 0.0)
    meter = CycleMeter(window=20)
    motion.advance(60.0)
    meter.feed(motion.take_breakpoints(), 0.4)
    assert meter.measures().regime is Regime.STICK_SLIP
    motion.drive = OVERDAMPED
    for _ in range(60):
        motion.advance(1.0)
    meter.feed(motion.take_breakpoints(), 0.4)
    check_equilibrium(meter.measures(), 0.2584)


def test_sticking_now_and_then_on_a_belt_at_rest_is_not_stuck() -> None:
    """A force that alternates between 1 and -1 moves the slide at each turn, then it sticks."""
    motion = RecordedMotion(AT_REST, 0.0, 0.0)
    meter = CycleMeter(window=3)
    for number in range(20):
        motion.force = (-1.0) ** number
        motion.advance(12.0)
        meter.feed(motion.take_breakpoints(), 0.0)
    assert motion.sticking
    measures = meter.measures()
    assert measures.regime is Regime.STICK_SLIP
    assert measures.period == pytest.approx(24.0, rel=1e-6)
    assert 0.2 < measures.stick_fraction < 0.8


def test_a_slide_that_creeps_on_a_guide_at_rest_is_not_stuck_while_it_rests() -> None:
    """It rests for 1 s before each slip of 0.1 s, and then for good."""
    time = np.cumsum([0.0, *[1.0, 0.05, 0.05] * 6, 0.7, 0.5])
    slipping = np.array([False, *[False, True, True] * 6, False, False])
    velocity = np.where(np.roll(slipping, -1) & slipping, 0.02, 0.0)
    creeping = Breakpoints(time, np.cumsum(0.0005 * slipping), velocity, ~slipping)
    assert measured(creeping[:-1], belt_speed=0.0).regime is None
    assert measured(creeping, belt_speed=0.0).regime is Regime.STUCK


@pytest.mark.parametrize("duration", [0.1, 3.0, 9.0])
def test_too_short_a_motion_has_no_cycle_and_no_regime(duration: float) -> None:
    measures = measured(recorded(PAPER, 0.0, 0.0, duration), 0.4)
    assert measures == Measures(None, None, None, None, None, None, 0, None)


MOTIONS = {
    "stick-slip": (PAPER, 0.0, 0.0, 60.0),
    "towards equilibrium": (ABOVE_HOPF, 0.0, 0.0, 60.0),
    "overdamped": (OVERDAMPED, 0.0, 0.0, 60.0),
    "stuck": (AT_REST, 3.0, 0.0, 60.0),
    "too short": (PAPER, 0.0, 0.0, 9.0),
}


def fed(
    breakpoints: Breakpoints, belt_speed: float, starts: range | list[int]
) -> tuple[list[Cycle], Measures]:
    meter = CycleMeter(window=20)
    cycles = [
        cycle for block in blocks(breakpoints, starts) for cycle in meter.feed(block, belt_speed)
    ]
    return cycles, meter.measures()


@cache
def fed_one_by_one(*motion: Any) -> tuple[list[Cycle], Measures]:
    breakpoints = recorded(*motion)
    return fed(breakpoints, motion[0].belt_speed, range(1, len(breakpoints)))


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
@given(data=st.data())
@examples(quick=10, thorough=30)
def test_the_size_of_the_blocks_does_not_matter(
    motion: tuple[Drive, float, float, float], data: st.DataObject
) -> None:
    breakpoints = recorded(*motion)
    starts = data.draw(st.lists(st.integers(0, len(breakpoints)), max_size=20).map(sorted))
    cycles, measures = fed(breakpoints, motion[0].belt_speed, starts)
    expected_cycles, expected = fed_one_by_one(*motion)
    assert len(cycles) == len(expected_cycles)
    assert measures.regime is expected.regime
    # Summing the stick time in other portions rounds otherwise.
    for found, wanted in zip([*cycles, measures], [*expected_cycles, expected], strict=True):
        assert figures(found) == pytest.approx(figures(wanted), rel=1e-12, abs=1e-15, nan_ok=True)


def figures(measures: Cycle | Measures) -> list[float]:
    values = [getattr(measures, name) for name in quantities_of(Cycle)]
    return [nan if value is None else value for value in values]


def course(*amplitudes: float) -> Breakpoints:
    """Breakpoints of a vibration whose whole cycles have these amplitudes."""
    breakpoints = vibration(len(amplitudes) + 1.25)
    # From trough to trough: the one that begins a cycle and the one that ends it are as deep.
    sizes = np.concatenate([np.repeat([amplitudes[0], *amplitudes], 4), [amplitudes[-1]] * 2])
    sizes = sizes[: len(breakpoints)]
    position, velocity = breakpoints.position * sizes, breakpoints.velocity * sizes
    return replace(breakpoints, position=position, velocity=velocity)


def _changing(change: float, ratio: float) -> FloatArray:
    """Return amplitudes: the first difference is `change`, each next one in a ratio to it."""
    return 1.0 + change * np.cumsum(ratio ** np.arange(7))


@pytest.mark.parametrize(
    ("amplitudes", "steady", "trend"),
    [
        ([1.0, 1.0], None, None),
        ([1.0, 1.0, 1.0], True, None),
        ([1.0, 1.0004, 1.0, 1.0004], True, None),
        ([1.0, 0.8, 0.6, 0.4], False, Trend.DECAYING),
        ([0.4, 0.6, 0.8], False, Trend.GROWING),
        ([1.0, 0.8, 1.0, 0.8, 1.0], False, Trend.VARYING),
        (_changing(-1e-4, 0.98), False, Trend.DECAYING),
        (_changing(-1e-4, 1.02), False, Trend.DECAYING),
        (_changing(-1e-4, 0.8), True, None),
        (_changing(-1e-4, -0.98), True, None),
        (1.0 + 2e-4 * np.sin(0.1 * np.arange(8)), True, None),
    ],
)
def test_a_motion_is_steady_while_its_amplitude_stays(
    amplitudes: Sequence[float], steady: bool | None, trend: Trend | None
) -> None:
    measures = measured(course(*amplitudes), 1.0)
    assert measures.regime is Regime.PURE_SLIP
    assert (measures.steady, measures.trend) == (steady, trend)


def test_only_growth_from_cycle_to_cycle_disturbs_a_rest() -> None:
    noise = measured(course(1e-6, 3e-6, 2e-6, 5e-6, 4e-6), 1.0)
    assert (noise.regime, noise.steady) == (Regime.EQUILIBRIUM, True)
    leaving = measured(course(1e-6, 2e-6, 4e-6, 8e-6), 1.0)
    assert (leaving.regime, leaving.trend) == (Regime.EQUILIBRIUM, Trend.GROWING)


def test_a_rest_is_steady_once_it_has_lasted_for_a_window() -> None:
    swinging = vibration(4.25)
    for rest, steady in ((4.0, None), (21.0, True)):
        end = float(swinging.time[-1])
        time = end + np.linspace(0.0, rest * 2.0 * pi, 200)[1:]
        still = Breakpoints(time, np.zeros(199), np.full(199, 1e-15), np.zeros(199, dtype=bool))
        meter = CycleMeter(window=20)
        meter.feed(swinging, 1.0)
        meter.feed(still, 1.0)
        assert meter.measures().regime is Regime.EQUILIBRIUM
        assert meter.measures().steady is steady


def test_a_cycle_that_only_touches_the_belts_speed_slips_all_the_time() -> None:
    for stick, regime in ((1e-9, Regime.PURE_SLIP), (1e-7, Regime.STICK_SLIP)):
        breakpoints = vibration(5.25)
        touching = breakpoints.velocity == 1.0
        behind = Breakpoints(
            breakpoints.time[touching] + stick * 2.0 * pi,
            breakpoints.position[touching],
            breakpoints.velocity[touching],
            np.ones(int(touching.sum()), dtype=bool),
        )
        joined = breakpoints.followed_by(behind)
        measures = measured(joined[np.argsort(joined.time, kind="stable")], 1.0)
        assert measures.regime is regime
        assert measures.stick_fraction == pytest.approx(stick if stick > 1e-8 else 0.0, rel=1e-6)


def test_a_slide_riding_a_slow_belt_is_not_at_rest() -> None:
    riding = Breakpoints(
        np.linspace(0.0, 5.0, 50),
        np.linspace(0.0, 0.5, 50),
        np.full(50, 0.1),
        np.ones(50, dtype=bool),
    )
    assert measured(riding, 0.1).regime is None
