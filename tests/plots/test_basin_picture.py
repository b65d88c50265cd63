"""The plot of basins of attraction."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.plots.basin_picture import basin_figure
from stickslip_ros.plots.regimes import REGIMES as LOOKS
from stickslip_ros.plots.style import GREEN, ORANGE, SKY_BLUE, STYLES, save
from stickslip_ros.plots.units import Units
from tests.plots.texts import faults

LABELS = ["stick-slip, amplitude 0.318 m: 68.8 % +- 0.7 %", "equilibrium: 31.2 %"]
REGIMES = [Regime.STICK_SLIP, Regime.EQUILIBRIUM]


def starts(**changes: Any) -> dict[str, Any]:
    """Return starts within an ellipse around the equilibrium at rest, and the others vibrating."""
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
    return given | changes


def drawn(path: Path, **changes: Any) -> Path:
    save(basin_figure(**starts(**changes)), path)
    return path


def shares(path: Path, *colours: str) -> list[float]:
    """Return what share of the picture has each colour, or what is hatched on it."""
    with Image.open(path) as image:
        pixels: npt.NDArray[np.int64] = np.asarray(image.convert("RGB"), dtype=int)
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
    for text in (*LABELS, "belt speed", "equilibrium"):
        assert text in picture
    assert "the motion that each of 1200 starts leads to" in picture


def test_it_is_in_the_units_of_the_drive() -> None:
    small = {name: 1e-3 * starts()[name] for name in ("position", "velocity")}
    found = starts(**small, belt_speed=4e-4, equilibrium_position=5e-4, title="a $title")
    figure = basin_figure(**found)
    (axes,) = figure.axes
    assert axes.get_xlabel() == "initial displacement $x(0)$ (mm)"
    assert axes.get_ylabel() == "initial velocity $x'(0)$ (mm/s)"
    assert figure.get_suptitle().startswith("a $title\n")
    *_, belt, equilibrium = axes.lines
    assert belt.get_ydata() == pytest.approx([0.4, 0.4])
    assert equilibrium.get_xdata() == pytest.approx([0.5])
    (axes,) = basin_figure(**found, units=Units(dimensionless=True)).axes
    assert axes.get_xlabel() == "initial displacement $X(0)$ (dimensionless)"
    assert axes.lines[-1].get_xdata() == [5e-4]


def test_of_a_grid_each_basin_has_its_area(tmp_path: Path) -> None:
    path = drawn(tmp_path / "basin.png", grid_shape=(30, 40))
    sticks, rests = shares(path, ORANGE, GREEN)
    # Its hatch takes some of the second one.
    assert 0.6 < rests / sticks / (np.pi / 2.0 / (8.0 - np.pi / 2.0)) < 0.9


def test_basins_differ_in_more_than_colour() -> None:
    regimes = [Regime.STICK_SLIP, Regime.PURE_SLIP, Regime.EQUILIBRIUM] * 7
    number = np.arange(1200) % len(regimes)
    found = starts(attractor=number, regimes=regimes, labels=[str(n) for n in range(len(regimes))])
    legends = [
        basin_figure(**found | {"grid_shape": shape}).legends[0].legend_handles
        for shape in ((30, 40), None)
    ]
    patches, points = (legend[: len(regimes)] for legend in legends)
    assert len({(patch.get_facecolor(), patch.get_hatch()) for patch in patches}) == len(regimes)
    assert len({(point.get_color(), point.get_marker()) for point in points}) == len(regimes)


def test_regimes_differ_in_more_than_colour() -> None:
    for place in ("marker", "label", "colour"):
        assert len({getattr(look, place) for look in LOOKS.values()}) == len(LOOKS)
    # Those that have none are as different as dark and bright.
    assert [regime for regime, look in LOOKS.items() if not look.hatch] == [
        Regime.STICK_SLIP,
        Regime.UNBOUNDED,
    ]


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
    for found, expected in zip(
        shares(other, ORANGE, GREEN), shares(one, ORANGE, GREEN), strict=True
    ):
        assert found == pytest.approx(expected, rel=0.02)


def test_two_attractors_of_one_regime_have_two_colours(tmp_path: Path) -> None:
    regimes = [Regime.STICK_SLIP, Regime.STICK_SLIP]
    path = drawn(tmp_path / "basin.png", grid_shape=(30, 40), regimes=regimes)
    assert min(shares(path, ORANGE, SKY_BLUE)) > 0.02


def test_the_belt_line_hides_no_points() -> None:
    (axes,) = basin_figure(**starts()).axes
    assert "white" not in {line.get_color() for line in axes.lines if line.get_marker() == "None"}


@pytest.mark.parametrize("style", STYLES)
def test_no_text_is_cut_off_or_overlaps(style: str) -> None:
    assert faults(basin_figure(**starts(grid_shape=(30, 40)), style=STYLES[style])) == []
