"""The figures of studies: diagrams and maps of sweeps, and basins of attraction."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.show import BLUE, GREEN, LIGHT_GREY, ORANGE
from stickslip_ros.show.regimes import REGIMES
from stickslip_ros.show.study_figure import basin_figure, diagram_figure, map_figure
from stickslip_ros.show.style import STYLES
from stickslip_ros.studies.basin import POSITION, VELOCITY, Attractor
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.plan import Axis, Continuation, Grid, Plan, RandomSample
from stickslip_ros.studies.runner import compute_columns
from stickslip_ros.studies.settling import SettlingOptions
from stickslip_ros.studies.study import Study
from tests.show.texts import faults, in_styles, legend_texts
from tests.studies.studies import EXPONENTIAL

pytestmark = pytest.mark.usefixtures("coarse_maps")


FREE = "plant.expects_control=false"
LINEAR = "plant.friction.law=linear"

SHADED = "up and down differ (hysteresis)"

Swept = tuple[Columns, Study]


def swept(
    *over: str, overrides: tuple[str, ...] = (FREE,), carry: Continuation | None = None
) -> Swept:
    axes = tuple(Axis.parse(text) for text in over)
    study = Study(load_scenario("paper", overrides), Grid(axes, carry), SettlingOptions(60.0, 3))
    return compute_columns(study), study


@pytest.fixture(scope="module")
def over_two() -> Swept:
    """Of which the static coefficients below the minimum, 0.25, cannot be."""
    return swept("plant.friction.static=0.1:0.6:6", "plant.belt_speed=0.1:0.7:5:log")


def places(axes: Axes) -> dict[str, Any]:
    """Return the middles of the cells of each colour in a map, a row each."""
    found: dict[str, Any] = {}
    for mesh in axes.collections:
        shown = getattr(mesh, "cmap", None) and mesh.get_array()
        if shown is not None and np.ndim(shown) == 2:
            corners: Any = mesh.get_coordinates()
            middles = (corners[:-1, :-1] + corners[1:, 1:]) / 2.0
            found[to_hex(mesh.cmap(0)).upper()] = middles[~np.ma.getmaskarray(shown)]
    return found


def cells(axes: Axes) -> dict[str, tuple[float, float, int]]:
    """Return the middle of the cells of each colour in a map, and how many they are."""
    return {
        colour: (*map(float, each.mean(axis=0)), len(each)) for colour, each in places(axes).items()
    }


def test_a_diagram_names_axes_regimes_and_transitions() -> None:
    figure = diagram_figure(*swept("plant.belt_speed=0.1:0.8:15"))
    assert faults(figure) == []
    section, amplitude, stick_fraction = figure.axes
    assert section.get_ylabel() == "turning points $X$"
    assert amplitude.get_ylabel() == "amplitude"
    assert stick_fraction.get_ylabel() == "stick fraction"
    assert stick_fraction.get_xlabel() == "belt speed $v_0$ (dimensionless)"
    assert "no control" in figure.get_suptitle()
    assert legend_texts(figure) == [
        "stick-slip", "pure slip", "steady sliding", "not steady yet",
        "critical feed speed (Hopf) 0.48876", "stick-slip onset speed 0.43947",
    ]  # fmt: skip
    shown = {line.get_color(): line.get_marker() for line in section.lines if len(line.get_xdata())}
    assert {shown[ORANGE], shown[BLUE], shown[GREEN]} == {"o", "^", "s"}


def test_where_up_and_down_differ_a_diagram_is_shaded() -> None:
    over = "plant.belt_speed=0.8:2.2:15"
    both_ways = swept(over, overrides=EXPONENTIAL, carry=Continuation.BOTH)
    figure = diagram_figure(*both_ways, style=STYLES["paper-double"])
    assert faults(figure) == []
    legend = legend_texts(figure)
    assert {"carried up", "carried down", SHADED, "critical feed speed (Hopf) 1.1513"} <= {*legend}
    for axes in figure.axes:
        (shaded,) = axes.collections
        corners = np.concatenate([path.vertices for path in shaded.get_paths()])
        assert np.ptp(corners[:, 0]) == pytest.approx(0.7, abs=0.11)  # from 1.1 to 1.8 m/s


def test_where_up_and_down_agree_nothing_is_shaded() -> None:
    figure = diagram_figure(*swept("plant.belt_speed=0.1:0.3:5", carry=Continuation.BOTH))
    assert SHADED not in legend_texts(figure)
    assert not any(axes.collections for axes in figure.axes)


def test_points_without_turning_points_are_not_left_out() -> None:
    # A static coefficient below the minimum, 0.25, cannot be. The axis is logarithmic, and falls.
    figure = diagram_figure(*swept("plant.friction.static=0.3:0.03:4:log"))
    assert "no result" in legend_texts(figure)
    assert figure.axes[-1].get_xscale() == "log"


def test_an_axis_may_be_logarithmic_below_zero() -> None:
    overrides = (FREE, "plant.belt_speed=0.3", "plant.damping=0.03")
    figure = diagram_figure(*swept("plant.belt_speed=-0.01:-1.0:7:log", overrides=overrides))
    assert "critical feed speed (Hopf) -0.48305" in legend_texts(figure)
    # What varies is not in the title.
    title = "Bifurcation diagram, paper plant.damping=0.03, no control"
    assert figure.get_suptitle() == title


@in_styles
def test_a_map_has_each_regime_where_it_is(over_two: Swept, style: str) -> None:
    """Static coefficients from left to right, belt speeds upward, on a logarithmic axis."""
    figure = map_figure(*over_two, style=STYLES[style])
    assert faults(figure) == []
    (axes,) = figure.axes
    assert axes.get_xlabel() == r"static friction coefficient $\mu_s$"
    assert axes.get_xlim() == pytest.approx((0.1, 0.6))
    assert axes.get_ylim() == pytest.approx((0.1, 0.7))
    assert {"stick-slip", "no result", "Hopf bifurcation", "stick-slip onset"} <= set(
        legend_texts(figure)
    )
    found = cells(axes)
    sticks, rests = found[ORANGE], found[GREEN]
    assert sticks[0] > rests[0]
    assert 0.1 < sticks[1] < rests[1] < 0.7
    assert min(sticks[2], rests[2]) > 3 > found.get(BLUE, (0.0, 0.0, 0))[2]


@in_styles
def test_the_map_of_a_measure_has_a_colour_bar(over_two: Swept, style: str) -> None:
    figure = map_figure(*over_two, "amplitude", style=STYLES[style])
    assert faults(figure) == []
    _, bar = figure.axes
    assert bar.get_ylabel() == "amplitude (dimensionless)"
    assert set(legend_texts(figure)) == {"no result", "Hopf bifurcation", "stick-slip onset"}


@pytest.mark.long
def test_a_map_carried_both_ways_has_two_panels() -> None:
    found = swept(
        "plant.damping=0.08:0.1:2",
        "plant.belt_speed=0.8:2.2:8",
        overrides=EXPONENTIAL,
        carry=Continuation.BOTH,
    )
    up, down = map_figure(*found).axes
    assert [axes.get_title() for axes in (up, down)] == [
        f"carried {direction} along the belt speed $v_0$" for direction in ("up", "down")
    ]
    assert cells(down)[GREEN][2] > 1.5 * cells(up)[GREEN][2]


def test_beside_a_colour_bar_what_runs_away_is_grey() -> None:
    overrides = (FREE, LINEAR, "plant.belt_speed=0.2")
    found = swept("plant.friction.slope=0.7:0.9:2", "plant.damping=0.0:0.1:2", overrides=overrides)
    figure = map_figure(*found, "amplitude")
    assert cells(figure.axes[0])[LIGHT_GREY][2] >= 1
    assert "unbounded" in legend_texts(figure)


MANY = [Regime.STICK_SLIP, Regime.PURE_SLIP, Regime.EQUILIBRIUM] * 7
BASINS = [
    Attractor(Regime.STICK_SLIP, True, 0.318, 0.1, 825, 0.688, 0.007),
    Attractor(Regime.EQUILIBRIUM, True, None, None, 375, 0.312, 0.007),
]
X, Y = Axis(POSITION, -2.0, 2.0, 40), Axis(VELOCITY, -1.0, 1.0, 30)
POSITIONS, VELOCITIES = (
    each.ravel() for each in np.meshgrid(X.values(), Y.values(), indexing="ij")
)


def at_rest(position: npt.NDArray[Any], velocity: npt.NDArray[Any]) -> npt.NDArray[np.intp]:
    """Return which starts are within an ellipse around an equilibrium at rest; others vibrate."""
    return ((position - 0.25) ** 2 + 4.0 * velocity**2 < 1.0).astype(np.intp)


def drawn_basins(
    plan: Plan,
    position: npt.NDArray[Any],
    velocity: npt.NDArray[Any],
    attractor: npt.NDArray[np.intp],
    attractors: Sequence[Attractor],
    *,
    scenario: str = "paper",
    style: str = "screen",
) -> Figure:
    study: Any = Study(load_scenario(scenario, [FREE]), plan, SettlingOptions())
    values = {POSITION: position, VELOCITY: velocity}
    columns: Any = SimpleNamespace(values=values)
    basins: Any = SimpleNamespace(attractors=attractors, places=attractor)
    return basin_figure(columns, basins, study, style=STYLES[style])


@in_styles
def test_of_a_grid_each_basin_has_its_cells(style: str) -> None:
    found = at_rest(POSITIONS, VELOCITIES)
    figure = drawn_basins(Grid((X, Y)), POSITIONS, VELOCITIES, found, BASINS, style=style)
    assert faults(figure) == []
    (axes,) = figure.axes
    assert axes.get_xlabel() == "initial displacement $X(0)$ (dimensionless)"
    for number, colour in enumerate((ORANGE, GREEN)):
        of_it = found == number
        starts = np.column_stack([POSITIONS, VELOCITIES])[of_it].round(9)
        drawn = places(axes)[colour].round(9)
        assert sorted(map(tuple, drawn.tolist())) == sorted(map(tuple, starts.tolist()))
    assert legend_texts(figure) == [
        "stick-slip, amplitude 0.318: 68.8 % ± 0.7 %", "steady sliding: 31.2 % ± 0.7 %",
        "belt speed", "equilibrium",
    ]  # fmt: skip
    assert "the motion that each of 1200 starts leads to" in figure.get_suptitle().replace(
        "\n", " "
    )


def test_scattered_starts_are_in_the_units_of_the_drive() -> None:
    attractors = [Attractor(regime, True, None, None) for regime in MANY]
    sample = RandomSample((X, Y), 1200, 1)
    starts = 1e-3 * POSITIONS, 1e-3 * VELOCITIES, np.arange(1200) % len(MANY)
    figure = drawn_basins(sample, *starts, attractors, scenario="feed_drive")
    (axes,) = figure.axes
    assert axes.get_xlabel() == "initial displacement $x(0)$ (mm)"
    assert axes.get_ylabel() == "initial velocity $x'(0)$ (mm/s)"
    *_, belt, equilibrium = axes.lines
    assert belt.get_ydata() == pytest.approx([40.0, 40.0])
    assert equilibrium.get_xdata() == pytest.approx([0.2584], abs=1e-4)
    # The line of the belt speed hides no points.
    assert "white" not in {line.get_color() for line in axes.lines if line.get_marker() == "None"}
    points: Any = figure.legends[0].legend_handles[: len(MANY)]
    assert len({(point.get_color(), point.get_marker()) for point in points}) == len(MANY)


def test_regimes_differ_in_more_than_colour() -> None:
    for place in ("marker", "label", "colour"):
        assert len({getattr(look, place) for look in REGIMES.values()}) == len(REGIMES)
