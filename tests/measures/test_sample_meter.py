from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.measures.run_meter import RunMeter
from stickslip_ros.measures.run_report import report_of
from stickslip_ros.measures.sample_assumptions import EXACT, SampleAssumptions, reading_of
from stickslip_ros.measures.sample_meter import SampleMeter
from stickslip_ros.motion.motion import Motion
from stickslip_ros.samples import SampleColumns
from tests.drives import LIMIT_CYCLES, PAPER
from tests.examples import examples
from tests.measures.records import columns, fed, feed

SECOND = 10**9


def later(samples: SampleColumns, nanoseconds: int) -> SampleColumns:
    return replace(samples, stamp=samples.stamp + nanoseconds)


@cache
def limit_cycle(belt_speed: float = 0.2) -> SampleColumns:
    """The paper's drive at 100 Hz from 1 s on, on its limit cycle."""
    drive = replace(PAPER, belt_speed=belt_speed)
    motion = Motion(drive, 0.0, 0.0)
    motion.advance(1000.0)
    rows = [(motion.position, motion.velocity)]
    for _ in range(7000):
        motion.advance(0.01)
        rows.append((motion.position, motion.velocity))
    position, velocity = np.array(rows).T
    return columns(stamps(100, len(rows)), position, velocity, np.full(len(rows), belt_speed))


