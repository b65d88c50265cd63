"""Limits of samples: motion below the step of an encoder, and few samples per cycle."""

import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks import measures_under_noise as study
from stickslip_ros.measures import Measures, Regime
from stickslip_ros.measures.noise import strongest_line, white_noise
from stickslip_ros.measures.sample_assumptions import UNKNOWN, SampleAssumptions
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.options import SettlingOptions
from stickslip_ros.studies.settling import ControlledDrive, MotionState, settle
from stickslip_ros.studies.simulate import sensor_meter, simulate
from tests.measures.records import behind_a_play, columns, fed, milliseconds

NOISY = SampleAssumptions(noisy=True)
PERIOD = 0.0639242
ENCODER = (
    "plant.sensor.velocity=difference",
    "plant.sensor.difference_samples=8",
    "washout_controller.start_after=0",
)


def measured(
    time: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray | None = None,
    reading: SampleAssumptions = NOISY,
    belt: float = 0.04,
) -> Measures:
    return fed(
        columns(np.rint(time * 1e9).astype(np.int64), position, velocity, belt), reading
    ).measures()


def told(amplitude: float, noise: float, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what an encoder with steps of 1 um tells of a vibration that comes from outside.

    `amplitude` and `noise` are in steps.
    """
    random, time = np.random.default_rng(seed), np.arange(count) * 1e-3
    decay = 100.0 * np.exp(-time / 0.1)
    steps = 400.3 + random.uniform() + (amplitude + decay) * np.sin(2.0 * np.pi * time / PERIOD)
    return time, np.round(steps + noise * random.standard_normal(count)) * 1e-6


@pytest.mark.parametrize("count", [2500, 9000])
@pytest.mark.parametrize(("seed", "noise"), [(0, 0.0), (1, 0.5), (2, 0.0)])
def test_a_slide_within_the_resolution_is_held_whatever_the_length_of_the_run(
    count: int, seed: int, noise: float
) -> None:
    amplitude = np.random.default_rng(seed).uniform(0.0, 0.45)
    found = measured(*told(amplitude, noise, count, seed))
    assert found.regime is Regime.HELD
    assert found.steady
    assert found.period is None


@pytest.mark.parametrize(("size", "count"), [(3.0, 2500), (3.0, 9000), (5.3, 2500), (10.0, 2500)])
def test_a_cycle_of_several_steps_keeps_its_regime(size: float, count: int) -> None:
    found = measured(*told(size / 2.0, 0.0, count, 1))
    assert found.regime is Regime.PURE_SLIP
    assert found.amplitude == pytest.approx(size / 2.0 * 1e-6, abs=0.6e-6)
    assert found.errors is None  # below 25 steps


@pytest.mark.parametrize("size", [5, 10])
def test_a_stick_shows_in_a_few_steps(size: int) -> None:
    position, _, truth = study.motion(0.03)
    step, time = 2.0 * truth.amplitude / size, np.arange(2500) * 1e-3
    found = measured(time, np.round(position[:2500] / step) * step, belt=0.03)
    assert found.regime is truth.regime is Regime.STICK_SLIP
    assert found.amplitude == pytest.approx(truth.amplitude, abs=step / 2.0)
    assert found.stick_fraction == pytest.approx(truth.stick_fraction, abs=0.1)


def test_a_loop_that_holds_within_a_step_is_held_in_the_motion_as_in_its_samples() -> None:
    scenario = load_scenario("feed_drive", ["plant.sensor.position_resolution=5e-6", *ENCODER])
    meter = sensor_meter(scenario)
    assert simulate(scenario, 3.0, measured=meter).regime is Regime.HELD
    assert meter.measures().regime is Regime.HELD


def test_a_few_cycles_within_a_step_that_grow_by_chance_leave_it_steady() -> None:
    """Four cycles are measured, as in a sweep."""
    encoder = ["plant.sensor.position_resolution=5e-7", *ENCODER]
    settling = SettlingOptions(transient=60.0)
    for belt in (0.0480, 0.0481818, 0.0484):
        scenario = load_scenario("feed_drive", [*encoder, f"plant.belt_speed={belt}"])
        start = MotionState(scenario.plant.initial.position, scenario.plant.initial.velocity)
        found = settle(ControlledDrive.from_scenario(scenario), start, settling)
        assert found.measures.regime is Regime.HELD
        assert found.steady


def test_a_moving_axis_is_not_stuck() -> None:
    time = np.arange(4000) * 1e-3
    found = measured(time, np.round(0.3 * time / 1e-6) * 1e-6, belt=0.0)
    assert found.regime is None


@pytest.mark.parametrize(("end", "regime"), [(1500, None), (2500, Regime.STUCK)])
def test_an_axis_is_stuck_once_it_stands_for_longer_than_between_slips(
    end: int, regime: Regime | None
) -> None:
    """Two slips of 0.2 s, 0.5 s apart."""
    time = np.arange(end) * 1e-3
    slips = np.clip(time / 0.2, 0.0, 1.0) + np.clip((time - 0.7) / 0.2, 0.0, 1.0)
    assert measured(time, np.round(1e-3 * slips, 6), reading=UNKNOWN, belt=0.0).regime is regime


def test_noise_that_wanders_beside_an_even_feed_is_no_cycle() -> None:
    noise = lfilter([1e-6], [1.0, -0.97], np.random.default_rng(1).standard_normal(6000))
    found = measured(np.arange(6000) * 1e-3, np.round(noise, 7), reading=UNKNOWN, belt=0.004)
    assert found.regime is found.stick_fraction is None


@pytest.mark.parametrize(
    "reading", [UNKNOWN, NOISY, SampleAssumptions()], ids=["unknown", "noisy", "exact"]
)
@pytest.mark.parametrize(
    "every", [6, 16, 30, *(pytest.param(each, marks=pytest.mark.long) for each in (1, 10, 21))]
)
def test_few_samples_per_cycle_are_measured_or_said_to_be_too_few(
    every: int, reading: SampleAssumptions
) -> None:
    """From 64 samples per cycle to 2."""
    position, velocity, truth = study.motion(0.04)
    time = np.arange(len(position))[: 2000 * every] * 1e-3
    position, velocity = position[: len(time)], velocity[: len(time)]
    found = measured(time[::every], position[::every], velocity[::every], reading)
    if PERIOD / (every * 1e-3) < 4.0:
        assert found.regime is Regime.UNDERSAMPLED
    elif found.regime is not Regime.UNDERSAMPLED:
        assert found.regime is Regime.STICK_SLIP
        assert found.steady
        assert found.amplitude == pytest.approx(truth.amplitude, rel=0.005)
        assert found.period == pytest.approx(truth.period, rel=1e-4)
    assert every > 10 or found.regime is Regime.STICK_SLIP


@pytest.mark.parametrize(
    "count", [20, *(pytest.param(each, marks=pytest.mark.long) for each in (24, 30, 50))]
)
def test_a_whole_number_of_samples_per_cycle_is_fitted_by_no_more_than_they_tell(
    count: int,
) -> None:
    position, _, truth = study.motion(0.02)
    time = np.arange(25 * count) * truth.period / count
    position = np.interp(time, np.arange(len(position)) * 1e-3, position)
    for step in (1e-6, 5e-6):
        found = measured(time, np.round(position / step) * step, belt=0.02)
        assert found.amplitude == pytest.approx(truth.amplitude, rel=0.01, abs=step)


@pytest.mark.parametrize(("play", "regime"), [(40e-6, None), (0.0, Regime.PURE_SLIP)])
def test_an_axis_that_stays_where_it_turns_has_no_pure_slip(
    play: float, regime: Regime | None
) -> None:
    """It follows a circle on a guide at rest, through a play: it rests in 2 % of the time."""
    time = np.arange(8000) / 500.0
    position = behind_a_play(0.05 * np.sin(np.pi / 2.0 * time), play)
    found = measured(time, np.round(position, 8), belt=0.0)
    assert found.regime is regime
    assert (found.stick_fraction is None) == (regime is None)
    assert found.period == pytest.approx(4.0, rel=1e-4)


def test_motion_that_the_spectrum_shows_is_motion_under_large_noise() -> None:
    position, _, truth = study.motion(0.04)
    position = position[:6000] + 3e-4 * np.random.default_rng(0).standard_normal(6000)
    told = fed(columns(milliseconds(6000), position), NOISY).measured()
    found = told.measures
    assert found.regime is Regime.PURE_SLIP
    assert truth.stick_fraction < 2.0 * found.errors["stick_fraction"] < 0.3
    assert any("may hide sticks" in note for note in told.notes)
    assert found.amplitude == pytest.approx(truth.amplitude, abs=3.0 * found.errors["amplitude"])
    assert found.period == pytest.approx(truth.period, rel=0.005)


def test_slips_of_one_sample_may_be_positions_that_are_held() -> None:
    position = 0.04 * (1e-3 * np.arange(4000) % 0.2)
    position += 1e-6 * np.random.default_rng(0).standard_normal(4000)
    told = fed(columns(milliseconds(4000), position), NOISY).measured()
    assert told.measures.regime is Regime.STICK_SLIP
    assert any("positions that are held between updates look the same" in n for n in told.notes)


def test_the_spectrum_shows_a_motion_and_no_noise() -> None:
    signal = np.sin(2.0 * np.pi * np.arange(2000) / 7.3)
    noise = np.random.default_rng(0).standard_normal(2000)
    assert strongest_line(signal + noise) == pytest.approx(1.0 / 7.3, rel=1e-3)
    assert strongest_line(noise) is None
    # A signal with harmonics: what differences leave of it is no noise.
    assert white_noise(np.sign(signal) * signal**2 + 1e-3 * noise) == pytest.approx(1e-3, rel=0.2)


BELTS = (0.01, 0.044)


@pytest.mark.parametrize(
    ("step", "belts"),
    [
        pytest.param(1e-6, BELTS, marks=pytest.mark.long),
        pytest.param(2e-5, BELTS, marks=pytest.mark.long),
        (1e-5, (0.03,)),
    ],
)
def test_standard_errors_cover_the_rounding_of_an_encoder_without_noise(
    step: float, belts: tuple[float, ...]
) -> None:
    """Of two parts of each motion; the study has sixty belt speeds."""
    covered, errors = 0, list[float]()
    for number, belt in enumerate(belts):
        position, _, truth = study.motion(belt)
        for part in (position[400 * number :][:2500], position[3000 + 300 * number :][:2500]):
            time = np.arange(len(part)) * 1e-3
            found = measured(time, np.round(part / step) * step, belt=belt)
            if found.errors is None:
                assert found.amplitude < 25.0 * step
                continue
            errors.append(abs(found.amplitude - truth.amplitude) / found.errors["amplitude"])
            covered += errors[-1] <= 1.96
    assert covered >= len(errors) - 1
    assert max(errors, default=0.0) < 4.0


def test_a_flat_top_with_a_corner_has_no_amplitude_beyond_it() -> None:
    """The error of an axis on a circle that stays at its reversals until it is 40 um behind."""
    command = 0.05 * np.sin(2.0 * np.pi * 0.25 * 0.002 * np.arange(8000))
    time = 0.002 * np.arange(len(command))
    found = measured(time, command - behind_a_play(command, 4e-5), reading=UNKNOWN, belt=0.0)
    assert found.amplitude == pytest.approx(4e-5, rel=1e-3)
    assert found.period == pytest.approx(4.0, rel=1e-6)
