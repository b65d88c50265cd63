"""The figure of basins of attraction."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_hex

from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.plots.basin_figure import basin_figure
from stickslip_ros.plots.regimes import REGIMES as LOOKS
from stickslip_ros.plots.style import GREEN, ORANGE, STYLES
from stickslip_ros.plots.units import Units
from tests.plots.texts import faults, in_styles, legend_texts

LABELS = ["stick-slip, amplitude 0.318 m: 68.8 % +- 0.7 %", "equilibrium: 31.2 %"]
MANY = [Regime.STICK_SLIP, Regime.PURE_SLIP, Regime.EQUILIBRIUM] * 7

X, Y = np.linspace(-2.0, 2.0, 40), np.linspace(-1.0, 1.0, 30)

Cells = set[tuple[float, float]]


def starts(**changes: Any) -> dict[str, Any]:
    """Return starts within an ellipse around the equilibrium at rest, and the others vibrating."""
    position, velocity = (axis.ravel() for axis in np.meshgrid(X, Y))
    given: dict[str, Any] = {
        "position": position,
        "velocity": velocity,
        "attractor": at_rest(position, velocity).astype(np.intp),
        "regimes": [Regime.STICK_SLIP, Regime.EQUILIBRIUM],
        "labels": LABELS,
        "grid_shape": None,
        "belt_speed": 0.4,
        "equilibrium_position": 0.5,
    }
    return given | changes


def at_rest(position: npt.NDArray[Any], velocity: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    return (position - 0.5) ** 2 + 4.0 * velocity**2 < 1.0


def filled(axes: Axes) -> dict[str, Cells]:
    """Return the middles of the cells of each colour."""
    found: dict[str, Cells] = {}
    for mesh in axes.collections:
        assert isinstance(mesh, QuadMesh)
        corners = np.asarray(mesh.get_coordinates())
        middles = (corners[:-1, :-1] + corners[1:, 1:]) / 2.0
        shown = ~np.ma.getmaskarray(mesh.get_array())
        cells = middles[shown.reshape(middles.shape[:2])].round(9)
        found[to_hex(mesh.cmap(0)).upper()] = {(float(x), float(y)) for x, y in cells}
    return found


@in_styles
def test_of_a_grid_each_basin_has_its_cells(style: str) -> None:
    figure = basin_figure(**starts(grid_shape=(30, 40)), style=STYLES[style])
    assert faults(figure) == []
    (axes,) = figure.axes
    cells = {(float(x.round(9)), float(y.round(9))) for y in Y for x in X}
    rests = {cell for cell in cells if at_rest(*np.array(cell))}
    assert filled(axes) == {ORANGE: cells - rests, GREEN: rests}
    assert legend_texts(figure) == [*LABELS, "belt speed", "equilibrium"]
    assert "the motion that each of 1200 starts leads to" in figure.get_suptitle().replace(
        "\n", " "
    )


def test_a_grid_may_have_the_velocities_first() -> None:
    velocity, position = (axis.ravel() for axis in np.meshgrid(Y, X))
    # There are as many attractors as look different.
    attractor = np.arange(1200) % len(MANY)
    figure = basin_figure(
        **starts(
            position=position,
            velocity=velocity,
            attractor=attractor,
            grid_shape=(40, 30),
            regimes=MANY,
            labels=[str(n) for n in range(len(MANY))],
        ),
        units=Units(dimensionless=True),
    )
    (axes,) = figure.axes
    assert axes.get_xlabel() == "initial displacement $X(0)$ (dimensionless)"
    assert axes.lines[-1].get_xdata() == [0.5]
    first = attractor == 0
    expected = np.column_stack([position[first], velocity[first]]).round(9)
    assert filled(axes)[ORANGE] >= {(float(x), float(y)) for x, y in expected}
    patches: Any = figure.legends[0].legend_handles[: len(MANY)]
    assert len({(patch.get_facecolor(), patch.get_hatch()) for patch in patches}) == len(MANY)


def test_scattered_starts_are_in_the_units_of_the_drive() -> None:
    small = {name: 1e-3 * starts()[name] for name in ("position", "velocity")}
    given = starts(
        **small,
        belt_speed=4e-4,
        equilibrium_position=5e-4,
        attractor=np.arange(1200) % len(MANY),
        regimes=MANY,
        labels=[str(n) for n in range(len(MANY))],
    )
    figure = basin_figure(**given, title="a $title")
    (axes,) = figure.axes
    assert axes.get_xlabel() == "initial displacement $x(0)$ (mm)"
    assert axes.get_ylabel() == "initial velocity $x'(0)$ (mm/s)"
    assert figure.get_suptitle().startswith("a $title\n")
    *_, belt, equilibrium = axes.lines
    assert belt.get_ydata() == pytest.approx([0.4, 0.4])
    assert equilibrium.get_xdata() == pytest.approx([0.5])
    # The line of the belt speed hides no points.
    assert "white" not in {line.get_color() for line in axes.lines if line.get_marker() == "None"}
    points: Any = figure.legends[0].legend_handles[: len(MANY)]
    assert len({(point.get_color(), point.get_marker()) for point in points}) == len(MANY)


def test_regimes_differ_in_more_than_colour() -> None:
    for place in ("marker", "label", "colour"):
        assert len({getattr(look, place) for look in LOOKS.values()}) == len(LOOKS)
    # Those that have none are as different as dark and bright.
    assert [regime for regime, look in LOOKS.items() if not look.hatch] == [
        Regime.STICK_SLIP,
        Regime.UNBOUNDED,
    ]
