"""Drives that the theory covers, and the sentence with which it refuses others."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.actuator import Actuator
from stickslip_ros.model.control import Washout
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Coulomb, Dahl, Directional
from stickslip_ros.model.signals import sine
from stickslip_ros.theory.critical_gains import critical_gains, limit_cycle_from_hopf
from stickslip_ros.theory.cycle_bounds import (
    averaged_growth,
    largest_cycle,
    least_cycle,
    loading_time,
    longest_return,
    release_position,
)
from stickslip_ros.theory.hopf import hopf_points
from stickslip_ros.theory.limit_cycles import limit_cycle_of_run, limit_cycles
from stickslip_ros.theory.linear import expand
from stickslip_ros.theory.linear_sampled_loop import LinearSampledLoop
from stickslip_ros.theory.shooting import shoot
from stickslip_ros.theory.sticking import sticking_onset
from tests.drives import PAPER

GAINS = Washout(2.0, -1.0, -1.0)


SWING = sine(0.05)
REMEMBERS = replace(PAPER, friction=Dahl(static=0.4, bristle_stiffness=5.0))
ONE_WAY = replace(PAPER, friction=Directional(Coulomb(0.4), Coulomb(0.6)))
LOADED = replace(PAPER, load=SWING)
CARRIED = replace(PAPER, belt=SWING, load=SWING)

LAGGING = replace(PAPER, actuator=Actuator(time_constant=0.5))

SENTENCES = {
    "memory": (REMEMBERS, "the friction law dahl has a memory (z)"),
    "one way": (ONE_WAY, "the friction law coulomb differs between forward and backward slip"),
    "load": (LOADED, "the drive has a signal of its load"),
    "spring": (replace(PAPER, stiffness=0.0), "needs a spring: the drive has stiffness = 0 N/m"),
    "belt and load": (CARRIED, "the drive has a signal of its belt and its load"),
}

Theory = Callable[[Drive], object]

SMOOTH: list[tuple[str, Theory]] = [
    ("the expansion at the equilibrium", expand),
    ("the search for Hopf points", hopf_points),
    ("shooting", lambda drive: shoot(drive, -0.1, 6.4)),
]
COVERED_GAINS: list[tuple[str, Theory]] = [
    ("the critical gain", lambda drive: critical_gains(drive, GAINS)),
    ("the critical gain", lambda drive: limit_cycle_from_hopf(drive, GAINS)),
    ("the theory of the sampled loop", lambda drive: LinearSampledLoop.from_drive(drive, 100.0)),
]
WITHOUT_MEMORY: list[tuple[str, Theory]] = [
    ("averaging", lambda drive: averaged_growth(drive, 0.4, 0.1)),
    ("the energy of a cycle", least_cycle),
    ("the energy of a cycle", largest_cycle),
    ("the stick-slip onset speed", sticking_onset),
]
SYMMETRIC: list[tuple[str, Theory]] = [
    *WITHOUT_MEMORY,
    ("the limit cycle of a run", lambda drive: limit_cycle_of_run(drive, 0.0)),
    ("the search for limit cycles", limit_cycles),
]
REFUSED = [
    *((*each, lack) for each in SMOOTH for lack in ("load", "belt and load")),
    *((*each, "load") for each in COVERED_GAINS),
    *((*each, "memory") for each in WITHOUT_MEMORY),
    *((*each, lack) for each in SYMMETRIC for lack in ("one way", "load")),
    *((*each, "spring") for each in (*SMOOTH, *COVERED_GAINS, *SYMMETRIC)),
    ("the release by the belt", release_position, "spring"),
    ("the loading by the belt", loading_time, "spring"),
    ("the loading by the belt", longest_return, "spring"),
]


@pytest.mark.parametrize(("name", "theory", "lack"), REFUSED)
def test_a_drive_that_is_not_covered_is_refused_by_name(
    name: str, theory: Theory, lack: str
) -> None:
    drive, sentence = SENTENCES[lack]
    with pytest.raises(InvalidInputError) as refused:
        theory(drive)
    assert str(refused.value).startswith(f"{name} needs ")
    assert str(refused.value).endswith(sentence)


@pytest.mark.parametrize("gains", [None, GAINS])
def test_the_equilibrium_of_a_law_with_a_memory(gains: Washout | None) -> None:
    expansion = expand(REMEMBERS, gains)
    # Friction is that of steady slip, and the bristles are bent accordingly.
    assert expansion.equilibrium[:3] == pytest.approx([0.4, 0.0, -0.4 / 5.0], rel=1e-14)
    assert expansion.stable  # Dahl's friction does not fall with speed
    assert len(expansion.eigenvalues) == (3 if gains is None else 4)
    assert np.all(expansion.eigenvalues.real < 0.0)


@pytest.mark.parametrize("theory", [each for _, each in (*SMOOTH, *COVERED_GAINS)])
def test_what_covers_every_law_takes_them_all(theory: Theory) -> None:
    for drive in (PAPER, REMEMBERS, ONE_WAY):
        theory(drive)


def test_an_actuator_has_no_part_in_theory_without_sampling() -> None:
    for gains in (None, GAINS):
        lagging, ideal = expand(LAGGING, gains), expand(PAPER, gains)
        assert lagging.jacobian.tolist() == ideal.jacobian.tolist()
        assert hopf_points(LAGGING, gains) == hopf_points(PAPER, gains)
        assert shoot(LAGGING, -0.1, 6.4, control=gains) == shoot(PAPER, -0.1, 6.4, control=gains)
        lagging, ideal = (
            limit_cycle_of_run(drive, 0.0, control=gains) for drive in (LAGGING, PAPER)
        )
        assert lagging == ideal
    assert limit_cycles(LAGGING) == limit_cycles(PAPER)


def test_a_bias_force_moves_the_equilibrium_and_nothing_else() -> None:
    gains, biased = GAINS, replace(PAPER, bias_force=0.3)
    moved, unmoved = expand(biased, gains), expand(PAPER, gains)
    assert moved.equilibrium[0] == pytest.approx(unmoved.equilibrium[0] + 0.3, rel=1e-14)
    assert moved.jacobian.tolist() == unmoved.jacobian.tolist()
    assert hopf_points(biased, gains) == hopf_points(PAPER, gains)
    (cycle,), (other,) = limit_cycles(biased), limit_cycles(PAPER)
    assert cycle.position == pytest.approx(other.position + 0.3, rel=1e-12)
    assert cycle.measures.amplitude == pytest.approx(other.measures.amplitude, rel=1e-12)
    assert sticking_onset(biased).exact == pytest.approx(sticking_onset(PAPER).exact, rel=1e-12)
    assert largest_cycle(biased) == pytest.approx(largest_cycle(PAPER), rel=1e-12)
    assert least_cycle(biased) == pytest.approx(least_cycle(PAPER), rel=1e-12)
