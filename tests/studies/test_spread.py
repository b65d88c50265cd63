"""Drives that a fit leaves open: the scenario file keeps it, and constants are drawn from it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.template import commented_file
from stickslip_ros.studies.spread import check_spread, drawn

NAMES = ["plant.mass", "plant.stiffness", "plant.friction.static"]
FIT = {
    "names": NAMES,
    "standard_errors": [2.0, 3e4, 0.01],
    "correlations": [1.0, 0.8, 0.0, 0.8, 1.0, 0.0, 0.0, 0.0, 1.0],
}


def test_a_file_keeps_what_the_fit_leaves_open(tmp_path: Path) -> None:
    path = tmp_path / "fit.yaml"
    path.write_text(commented_file(replace(ss.scenario("feed_drive"), fit=FIT), "a fit"))
    loaded = ss.scenario(path)
    assert loaded.fit == FIT
    below = tmp_path / "mine.yaml"
    below.write_text("/**/scenario: {ros__parameters: {base: fit.yaml}}\n")
    assert ss.scenario(below).fit == FIT
    constants = np.array([list(drawn(loaded, seed, "fit").values()) for seed in range(400)])
    middle = [loaded.plant.mass, loaded.plant.stiffness, loaded.plant.flat()["friction.static"]]
    assert np.std(constants, axis=0) == pytest.approx(FIT["standard_errors"], rel=0.15)
    assert constants.mean(axis=0) == pytest.approx(middle, rel=0.01)
    assert np.corrcoef(constants.T)[0, 1] == pytest.approx(0.8, abs=0.06)


def test_gains_are_for_what_a_fit_leaves_open(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("stickslip_ros.studies.design._SEARCHED", 2)
    monkeypatch.setattr("stickslip_ros.studies.design._TRIED", 2)
    drive = replace(ss.scenario("feed_drive", controller="velocity_feedback"), fit=FIT)
    found = ss.design(drive, 0.04, spread="fit").to_dict()
    assert (found["spread"], found["drawn"]["held"]) == ("fit", 2)
    assert [*found["drawn"]["worst"]] == NAMES
    (path := tmp_path / "held.yaml").write_text(found["parameter_file"])
    assert ss.scenario(path).fit == FIT
    with pytest.raises(InvalidInputError, match="no intervals of friction constants"):
        ss.design("feed_drive", 0.04, spread="fit")
    with pytest.raises(InvalidInputError, match=r"must be from 0 to 0\.9, or fit"):
        ss.design(drive, 0.04, spread=1.0)


def test_what_is_refused(tmp_path: Path) -> None:
    drive = ss.scenario("feed_drive")
    with pytest.raises(InvalidInputError, match="no intervals of friction constants"):
        drawn(drive, 0, "fit")
    endless = replace(drive, fit={**FIT, "standard_errors": [2.0, float("inf"), 0.01]})
    with pytest.raises(InvalidInputError, match=r"plant\.stiffness is not identifiable"):
        drawn(endless, 0, "fit")
    for spread in (-0.1, 0.95, "fits"):
        with pytest.raises(InvalidInputError, match=r"must be from 0 to 0\.9, or fit"):
            check_spread(spread)
    path = tmp_path / "short.yaml"
    path.write_text(commented_file(replace(drive, fit={**FIT, "correlations": [1.0]}), "a fit"))
    with pytest.raises(InvalidInputError, match="or the fit that `stickslip identify` writes"):
        ss.scenario(path)