def stamps(rate: int, count: int, start: int = SECOND) -> npt.NDArray[np.int64]:
    return np.array([start + (n * SECOND + rate // 2) // rate for n in range(count)])


def still(stamp: npt.NDArray[np.int64]) -> SampleColumns:
    """A slide that rests while the belt moves, at those stamps."""
    rest = np.zeros(len(stamp))
    return columns(stamp, rest, rest, rest + 1.0)


def test_measures_of_a_limit_cycle() -> None:
    meter = SampleMeter(window=20)
    cycles = meter.feed(limit_cycle())
    measures = meter.measures()
    twice = fed(limit_cycle()[np.arange(14_002) // 2])  # of each sample
    assert (twice.measures(), twice.samples) == (measures, meter.samples)
    (expected,) = (cycle for cycle in LIMIT_CYCLES if cycle.belt_speed == 0.2)
    assert len(cycles) == measures.cycles == 9  # of 7.07 s in 70 s
    assert measures.regime is Regime.STICK_SLIP
    assert measures.amplitude == pytest.approx(expected.amplitude, rel=1e-8)
    assert measures.velocity_amplitude == pytest.approx(expected.velocity_amplitude, rel=1e-8)
    assert measures.midpoint == pytest.approx(expected.midpoint, rel=1e-8)
    assert measures.period == pytest.approx(expected.period, rel=1e-8)
    assert measures.stick_fraction == pytest.approx(expected.stick_fraction, abs=1e-5)
    assert meter.samples == 7001
    assert meter.lost_samples == 0
    assert meter.duration == pytest.approx(70.0, rel=1e-15)


@pytest.mark.parametrize("apart", [5, 10, 20])
@pytest.mark.parametrize("belt_speed", [0.2, 0.3, 0.4])
def test_the_error_of_a_stick_is_more_than_its_scatter_from_cycle_to_cycle(
    belt_speed: float, apart: int
) -> None:
    meter = SampleMeter(window=20)
    meter.feed(limit_cycle(belt_speed)[::apart])
    measures = meter.measures()
    (expected,) = (cycle for cycle in LIMIT_CYCLES if cycle.belt_speed == belt_speed)
    assert measures.stick_fraction is not None
    assert measures.errors is not None
    error = abs(measures.stick_fraction - expected.stick_fraction)
    assert error < 1.96 * measures.errors["stick_fraction"] < 0.06 * apart * 0.01 / expected.period


# 3, 7 and 30 Hz have periods that are no whole number of nanoseconds.
rates = st.sampled_from([3, 7, 30, 100, 1000, 100_000])


@given(rates, st.sets(st.integers(2, 198)), st.lists(st.integers(2, 200), max_size=5).map(sorted))
def test_what_is_lost_is_counted_exactly(rate: int, lost: set[int], starts: list[int]) -> None:
    """From the stamps alone; the first two samples came, so that the period is known."""
    kept = np.array([n for n in range(200) if n not in lost])
    samples = still(stamps(rate, 200))[kept]
    meter = SampleMeter(window=20)
    for start, end in zip([0, *starts], [*starts, 200], strict=True):
        meter.feed(samples[(kept >= start) & (kept < end)])
    assert meter.samples == len(kept)
    assert meter.lost_samples == len(lost)


def pause(seconds: float, rate: int = 1000, before: int = 1000) -> list[npt.NDArray[np.int64]]:
    """Return the stamps of two parts of a run at two rates, with a pause between."""
    first = stamps(before, 500)
    return [first, stamps(rate, 500, start=int(first[-1]) + round(seconds * SECOND))]


SLOW = stamps(100, 100)
RISES = stamps(1000, 1100, start=int(SLOW[-1]) + 1_000_000)
LATE = 4_162_345_678 + 1_000_000 * np.arange(100)


@pytest.mark.parametrize(
    ("blocks", "lost"),
    [
        ([stamps(1000, 10)[[0, 2]], stamps(1000, 10)[3:6]], 1),
        ([np.append(0, LATE)], 0),
        ([np.zeros(1, np.int64), *LATE[:, np.newaxis]], 0),
        ([np.append(stamps(1000, 1), stamps(1000, 200)[100:])], 99),
        ([np.concatenate([SLOW, RISES[:1000]]), RISES[1005:]], 5),
        ([np.concatenate(pause(1.2345678, 1000, 100))], 0),
        (pause(1.2345678, 100, 1000), 0),
        (pause(1.2345678, 150, 100), 0),
        *((pause(1e-3 + gap), 0) for gap in (1.2345678, 60.00004, 700.0005, 86400.0003)),
    ],
)
def test_what_is_lost_is_what_is_missing_on_the_grid(
    blocks: list[npt.NDArray[np.int64]], lost: int
) -> None:
    """A pause in real time is no whole number of periods, and no loss."""
    meter = SampleMeter(window=20)
    for block in blocks:
        meter.feed(still(block))
    assert meter.samples == sum(map(len, blocks))
    assert meter.lost_samples == lost


def test_measures_bridge_what_was_lost() -> None:
    samples = limit_cycle()
    kept = np.random.default_rng(1).random(len(samples.stamp)) > 0.1
    kept[:2] = True
    whole, holed = fed(samples), fed(samples[kept])
    assert holed.lost_samples == np.count_nonzero(~kept[: np.flatnonzero(kept)[-1]])
    expected, measures = whole.measures(), holed.measures()
    assert measures.cycles == expected.cycles
    assert measures.amplitude == pytest.approx(expected.amplitude, rel=1e-6)
    assert measures.period == pytest.approx(expected.period, rel=1e-6)
    assert measures.stick_fraction == pytest.approx(expected.stick_fraction, abs=1e-3)


@pytest.mark.parametrize(("late", "lost"), [(0.0, 300), (0.2, 0)])
def test_no_cycle_spans_a_long_gap(late: float, lost: int) -> None:
    """On no grid it starts a new segment."""
    samples = read_late(limit_cycle(), late)
    meter = fed(samples[:3000])
    cycles = meter.feed(samples[3300:7001])
    assert meter.lost_samples == lost
    assert meter.duration == pytest.approx(67.0, abs=0.1)
    assert [cycle.period for cycle in cycles] == pytest.approx(
        [7.06772953] * len(cycles), rel=1e-3 if late else 1e-6
    )


@pytest.mark.parametrize("blocks", [1, 2])
def test_stamps_that_go_back_start_a_new_segment(blocks: int) -> None:
    samples = limit_cycle()
    twice = samples[:5000].followed_by(samples[1000:6000])
    meter = SampleMeter(window=20)
    cycles = feed(meter, twice, [5000] if blocks == 2 else [])
    assert meter.samples == 10_000
    assert meter.lost_samples == 0
    assert [cycle.period for cycle in cycles] == pytest.approx([7.06772953] * len(cycles), rel=1e-6)
    assert len(cycles) >= 10


@pytest.mark.filterwarnings("error", "ignore::ResourceWarning")
@pytest.mark.parametrize("column", ["position", "velocity", "belt_velocity"])
def test_rows_that_are_not_finite_or_too_large_are_lost(column: str) -> None:
    samples = limit_cycle()
    values = getattr(samples, column).copy()
    values[[10, 500, 501, 3000]] = [np.nan, np.inf, -1e308, 1.1e100]
    meter = SampleMeter(window=20)
    cycles = meter.feed(replace(samples, **{column: values}))
    assert meter.samples == 6997
    assert meter.lost_samples == 4
    assert len(cycles) == 9
    assert np.isfinite([list(vars(cycle).values()) for cycle in cycles]).all()


@pytest.mark.parametrize(("speed", "regime"), [(999.0, None), (1001.0, Regime.UNBOUNDED)])
def test_a_thousand_belt_speeds_are_running_away(speed: float, regime: Regime | None) -> None:
    samples = replace(still(stamps(100, 3)), velocity=np.array([0.0, -speed, speed]))
    meter = fed(samples)
    assert meter.measures().regime is regime


def test_a_plant_that_has_ended_a_diverging_motion_is_told_on_a_fast_belt_too() -> None:
    """On a belt of 5 m/s a thousand belt speeds are more than the plant lets the slide reach."""
    drive = {"mass": 100.0, "stiffness": 1e6, "normal_force": 1000.0}  # 0.1 m/s is its scale
    velocity = np.concatenate([np.zeros(20), np.geomspace(0.1, 100.0, 10)])
    samples = replace(still(stamps(100, 30)), velocity=velocity, belt_velocity=np.full(30, 5.0))
    meter = SampleMeter(window=20, reading=reading_of(drive))
    meter.feed(samples)
    assert meter.measures().regime is Regime.UNBOUNDED
    assert fed(samples).measures().regime is not Regime.UNBOUNDED
    assert reading_of(drive | {"mass": -1.0}).unbounded_speed == float("inf")


def read_late(samples: SampleColumns, latest: float, seed: int = 1) -> SampleColumns:
    """With stamps of a clock that is read late, by the share `latest` of a period at most."""
    period = int(samples.stamp[1] - samples.stamp[0])
    late = np.random.default_rng(seed).random(len(samples.stamp)) * latest * period
    return replace(samples, stamp=samples.stamp + late.astype(np.int64))


@examples(quick=20, thorough=100)
@given(
    st.sampled_from([0.0, 2e-6, 1e-3, 0.2, 0.7]),
    st.integers(0, 100),
    st.lists(st.integers(1, 7000), max_size=5).map(sorted),
)
def test_even_and_jittered_stamps_are_measured(latest: float, seed: int, starts: list[int]) -> None:
    """However they are cut into blocks."""
    samples = read_late(limit_cycle(), latest, seed)
    whole, in_blocks = SampleMeter(window=20), SampleMeter(window=20)
    cycles = whole.feed(samples)
    measures, expected = whole.measures(), fed(limit_cycle()).measures()
    assert measures.cycles == expected.cycles
    assert measures.amplitude == pytest.approx(expected.amplitude, rel=1e-4)
    assert measures.velocity_amplitude == pytest.approx(expected.velocity_amplitude, rel=1e-4)
    assert measures.period == pytest.approx(expected.period, rel=1e-3)
    assert measures.stick_fraction == pytest.approx(expected.stick_fraction, abs=2e-3)
    same = feed(in_blocks, samples, starts)
    assert len(same) == len(cycles)
    # Time is counted from the start of a block; adding it up rounds. Whether a step that is off by
    # nearly the rounding of stamps is a whole period, and its peak exact, depends on the period so
    # far.
    error = 1e-5 if latest == 2e-6 else 1e-9
    for cycle, expected_cycle in zip(same, cycles, strict=True):
        assert vars(cycle) == pytest.approx(vars(expected_cycle), rel=error)
    assert in_blocks.samples == whole.samples
    assert in_blocks.lost_samples == whole.lost_samples
    assert in_blocks.duration == whole.duration


def test_a_short_gap_off_the_grid_is_bridged() -> None:
    """Afterwards the samples are on a grid again, with the peaks of the velocity between them."""
    samples = still(stamps(100, 7001))
    samples.stamp[3000:] += 34_000_000
    time = samples.stamp * 1e-9
    meter = fed(replace(samples, position=np.sin(time), velocity=np.cos(time)))
    measures = meter.measures()
    assert meter.lost_samples == 3
    assert measures.cycles == 10
    assert measures.velocity_amplitude == pytest.approx(1.0, rel=1e-9)


@given(st.sets(st.integers(50, 198)), st.integers(0, 100))
def test_what_is_lost_of_jittered_samples_is_counted(lost: set[int], seed: int) -> None:
    lost = {number for number in lost if number % 10}  # never over the longest gap
    kept = np.array([number for number in range(200) if number not in lost])
    meter = fed(read_late(still(stamps(1000, 200)), 0.2, seed)[kept])
    assert meter.samples == len(kept)
    assert meter.lost_samples == len(lost)


def test_many_samples_off_every_grid_take_no_longer_than_on_one() -> None:
    """With time that grew as the square of their number this would take minutes."""
    time = 1e-3 * np.arange(200_000)
    samples = columns(stamps(1000, len(time)), np.sin(time), np.cos(time), np.full(len(time), 2.0))
    meter = fed(read_late(samples, 0.2))
    assert meter.lost_samples == 0
    assert meter.measures().cycles == 20


def test_many_segments_in_one_block_take_time_in_proportion() -> None:
    """Each looks only a little ahead: seen from every one to the end it would be 4e8 steps."""
    meter = fed(still(SECOND - np.arange(20_000)))
    assert meter.samples == 20_000
    assert meter.lost_samples == 0
    assert meter.duration == 0.0


@pytest.mark.parametrize(
    ("number", "wild"), [(0, 0), (1, (2**31 - 1) * SECOND), (3000, 0), (7000, (2**31 - 1) * SECOND)]
)
def test_a_stamp_of_another_time_is_no_loss(number: int, wild: int) -> None:
    samples = later(limit_cycle(), 1_700_000_000 * SECOND)
    samples.stamp[number] = wild
    meter = fed(samples)
    assert meter.samples == 7001
    assert meter.lost_samples == 0
    assert meter.duration == pytest.approx(70.0, abs=0.03)
    assert meter.measures().cycles >= 8


def test_a_leap_onto_the_belt_hides_no_extremes() -> None:
    samples = replace(
        still(stamps(10, 4)),
        position=np.array([0.0, -0.1, 0.2, 0.22]),
        velocity=np.array([-1.0, -1.0, 0.2, 0.2]),
        belt_velocity=np.full(4, 0.2),
    )
    meter = SampleMeter(window=20)
    cycles = feed(meter, samples.followed_by(later(samples, 400_000_000)), [4])
    assert [cycle.amplitude for cycle in cycles] == pytest.approx([0.16], rel=1e-3)


@pytest.mark.filterwarnings("error", "ignore::ResourceWarning")
@given(
    st.lists(
        st.tuples(
            st.one_of(st.integers(0, 10**12), st.integers(-(2**61), 2**61)),
            st.floats(),
            st.floats(),
            st.floats(),
        ),
        max_size=60,
    ),
    st.integers(1, 60),
)
def test_no_samples_are_an_error(rows: list[tuple[int, float, float, float]], size: int) -> None:
    meter = SampleMeter(window=20)
    for first in range(0, len(rows), size):
        stamp, *values = zip(*rows[first : first + size], strict=True)
        meter.feed(columns(np.array(stamp), *map(np.array, values)))
    measured = meter.measures().as_dict().values()
    assert np.isfinite([figure for figure in measured if isinstance(figure, float)]).all()


@pytest.mark.parametrize("size", [1, 1900])
@pytest.mark.parametrize(("shift", "strays"), [(-SECOND // 2, 1), (SECOND // 300, 2)])
def test_the_motion_of_two_plants_on_one_topic_is_not_known(
    size: int, shift: int, strays: int
) -> None:
    """Their stamps go back, or come in order where both plants are in time."""
    one = limit_cycle()[: 200 if size == 1 else 1000]
    both = one.followed_by(later(one, shift))
    both = both[np.arange(2 * len(one)).reshape(2, -1).T.ravel()]
    meter = RunMeter(window=20, reading=EXACT._replace(period=1e7))
    for first in range(0, len(both), size):
        meter.motion.feed(both[first : first + size])
    report = report_of(meter)
    unknown = ("regime", "amplitude", "period", "lost_samples", "duration", "steady")
    assert {name: report[name] for name in unknown} == dict.fromkeys(unknown)
    (note,) = report["notes"]
    number = strays * len(one) - (strays == 2)
    assert f"{number} of {2 * len(one)} samples are not whole periods after" in note
    assert "several plants publish on one topic" in note


def test_a_plant_that_is_restarted_nine_times_is_measured() -> None:
    one = limit_cycle()
    meter = fed(one.followed_by(*[one] * 9), EXACT._replace(period=1e7))
    assert meter.measures().regime is Regime.STICK_SLIP
    assert not meter.mixed


@pytest.mark.parametrize("stick_speed", [-1e-9, np.inf, np.nan])
def test_a_stick_speed_that_is_none_is_refused(stick_speed: float) -> None:
    with pytest.raises(InvalidInputError, match=r"stick_speed = .* must be finite"):
        SampleMeter(20, reading=SampleAssumptions(stick_speed))
