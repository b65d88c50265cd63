"""The picture of which motion a start leads to."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from stickslip_ros.physics.measures import Regime
from stickslip_ros.plots.basin_picture import draw_basin
from stickslip_ros.plots.style import GREEN, LIGHT_GREY, ORANGE, SKY_BLUE

LABELS = ["sticks and slips, amplitude 0.318 m: 68.8 % +- 0.7 %", "comes to rest: 31.2 %"]
REGIMES = [Regime.STICK_SLIP, Regime.EQUILIBRIUM]


def drawn(path: Path, **changes: Any) -> Path:
    """Draw starts within an ellipse around the equilibrium at rest, and the others vibrating."""
    position, velocity = (
        axis.ravel() for axis in np.meshgrid(np.linspace(-2.0, 2.0, 40), np.linspace(-1.0, 1.0, 30))
    )
    given: dict[str, Any] = {
        "position": position,
        "velocity": velocity,
        "attractor": ((position - 0.5) ** 2 + 4.0 * velocity**2 < 1.0).astype(np.intp),
        "regimes": REGIMES,
        "labels": LABELS,
        "grid_shape": None,
        "belt_speed": 0.4,
        "equilibrium_position": 0.5,
    }
    draw_basin(path, **given | changes)
    return path


def shares(path: Path, *colours: str) -> list[float]:
    """Return what share of the picture has each colour."""
    with Image.open(path) as image:
        pixels: npt.NDArray[np.uint8] = np.asarray(image.convert("RGB"))
    wanted = [[int(colour[start : start + 2], 16) for start in (1, 3, 5)] for colour in colours]
    return [float((pixels == one).all(axis=-1).mean()) for one in wanted]


@pytest.mark.parametrize(("ending", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml")])
@pytest.mark.parametrize("grid_shape", [None, (30, 40)])
def test_the_format_follows_the_ending(
    tmp_path: Path, ending: str, start: bytes, grid_shape: tuple[int, int] | None
) -> None:
    path = drawn(tmp_path / f"basin{ending}", grid_shape=grid_shape)
    assert path.read_bytes().startswith(start)


def test_it_says_what_it_shows(tmp_path: Path) -> None:
    picture = drawn(tmp_path / "basin.svg").read_text(encoding="utf-8")
    for text in (*LABELS, "belt speed", "equilibrium", "displacement at the start (m)"):
        assert text in picture
    assert "not known" not in picture


def test_of_a_grid_each_basin_has_its_area(tmp_path: Path) -> None:
    path = drawn(tmp_path / "basin.png", grid_shape=(30, 40))
    sticks, rests, unknown = shares(path, ORANGE, GREEN, LIGHT_GREY)
    assert rests / sticks == pytest.approx(np.pi / 2.0 / (8.0 - np.pi / 2.0), rel=0.1)
    assert unknown < 1e-3


def test_a_grid_may_have_the_velocities_first(tmp_path: Path) -> None:
    one = drawn(tmp_path / "one.png", grid_shape=(30, 40))
    velocity, position = (
        axis.ravel() for axis in np.meshgrid(np.linspace(-1.0, 1.0, 30), np.linspace(-2.0, 2.0, 40))
    )
    attractor = ((position - 0.5) ** 2 + 4.0 * velocity**2 < 1.0).astype(np.intp)
    other = drawn(
        tmp_path / "other.png",
        position=position,
        velocity=velocity,
        attractor=attractor,
        grid_shape=(40, 30),
    )
    with Image.open(one) as expected, Image.open(other) as found:
        assert np.array_equal(np.asarray(found), np.asarray(expected))


def test_what_is_not_known_is_grey(tmp_path: Path) -> None:
    path = drawn(
        tmp_path / "basin.png", grid_shape=(30, 40), attractor=np.full(1200, -1, dtype=np.intp)
    )
    sticks, rests, unknown = shares(path, ORANGE, GREEN, LIGHT_GREY)
    assert unknown > 0.5
    assert max(sticks, rests) < 0.01


def test_two_attractors_of_one_regime_have_two_colours(tmp_path: Path) -> None:
    regimes = [Regime.STICK_SLIP, Regime.STICK_SLIP]
    path = drawn(tmp_path / "basin.png", grid_shape=(30, 40), regimes=regimes)
    assert min(shares(path, ORANGE, SKY_BLUE)) > 0.05
