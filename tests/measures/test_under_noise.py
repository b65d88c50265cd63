"""The measures under noise, from samples as a sensor tells them.

benchmarks/measures_under_noise.json has 60 seeds for each case; here are five for a sixth of them.
"""

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import stickslip_ros as ss
from benchmarks import measures_under_noise as study
from stickslip_ros.measures import Measures, Regime
from stickslip_ros.measures.sample_assumptions import EXACT, UNKNOWN, SampleAssumptions
from stickslip_ros.measures.sample_meter import SampleMeter
from stickslip_ros.samples import SampleColumns
from tests.examples import examples
from tests.measures.records import columns, fed, feed, milliseconds

NOISY = SampleAssumptions(noisy=True)
COMMITTED = json.loads(
    (Path(study.__file__).parent / "measures_under_noise.json").read_text(encoding="utf-8")
)
SEEDS = 5


def samples(
    belt_speed: float = 0.04, count: int = 2000, noise: float = 0.0, seed: int = 0
) -> SampleColumns:
    """Return samples of feed_drive without control; the velocity is by difference under noise."""
    position, velocity, _ = study.motion(belt_speed)
    position, velocity = position[:count].copy(), velocity[:count].copy()
    if noise > 0.0:
        position += noise * np.random.default_rng(seed).standard_normal(count)
        velocity = None
    return columns(milliseconds(count), position, velocity, belt_speed)


def measured(samples: SampleColumns, reading: SampleAssumptions = NOISY) -> Measures:
    return fed(samples, reading).measures()


def test_what_the_study_has_found_is_as_good_as_it_is_to_be() -> None:
    assert min(case["seeds"] for case in COMMITTED["cases"]) == 60
    assert len(COMMITTED["cases"]) == len(study.CASES)
    assert study.shortfalls(COMMITTED) == []


