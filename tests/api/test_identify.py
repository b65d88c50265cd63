"""`ss.identify`."""

from pathlib import Path

import pytest

import stickslip_ros as ss
from stickslip_ros.errors import InvalidInputError


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> ss.Model:
    """Model of a simulated drive, from a table."""
    path = tmp_path_factory.mktemp("logs") / "log.csv"
    drive = ss.scenario("feed_drive", expects_control=False, belt_speed=0.02)
    ss.simulate(drive, duration=1.2).to_pandas().reset_index().to_csv(path, index=False)
    known = {"plant.mass": 100.0, "plant.damping": 200.0, "plant.normal_force": 1000.0}
    return ss.identify(path, law="stribeck", fixed=known)


def test_the_constants_of_exact_samples(model: ss.Model) -> None:
    assert model.law == "stribeck"
    assert model.parameters["plant.stiffness"].value == pytest.approx(1e6, rel=1e-6)
    assert model.parameters["plant.friction.static"].value == pytest.approx(0.4, rel=1e-5)
    assert "plant.bias_force" in model.unidentified


def test_the_scenario_of_a_model(model: ss.Model, tmp_path: Path) -> None:
    saved = model.save(tmp_path / "drive.yaml")
    assert saved.plant.stiffness == pytest.approx(1e6, rel=1e-6)
    assert ss.stability(saved).closed_loop["stable"] is False  # without gains


def test_a_recording_is_predicted(model: ss.Model, tmp_path: Path) -> None:
    drive = ss.scenario("feed_drive", expects_control=False, belt_speed=0.03)
    path = tmp_path / "other.csv"
    ss.simulate(drive, duration=1.0).to_pandas().reset_index().to_csv(path, index=False)
    error = model.check(path)["free_run_error"]
    assert error < 1e-6
    path.write_text(path.read_text().replace(",", ";").replace(".", ","))
    assert model.check(path, decimal=",", start=0.1)["free_run_error"] == pytest.approx(
        model.check(path, start=0.1)["free_run_error"]
    )
    with pytest.raises(InvalidInputError, match="force = 'torque' is invalid"):
        model.check(path, force="torque")
