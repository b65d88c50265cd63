"""`stickslip identify --map` and `ss.friction_map`."""

from pathlib import Path

import numpy as np
import pytest

import stickslip_ros as ss
from tests.app.conftest import Run

COLUMNS = "velocity=v,force=f*2"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    speed = np.geomspace(0.001, 0.2, 20)
    force = (20.0 + 10.0 * np.exp(-speed / 0.01) + 60.0 * speed) / 2.0
    rows = zip([*speed, *-speed, 0.1], [*force, *-force], strict=False)
    path = tmp_path / "map.csv"
    path.write_text("v,f\n" + "".join(f"{v!r},{f!r}\n" for v, f in np.array([*rows]).tolist()))
    return path


def test_a_map_gives_friction_alone(table: Path, stickslip: Run, tmp_path: Path) -> None:
    arguments = ("identify", str(table), "--map", "--columns", COLUMNS)
    done = stickslip(*arguments, "--plot", "map.png")
    assert done.returncode == 0
    assert "law exponential" in done.stdout
    assert "40 pairs" in done.stdout
    assert (tmp_path / "map.png").stat().st_size > 1000
    assert "s/rad" in stickslip(*arguments, "--rotary").stdout
    model = ss.friction_map(table, columns={"velocity": "v", "force": "f*2"})
    assert stickslip.json(*arguments) == model.to_dict()
    constants = {name: each.value for name, each in model.parameters.items()}
    truth = {"static": 30.0, "kinetic": 20.0, "viscous": 60.0, "decay_speed": 0.01}
    named = {f"plant.friction.{name}": value for name, value in truth.items()}
    assert constants == pytest.approx(named, rel=1e-4)