def a_sixth_of_the_cases() -> list[study.Case]:
    """Each kind of noise and each belt speed once."""
    row = len(study.BELT_SPEEDS)
    return [case for i, case in enumerate(study.CASES) if (i + i // row) % row == 0]


@pytest.mark.long
@pytest.mark.parametrize("case", a_sixth_of_the_cases(), ids=str)
def test_a_part_of_the_study_agrees_with_it(case: study.Case) -> None:
    """The shares of so few seeds say little: of five intervals of 95 %, three must cover."""
    (row,) = study.study(SEEDS, workers=1, cases=[case])["cases"]
    (whole,) = (
        each
        for each in COMMITTED["cases"]
        if (each["belt_speed"], each["resolution"], each["velocity_noise"])
        == (case.belt_speed, case.resolution, case.velocity_noise)
    )
    assert row["regime_right"] == row["steady"] == 1.0
    assert row["changing"] == 0.0
    for name in study.MEASURES:
        assert row[name]["rms"] <= 2.5 * whole[name]["rms"] + 1e-9
        if case.resolution:
            assert row[name]["covered"] >= 0.6


@pytest.mark.long
def test_a_slide_that_nearly_reaches_the_belt_speed_does_not_stick() -> None:
    """Without noise, the error of the fit's form would tell a stick of a few microseconds."""
    found = [measured(samples(0.044, count)) for count in (1500, 1700, 2000)]
    assert [each.regime for each in found] == 3 * [Regime.PURE_SLIP]


@pytest.mark.long
@pytest.mark.parametrize("told", [0.0, 0.03])
def test_the_stick_of_a_steep_curve_is_within_its_error(told: float) -> None:
    """Six intervals of 95 %, of three encoders: four must cover."""
    assert study.sticking(0.3, 1.0, told, seeds=2)["covered"] >= 0.6


@examples(quick=3, thorough=10, deadline=None)
@given(st.lists(st.integers(1, 5999), max_size=6).map(sorted))
def test_blocks_of_any_length_give_the_same_where_the_motion_comes_to_rest(
    starts: list[int],
) -> None:
    record = samples(noise=1e-6, count=6000)
    decay = np.exp(-np.arange(6000) / 800.0)
    position = 4e-4 + decay * (record.position - 4e-4)
    position += 1e-6 * np.random.default_rng(4).standard_normal(6000)
    record = replace(record, position=position)
    meter, whole = SampleMeter(20, reading=NOISY), SampleMeter(20, reading=NOISY)
    assert feed(meter, record, starts) == whole.feed(record)
    assert meter.measures() == whole.measures()
    assert whole.measures().regime is Regime.EQUILIBRIUM


def test_one_step_from_each_sample_to_the_next_is_a_uniform_motion_and_no_noise() -> None:
    assert not fed(columns(milliseconds(600), 4e-5 * np.arange(600)), UNKNOWN).noisy


@pytest.mark.parametrize(("noise", "noisy"), [(0.0, False), (1e-8, True), (1e-6, True)])
def test_noise_of_which_nothing_is_told_is_found(noise: float, noisy: bool) -> None:
    meter = fed(samples(noise=noise), UNKNOWN)
    assert meter.noisy is noisy
    assert meter.position_noise == (pytest.approx(noise, rel=0.2) if noisy else None)
    measures = meter.measures()
    assert measures.regime is Regime.STICK_SLIP
    assert measures.stick_fraction == pytest.approx(0.10006, abs=1e-3)
    assert measures.period == pytest.approx(0.0639242, rel=1e-5)


def test_exact_samples_of_which_nothing_is_told_are_measured_as_exact_ones() -> None:
    assert measured(samples(), UNKNOWN) == measured(samples(), EXACT)


@pytest.mark.parametrize(("decay", "count"), [(2.0, 3000), (20.0, 200), (60.0, 501)])  # 1/s
def test_rounding_of_numbers_in_a_motion_that_dies_out_is_no_noise(
    decay: float, count: int
) -> None:
    """Down to the last digit of the resting position, as a controller leaves it."""
    time = np.arange(count) * 1e-3
    part = 1e-5 * np.exp(-decay * time)
    position, velocity = 4e-4 + part * np.sin(100.0 * time), 100.0 * part * np.cos(100.0 * time)
    record = columns(milliseconds(count), position, velocity)
    assert measured(record, UNKNOWN) == measured(record, EXACT)


@pytest.mark.parametrize(
    ("amplitude", "regime"), [(0.5e-3, Regime.EQUILIBRIUM), (2e-3, Regime.PURE_SLIP)]
)
def test_a_vibration_of_a_thousandth_of_the_belt_speed_is_none(
    amplitude: float, regime: Regime
) -> None:
    """The same limit as for exact samples."""
    time = np.arange(4000) * 1e-3
    noise = np.random.default_rng(0).standard_normal(4000)
    position = amplitude * 0.04 / 100.0 * np.sin(100.0 * time) + 1e-9 * noise
    found = measured(columns(milliseconds(4000), position, np.gradient(position, time)))
    assert found.regime is regime
    assert found.velocity_amplitude == pytest.approx(amplitude * 0.04, rel=0.02)
    assert (found.period is None) == (regime is Regime.EQUILIBRIUM)


def test_a_belt_that_moves_backward_gives_the_same() -> None:
    record = samples(noise=1e-6)
    measures = measured(columns(record.stamp, -record.position, -record.velocity, -0.04))
    assert measures.regime is Regime.STICK_SLIP
    assert measures.stick_fraction == pytest.approx(0.1001, abs=2e-3)
    assert measures.midpoint == pytest.approx(-326.3e-6, rel=1e-3)


@pytest.mark.parametrize(("told", "drift"), [(0.1, 0.0), (-0.03, 0.0), (0.0, 2e-4)])
def test_a_belt_speed_that_is_told_wrong_and_a_drift_leave_the_stick(
    told: float, drift: float
) -> None:
    """The stick has its own speed, in the scale of the positions: the note says where it differs.

    The drift, m/s, is found from the cycles, and taken out of them.
    """
    record = samples(noise=1e-6)
    record = replace(
        record,
        position=record.position + drift * np.arange(2000) * 1e-3,
        belt_velocity=(1.0 + told) * record.belt_velocity,
    )
    meter = fed(record, NOISY)
    found, notes, mean = meter.measured("rad")
    assert found.regime is Regime.STICK_SLIP
    assert found.stick_fraction == pytest.approx(
        0.10006, abs=3.0 * found.errors["stick_fraction"] + 1e-5
    )
    assert found.errors["stick_fraction"] < 0.005
    assert found.amplitude == pytest.approx(434.09e-6, rel=1e-3)
    stick = mean.stick
    assert stick.fit.belt_speed == pytest.approx(0.04, abs=4.0 * stick.speed_error)
    doubts = [note for note in notes if "the slide sticks at" in note]
    assert (len(doubts) == 1 and "rad/s" in doubts[0]) == (told != 0.0)
    assert (found.drift is not None) == (drift != 0.0)


@pytest.mark.parametrize("scale", [0.85, 1.13])
def test_no_stick_is_claimed_at_a_speed_far_from_that_of_the_belt(scale: float) -> None:
    record = samples(noise=1e-6)
    found = fed(replace(record, belt_velocity=scale * record.belt_velocity), NOISY).measures()
    assert (found.regime, found.stick_fraction) == (None, None)
    assert found.amplitude == pytest.approx(434.09e-6, rel=1e-3)


def test_friction_with_a_memory_sticks_below_the_stick_speed_under_noise_as_without() -> None:
    """An overshoot of 2 % of the belt speed is in the band of 1 % where it passes it."""
    time = np.arange(2000) * 1e-3
    position = 0.0408 / 100.0 * np.sin(100.0 * time)
    noise = 1e-7 * np.random.default_rng(0).standard_normal(2000)
    exact = columns(milliseconds(2000), position, 0.0408 * np.cos(100.0 * time))
    reading = SampleAssumptions(0.0004, noisy=True)
    found = measured(replace(exact, position=position + noise), reading)
    true = measured(exact, SampleAssumptions(0.0004))
    share = (np.arccos(0.99 / 1.02) - np.arccos(1.01 / 1.02)) / np.pi
    assert true.stick_fraction == pytest.approx(share, rel=0.02)
    assert found.stick_fraction == pytest.approx(share, rel=0.05)
    assert found.regime is true.regime is Regime.STICK_SLIP


@pytest.mark.parametrize("stick_speed", [0.0, 0.0004])
@pytest.mark.parametrize("growth", [0.0, 0.4], ids=["alike", "growing"])
@pytest.mark.parametrize("speed", [0.5, 0.97])
def test_no_stick_is_certain_only_where_the_slide_stays_far_below_the_belt(
    speed: float, growth: float, stick_speed: float
) -> None:
    """By its highest speed, in belt speeds; cycles that grow are measured one by one."""
    time = np.arange(2000) * 1e-3
    size = speed * 0.04 / 100.0 * (1.0 + growth * (time - 2.0))
    noise = 1e-7 * np.random.default_rng(0).standard_normal(2000)
    record = columns(milliseconds(2000), size * np.sin(100.0 * time) + noise)
    found = measured(record, SampleAssumptions(stick_speed, noisy=True))
    assert found.regime is Regime.PURE_SLIP
    assert found.stick_fraction == 0.0
    error = found.errors["stick_fraction"]
    assert error == 0.0 if speed < 0.85 else 1e-3 < error < 0.1


def test_a_short_stick_that_an_encoder_nearly_hides_is_within_the_error() -> None:
    """It sticks in 3 % of the time, and the encoder has 80 or 160 steps from peak to peak."""
    law = {"friction_law": "exponential", "friction_decay_speed": 0.5}
    drive = ss.scenario("feed_drive", belt_speed=0.08, start_after=1e6, **law)
    run = ss.simulate(drive, duration=10.0)
    for seed, resolution in ((2, 1e-5), (2, 2e-5), (3, 2e-5)):
        part = np.array(run.trajectory.position[7000 + 300 * seed :][:2000])
        case = study.Case(0.08, resolution, 0.0)
        found = study.measured(case, seed, part, np.zeros(len(part)))
        error = found.errors["stick_fraction"]
        assert error < 0.05
        assert abs(found.stick_fraction - run.measures.stick_fraction) < 1.96 * error


def test_lost_samples_and_impulses_change_little() -> None:
    """A twentieth of the samples is lost, and every hundredth is far off."""
    record = samples(noise=1e-6, count=3000)
    random = np.random.default_rng(5)
    position = record.position.copy()
    position[50::100] += 3e-4 * random.choice([-1.0, 1.0], 30)
    kept = np.sort(random.choice(3000, 2850, replace=False))
    measures = measured(replace(record, position=position)[kept])
    assert measures.regime is Regime.STICK_SLIP
    assert measures.steady
    assert measures.stick_fraction == pytest.approx(0.1001, abs=3e-3)
    assert measures.amplitude == pytest.approx(434.09e-6, rel=2e-3)
    assert measures.period == pytest.approx(0.0639242, rel=1e-4)


def test_a_jittered_clock_changes_nothing_if_the_stamps_are_right() -> None:
    position, velocity, _ = study.motion(0.04)
    random = np.random.default_rng(2)
    at = np.arange(2000) * 1e-3 + 2e-4 * random.random(2000)
    grid = np.arange(len(position)) * 1e-3
    from scipy.interpolate import CubicHermiteSpline

    told = CubicHermiteSpline(grid, position, velocity)(at) + 1e-6 * random.standard_normal(2000)
    record = replace(samples(noise=1e-6), stamp=np.rint(at * 1e9).astype(np.int64), position=told)
    measures = measured(record)
    assert measures.regime is Regime.STICK_SLIP
    assert measures.stick_fraction == pytest.approx(0.1001, abs=3e-3)
    assert measures.period == pytest.approx(0.0639242, rel=1e-4)


def test_a_slide_at_rest_shows_its_noise_as_nothing() -> None:
    """The amplitude has no bias by the noise: it is less than a third of its deviation."""
    rest = samples(noise=1e-6)
    noise = np.random.default_rng(0).standard_normal(2000)
    rest = replace(rest, position=4e-4 + 1e-6 * noise)
    measures = measured(rest)
    assert measures.regime is Regime.EQUILIBRIUM
    assert measures.midpoint == pytest.approx(4e-4, abs=2e-7)
    assert measures.amplitude == pytest.approx(0.0, abs=4e-7)
    stuck = measured(replace(rest, belt_velocity=np.zeros(2000)))
    assert stuck.regime is Regime.STUCK


@pytest.mark.parametrize(
    ("count", "rounded"),
    [(1, True), (3, False), *(pytest.param(50, each, marks=pytest.mark.long) for each in (0, 1))],
)
def test_the_cycles_before_a_gap_count_until_there_are_others(count: int, rounded: bool) -> None:
    record = samples(noise=1e-6, count=2000 + count)
    if rounded:
        record = replace(record, position=np.rint(record.position / 1e-5) * 1e-5)
    record.stamp[2000:] += 12_345_678_901
    measures = measured(record)
    assert measures.cycles == 20
    assert measures.regime is Regime.STICK_SLIP


def test_a_slide_that_is_held_before_a_gap_may_have_few_samples_after_it() -> None:
    for count in (1, 3, 50):
        held = samples(count=2000 + count)
        held = replace(held, position=1e-5 * (np.arange(2000 + count) // 7 % 2))
        held.stamp[2000:] += 12_345_678_901
        assert measured(held).regime is (Regime.HELD if count > 8 else None)


def test_the_memory_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is kept is a window of so many rows of four numbers, in a table twice as long."""
    held = 16_384
    monkeypatch.setattr("stickslip_ros.measures.sample_window._HELD", held)
    meter = SampleMeter(20, reading=NOISY)
    record, sizes = samples(noise=1e-6, count=4000), list[int]()
    for repeat in range(16):
        meter.feed(replace(record, stamp=record.stamp + repeat * 4_000_000_000))
        sizes.append(len(pickle.dumps(meter)))
    assert max(sizes) < 2.3 * held * 4 * 8


def test_below_three_cycles_nothing_is_said_of_steadiness_and_errors() -> None:
    measures = measured(samples(noise=1e-6, count=220))
    assert 0 < measures.cycles < 3
    assert measures.steady is None
    assert measures.errors is None
    assert measured(samples(count=220), EXACT).errors is None
    exact = measured(samples(), EXACT).errors
    assert exact["amplitude"] < 1e-9
