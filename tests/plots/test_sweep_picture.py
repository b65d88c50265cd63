"""The plots of sweeps: diagrams over one parameter, maps over two."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from stickslip_ros.plots.style import BLUE, GREEN, LIGHT_GREY, ORANGE, STYLES, save
from stickslip_ros.plots.sweep_picture import diagram_figure, map_figure
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.studies.columns import Columns
from stickslip_ros.studies.journal import Journal
from stickslip_ros.studies.plan import Axis, Carry, Grid
from stickslip_ros.studies.runner import run
from stickslip_ros.studies.settling import SettlingCourse
from stickslip_ros.studies.study import Study
from tests.plots.texts import faults

pytestmark = pytest.mark.usefixtures("coarse_maps")

FREE = "plant.expects_control=false"
LINEAR = "plant.friction.law=linear"
HYSTERESIS = (
    FREE,
    "plant.friction.law=exponential",
    "plant.friction.static=1.0",
    "plant.friction.kinetic=0.5",
    "plant.friction.decay_speed=0.5",
    "plant.damping=0.1",
)

Swept = tuple[Columns, Study]


def swept(*over: str, overrides: tuple[str, ...] = (FREE,), carry: Carry | None = None) -> Swept:
    axes = tuple(Axis.parse(text) for text in over)
    study = Study(load_scenario("paper", overrides), Grid(axes, carry), SettlingCourse(60.0, 3))
    with Journal(study) as journal:
        run(journal)
        return Columns.from_journal(journal), study


@pytest.fixture(scope="module")
def over_speed() -> Swept:
    return swept("plant.belt_speed=0.1:0.8:15")


@pytest.fixture(scope="module")
def both_ways() -> Swept:
    return swept("plant.belt_speed=0.8:2.2:15", overrides=HYSTERESIS, carry=Carry.BOTH)


@pytest.fixture(scope="module")
def over_two() -> Swept:
    """Of which the static coefficients below the minimum, 0.25, cannot be."""
    return swept("plant.friction.static=0.1:0.6:6", "plant.belt_speed=0.1:0.7:5")


def diagram(path: Path, found: Swept) -> str:
    save(diagram_figure(*found), path)
    return path.read_text(encoding="utf-8")


def pixels(path: Path) -> npt.NDArray[np.uint8]:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def share(path: Path, colour: str) -> float:
    """Return what share of the picture has the colour."""
    wanted = [int(colour[start : start + 2], 16) for start in (1, 3, 5)]
    return float((pixels(path) == wanted).all(axis=-1).mean())


@pytest.mark.parametrize(("ending", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml")])
def test_the_format_follows_the_ending(
    tmp_path: Path, over_speed: Swept, over_two: Swept, ending: str, start: bytes
) -> None:
    path = tmp_path / f"picture{ending}"
    save(diagram_figure(*over_speed), path)
    assert path.read_bytes().startswith(start)
    path.unlink()
    save(map_figure(*over_two), path)
    assert path.read_bytes().startswith(start)


def test_a_diagram_names_axes_regimes_and_transitions(tmp_path: Path, over_speed: Swept) -> None:
    picture = diagram(tmp_path / "diagram.svg", over_speed)
    section, amplitude, stick_fraction = diagram_figure(*over_speed).axes
    assert section.get_ylabel() == "turning points $X$"
    assert amplitude.get_ylabel() == "amplitude"
    assert stick_fraction.get_xlabel() == "belt speed $v_0$ (dimensionless)"
    for text in ("stick-slip", "equilibrium", "stick fraction", "no control"):
        assert text in picture
    for text in ("Hopf point 0.48876", "limit of sticking 0.43947"):
        assert text in picture
    for text in ("unbounded", "no result", "carried", "hysteresis"):
        assert text not in picture


def test_a_study_that_varies_the_scales_is_in_si() -> None:
    figure = diagram_figure(*swept("plant.stiffness=1e4:4e4:3", overrides=(FREE, "plant.mass=1")))
    section, amplitude, _ = figure.axes
    assert section.get_ylabel() == "turning points $x$ (µm)"
    assert amplitude.get_ylabel() == "amplitude (µm)"
    assert figure.axes[-1].get_xlabel() == "stiffness $k$ (N/m)"


def test_regimes_of_a_diagram_have_markers_of_their_own(over_speed: Swept) -> None:
    section, *_ = diagram_figure(*over_speed).axes
    shown = {line.get_color(): line.get_marker() for line in section.lines if len(line.get_xdata())}
    assert {shown[ORANGE], shown[BLUE], shown[GREEN]} == {"o", "^", "s"}


def test_where_up_and_down_differ_a_diagram_is_shaded(tmp_path: Path, both_ways: Swept) -> None:
    picture = diagram(tmp_path / "diagram.svg", both_ways)
    for text in ("carried up", "carried down", "hysteresis", "Hopf point 1.1513"):
        assert text in picture
    path = tmp_path / "diagram.png"
    save(diagram_figure(*both_ways), path)
    shaded = (pixels(path) == [0xFB, 0xF6, 0xC9]).all(axis=-1).any(axis=0)
    columns = np.flatnonzero(shaded)
    assert 0.4 < np.ptp(columns) / len(shaded) < 0.6  # of 0.8 to 2.2 m/s, 1.1 to 1.8


def test_where_up_and_down_agree_nothing_is_shaded(tmp_path: Path) -> None:
    found = swept("plant.belt_speed=0.1:0.3:5", carry=Carry.BOTH)
    assert "hysteresis" not in diagram(tmp_path / "diagram.svg", found)


def test_points_without_turning_points_are_not_left_out(tmp_path: Path) -> None:
    overrides = (FREE, LINEAR, "plant.belt_speed=0.2")
    runs_away = swept("plant.friction.slope=0.7:0.9:3", overrides=overrides)
    assert "unbounded" in diagram(tmp_path / "away.svg", runs_away)
    impossible = swept("plant.friction.static=0.1:0.3:3")
    assert "no result" in diagram(tmp_path / "impossible.svg", impossible)


@pytest.mark.parametrize("ends", ["0.5:0.005", "0.005:0.5"])
def test_a_logarithmic_axis_is_drawn_so(tmp_path: Path, ends: str) -> None:
    picture = diagram(tmp_path / "diagram.svg", swept(f"plant.damping={ends}:7:log"))
    assert r"$\mathdefault{10^{-2}}$" in picture


def test_an_axis_may_be_logarithmic_below_zero(tmp_path: Path) -> None:
    found = swept("plant.belt_speed=-0.01:-1.0:7:log")
    assert "Hopf point -0.48876" in diagram(tmp_path / "diagram.svg", found)


@pytest.mark.parametrize(
    ("colour", "label"),
    [
        ("regime", "stick-slip"),
        ("amplitude", "amplitude (dimensionless)"),
        ("stick_fraction", "fraction"),
    ],
)
def test_a_map_says_what_its_colours_are(
    tmp_path: Path, over_two: Swept, colour: str, label: str
) -> None:
    path = tmp_path / "map.svg"
    figure = map_figure(*over_two, colour)
    assert figure.axes[0].get_xlabel() == r"static friction coefficient $\mu_s$"
    save(figure, path)
    picture = path.read_text(encoding="utf-8")
    for text in (label, "no result", "Hopf point", "limit of sticking"):
        assert text in picture


def test_a_map_has_each_point_where_it_is(tmp_path: Path, over_two: Swept) -> None:
    """Static coefficients from left to right, belt speeds upward."""
    path = tmp_path / "map.png"
    save(map_figure(*over_two), path)
    found = pixels(path)
    inside = found[100:-150, 150:-100]
    assert [0x00, 0x9E, 0x73] in inside[:20, -1].tolist()
    assert inside[-1, -1].tolist() == [0xD5, 0x5E, 0x00]
    assert share(path, GREEN) > 0.1
    assert share(path, ORANGE) > 0.1
    assert share(path, BLUE) < 0.1


@pytest.mark.parametrize("spacing", ["", ":log"])
def test_a_map_ends_where_the_sweep_does(spacing: str) -> None:
    over = (f"plant.damping=0.01:0.08:3{spacing}", f"plant.belt_speed=0.1:0.7:3{spacing}")
    (axes,) = map_figure(*swept(*over)).axes
    assert axes.get_xlim() == pytest.approx((0.01, 0.08))
    assert axes.get_ylim() == pytest.approx((0.1, 0.7))


def test_a_stick_fraction_has_no_prefix() -> None:
    si = (FREE, "plant.mass=100.0", "plant.stiffness=1e6", "plant.normal_force=1000.0")
    over = ("plant.damping=0:800:3", "plant.belt_speed=0.002:0.06:3")
    figure = map_figure(*swept(*over, overrides=si), "stick_fraction")
    bar = figure.axes[-1]
    assert bar.get_ylabel() == "stick fraction"
    assert bar.get_ylim()[1] <= 1.0


def test_a_map_carried_both_ways_has_two_panels(tmp_path: Path) -> None:
    found = swept(
        "plant.damping=0.08:0.1:2",
        "plant.belt_speed=0.8:2.2:8",
        overrides=HYSTERESIS,
        carry=Carry.BOTH,
    )
    assert [axes.get_title() for axes in map_figure(*found).axes] == [
        f"carried {direction} along the belt speed $v_0$" for direction in ("up", "down")
    ]
    path = tmp_path / "map.png"
    save(map_figure(*found), path)
    green = (pixels(path) == [0x00, 0x9E, 0x73]).all(axis=-1)
    left, right = np.array_split(green, 2, axis=1)
    assert right.sum() > 1.5 * left.sum()


def test_beside_a_colour_bar_what_runs_away_is_grey(tmp_path: Path) -> None:
    overrides = (FREE, LINEAR, "plant.belt_speed=0.2")
    found = swept("plant.friction.slope=0.7:0.9:2", "plant.damping=0.0:0.1:2", overrides=overrides)
    path = tmp_path / "map.png"
    save(map_figure(*found, "amplitude"), path)
    assert share(path, LIGHT_GREY) > 0.2


def test_under_sampled_control_there_is_a_limit_of_stability(tmp_path: Path) -> None:
    found = swept("washout_controller.linear_gain=-1.5:0.5:3", overrides=("plant.rate=20",))
    assert "limit of stability -0.8" in diagram(tmp_path / "diagram.svg", found)


def test_the_title_omits_overrides_of_the_parameter_that_varies() -> None:
    columns, study = swept(
        "plant.belt_speed=0.5:0.6:2", overrides=(FREE, "plant.belt_speed=0.3", "plant.damping=0.03")
    )
    title = diagram_figure(columns, study).get_suptitle()
    assert title == "Bifurcation diagram, paper plant.damping=0.03, no control"


@pytest.mark.parametrize("style", STYLES)
def test_no_text_is_cut_off_or_overlaps(
    over_speed: Swept, both_ways: Swept, over_two: Swept, style: str
) -> None:
    look = STYLES[style]
    for found in (over_speed, both_ways):
        assert faults(diagram_figure(*found, style=look)) == []
    for colour in ("regime", "amplitude"):
        assert faults(map_figure(*over_two, colour, style=look)) == []
