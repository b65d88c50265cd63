"""The onset of vibration from decay rates: against the Hopf points of the theory."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.onset import quiet, summary, tried
from stickslip_ros.measures.onset import mean_decays, onset_of
from stickslip_ros.measures.ring_down import RingDown
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Exponential, FrictionLaw, LuGre, Stribeck
from stickslip_ros.theory.hopf import hopf_points
from stickslip_ros.theory.linear import expand

LAWS: dict[str, FrictionLaw] = {
    "stribeck": Stribeck(0.31, 0.22, 0.043),
    "exponential, exponent 1": Exponential(0.33, 0.21, 0.021),
    "exponential, exponent 2": Exponential(0.3, 0.24, 0.034, 0.0, 2.0),
    "lugre": LuGre(Exponential(0.33, 0.21, 0.021), bristle_stiffness=30_000.0),
}


def drive_with(friction: FrictionLaw) -> Drive:
    return Drive(
        mass=83.0,
        damping=410.0,
        stiffness=7.3e5,
        normal_force=900.0,
        belt_speed=0.05,
        friction=friction,
    )


def decaying(
    drive: Drive, ratios: tuple[float, ...], share: float = 0.005, seed: int = 0
) -> tuple[list[RingDown], float]:
    """Return five ring-downs at each feed, with an error that is a share, and the Hopf speed.

    Feeds are in Hopf speeds, or without one in 40 mm/s.
    """
    hopf = max((point.belt_speed for point in hopf_points(drive)), default=0.04)
    random = np.random.default_rng(seed)
    found: list[RingDown] = []
    for speed in (ratio * hopf for ratio in ratios):
        expansion = expand(replace(drive, belt_speed=speed))
        assert expansion is not None
        pair = expansion.eigenvalues[expansion.eigenvalues.imag > 0.0][0] * drive.angular_frequency
        rate, frequency = -pair.real, pair.imag / (2.0 * np.pi)
        for _ in range(5):
            own = rate * (1.0 + share * random.standard_normal())
            found.append(RingDown(0.0, 1.0, speed, own, share * rate, frequency, 1e-3, 1e-5))
    return found, hopf


@pytest.mark.parametrize("name", LAWS)
def test_the_interval_contains_the_hopf_speed(name: str) -> None:
    for seed in range(10):
        own, hopf = decaying(drive_with(LAWS[name]), (1.1, 1.2, 1.35, 1.5), seed=seed)
        onset = onset_of(own)
        assert onset.speed is not None
        assert onset.lower is not None
        assert onset.upper is not None
        assert onset.lower <= hopf <= onset.upper
        assert onset.lower <= onset.speed <= onset.upper
        assert name == "lugre" or not onset.families[name].rejected
        assert onset.speed == pytest.approx(hopf, rel=0.06)


@pytest.mark.parametrize("name", LAWS)
def test_there_is_no_lower_end_where_friction_falls_less_than_the_damping(name: str) -> None:
    for seed, share in enumerate((0.3, 0.5, 0.7, 0.9)):
        drive = drive_with(LAWS[name])
        speeds = np.linspace(1e-4, 0.2, 2000)
        falls = -np.gradient(drive.friction.at_rest(speeds), speeds).min()
        drive = replace(drive, normal_force=share * drive.damping / falls)
        assert not hopf_points(drive)
        for ratios in ((0.5, 0.6, 0.8), (0.9, 1.0, 1.1, 1.3, 1.5)):
            own, _ = decaying(drive, ratios, seed=seed)
            assert onset_of(own).lower is None


def test_a_vibration_that_grows_is_below_the_onset() -> None:
    """What is advised is no feed below the onset."""
    own, hopf = decaying(drive_with(LAWS["stribeck"]), (1.02, 1.1))
    grows = replace(own[0], belt_speed=0.99 * hopf, decay_rate=-0.3, decay_error=0.01)
    onset = onset_of([grows, *own])
    assert onset.lower is not None
    assert onset.upper is not None
    assert 0.98 * hopf < onset.lower < hopf < onset.upper
    assert "no ring-down decays: a run at a higher feed" in onset_of([grows]).advice
    advice = onset_of([grows, *own[:5]]).advice
    assert f"such as {1e3 * 1.1 * own[0].belt_speed:.4g} mm/s" in advice


def test_where_the_decay_falls_with_the_feed_higher_ones_are_advised() -> None:
    rates = [(0.02, 6.0), (0.03, 5.0), (0.04, 3.0)]
    falling = [RingDown(0.0, 1.0, v, rate, 0.01, 16.0, 1e-3, 1e-5) for v, rate in rates]
    assert "runs above 40 mm/s" in onset_of(falling).advice


def test_a_family_that_fits_gives_the_decay_at_any_feed() -> None:
    own, hopf = decaying(drive_with(LAWS["stribeck"]), (1.1, 1.2, 1.4), share=1e-6)
    family = onset_of(own).families["stribeck"]
    assert family.onset_speed == pytest.approx(hopf, rel=2e-3)
    rates = family.decay_rate(np.array([each.belt_speed for each in own]))
    assert rates == pytest.approx([each.decay_rate for each in own], rel=2e-2)


def test_families_that_do_not_fit_are_rejected() -> None:
    own, _ = decaying(drive_with(LAWS["exponential, exponent 1"]), (1.05, 1.2, 1.5, 1.9))
    onset = onset_of(own)
    assert {name for name, each in onset.families.items() if each.rejected} >= {"stribeck"}
    rates = [1.0, 3.0, 0.5, 4.0]
    mixed = [
        RingDown(0.0, 1.0, speed, rate, 0.01, 16.0, 1e-3, 1e-5)
        for speed, rate in zip((0.04, 0.05, 0.06, 0.07), rates, strict=True)
    ]
    onset = onset_of(mixed)
    assert onset.speed is None
    assert "no family of friction fits" in onset.advice


def test_what_tells_nothing_gives_a_sentence() -> None:
    own, hopf = decaying(drive_with(LAWS["stribeck"]), (1.2,))
    assert "no ring-down decays" in onset_of([]).advice
    onset = onset_of(own)
    assert onset.upper is None
    assert "one feed tells no onset" in onset.advice
    same = [*own, *(replace(each, belt_speed=1.3 * hopf) for each in own)]
    assert "does not rise with the feed" in onset_of(same).advice
    assert "rad/s" in onset_of(own, "rad").advice


def test_far_from_the_onset_only_an_upper_limit_is_told() -> None:
    own, hopf = decaying(drive_with(LAWS["exponential, exponent 1"]), (1.6, 1.8, 2.0), share=0.02)
    onset = onset_of(own)
    assert onset.speed is None
    assert onset.upper is not None
    assert onset.upper > hopf
    assert "only an upper limit" in onset.advice
    assert "a run at" in onset.advice


def test_errors_that_are_common_to_equal_taps_are_not_averaged_out() -> None:
    equal = [RingDown(0.0, 1.0, 0.05, 2.0, 0.1, 16.0, 1e-3, 1e-5)] * 10
    (mean,) = mean_decays(equal)
    assert mean.decay_error == pytest.approx(0.1)
    random = np.random.default_rng(1)
    scattered = [replace(each, decay_rate=2.0 + 0.1 * random.standard_normal()) for each in equal]
    (mean,) = mean_decays(scattered)
    assert 0.02 < mean.decay_error < 0.08
    assert mean.ring_downs == 10


def test_where_no_family_is_likely_the_errors_are_larger_than_told() -> None:
    """By the errors as told the likeliest one has a probability of 3 %."""
    speeds = np.linspace(0.06, 0.09, 5)
    rates = 4.5 * (1.0 - (0.05 / speeds) ** 2) + 0.07 * np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    scattered = [
        RingDown(0.0, 1.0, speed, rate, 0.05, 16.0, 1e-3, 1e-5)
        for speed, rate in zip(speeds.tolist(), rates.tolist(), strict=True)
    ]
    families = onset_of(scattered).families.values()
    assert max(family.probability for family in families) > 0.2


@pytest.mark.long
def test_machines_of_three_laws_are_covered() -> None:
    """A part of the study in benchmarks/onset.py."""
    rows = [tried(seed) for seed in range(15)]
    found = summary(rows)
    assert found["covered"] >= 0.92
    assert found["below_limit"] >= 0.95
    assert found["near_limits"] == found["near"]
    assert found["near_median_limit"] <= 1.1
    assert [row["lower"] for row in map(quiet, range(5))] == 5 * [None]
