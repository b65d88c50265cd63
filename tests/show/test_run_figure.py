"""The figures of a run and of several, and the history kept for them."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import stickslip_ros as ss
from benchmarks.measures_under_noise import motion
from stickslip_ros.measures.cycle_measures import Cycle, Measures, measures_of
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.measures.run_meter import RunAnalysis
from stickslip_ros.measures.sample_assumptions import SampleAssumptions
from stickslip_ros.measures.sample_meter import MeasuredMotion, SampleMeter
from stickslip_ros.model.drive import Drive
from stickslip_ros.motion import RecordedMotion
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.samples import SampleColumns
from stickslip_ros.show.drawing import with_edges
from stickslip_ros.show.run_figure import run_figure
from stickslip_ros.show.run_history import LAST_CYCLES, DrawnMotion, DrawnRun, RunHistory
from stickslip_ros.show.style import SCREEN, STYLES, FigureStyle
from tests.drives import FEED_DRIVE, PAPER
from tests.show.texts import faults, in_styles, legend_texts

# Old versions of matplotlib call names that its parser of formulas has deprecated since.
# What other tests left open is collected at any time.
pytestmark = pytest.mark.filterwarnings(
    "error", "ignore::DeprecationWarning", "ignore::ResourceWarning"
)

FloatArray = npt.NDArray[np.float64]

REFERENCE = Path(__file__).parents[2] / "bags" / "reference"

POSITION, POSITION_END, VELOCITY, VELOCITY_END, FORCE, FORCE_END = range(6)
PORTRAIT, AMPLITUDE, STICK_FRACTION, LAW = range(6, 10)
"""The panels in the order in which they are made."""


class Drawn(NamedTuple):
    history: RunHistory
    measures: Measures
    drive: Drive
    figure: Figure
    cycles: list[Cycle]

    def panel(self, number: int) -> Axes:
        return self.figure.axes[number]

    def line(self, panel: int, number: int) -> FloatArray:
        """Return x and y of a line as drawn."""
        return np.asarray(self.panel(panel).lines[number].get_xydata(), dtype=float).T


def figure_of(
    history: RunHistory,
    measures: Measures,
    drive: Drive | None,
    *,
    notes: Sequence[str] = (),
    style: FigureStyle = SCREEN,
) -> Figure:
    return run_figure(DrawnRun("run", history, measures, drive, notes, "it"), style=style)


def see(
    history: RunHistory,
    time: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    belt_velocity: FloatArray,
    friction: FloatArray,
) -> None:
    """Show samples that follow each other from 0 s on, as a recording of them is shown."""
    stamp = np.rint(time * 1e9).astype(np.int64)
    belt_position = np.full(len(stamp), np.nan)
    SampleMeter(20, history).feed(
        SampleColumns(stamp, position, velocity, friction, belt_position, belt_velocity)
    )
    history.take_friction(time, friction)


def all_acted(force: FloatArray) -> npt.NDArray[np.bool_]:
    return np.ones(len(force), dtype=bool)


@pytest.fixture(scope="module")
def limit_cycle() -> Drawn:
    """A motion from rest, sampled at 64 points in a natural period, for 100 s."""
    history, meter, cycles = RunHistory(), CycleMeter(20), list[Cycle]()
    motion = RecordedMotion(PAPER, 0.0, 0.0)
    step = PAPER.natural_period / 64.0
    for _ in range(round(100.0 / step)):
        motion.advance(step)
        breakpoints = motion.take_breakpoints()
        done = meter.feed(breakpoints, PAPER.belt_speed)
        belt = np.full(len(breakpoints), PAPER.belt_speed)
        history.take_motion(MeasuredMotion(breakpoints, belt, done, meter.ends))
        history.take_friction(breakpoints.time, breakpoints.position)
        cycles += done
    measures = meter.measures()
    return Drawn(history, measures, PAPER, figure_of(history, measures, PAPER), cycles)


@pytest.fixture(scope="module")
def reference() -> Drawn:
    history = RunHistory()
    report = report_of_recording(REFERENCE, observer=history)
    measures = measures_of(report)
    figure = figure_of(history, measures, FEED_DRIVE)
    return Drawn(history, measures, FEED_DRIVE, figure, [])


def titles(figure: Figure) -> list[str]:
    return [axes.get_title() for axes in figure.axes]


def test_axes_are_in_si_with_prefixes(reference: Drawn) -> None:
    assert faults(reference.figure) == []
    axes = reference.figure.axes
    assert {label for each in axes for label in (each.get_xlabel(), each.get_ylabel())} == {
        "", "time (s)", "displacement $x$ (µm)", "velocity $x'$ (mm/s)", "force (N)",
        "amplitude (µm)", "stick fraction", "velocity relative to the belt $v_r$ (mm/s)",
        r"friction coefficient $\mu$",
    }  # fmt: skip
    # No force is missing in the bag.
    assert "no new force: last one" not in legend_texts(reference.figure)


def test_lines_have_every_extreme_of_the_bag(reference: Drawn) -> None:
    with Recording(REFERENCE) as recording:
        states, forces = recording.joint_states, recording.control_forces
    time, position = reference.line(POSITION, 1)
    assert (time[0], time[-1]) == (0.0, 3.0)
    # Between samples it turns, so that the extremes lie a little beyond theirs.
    for drawn, sampled in ((position.max(), states.position.max()), (position.min(), -1.08e-4)):
        assert drawn * 1e-6 == pytest.approx(sampled, rel=5e-3)
    assert position.max() * 1e-6 >= states.position.max()
    _, velocity = reference.line(VELOCITY, 1)
    assert velocity.max() * 1e-3 == pytest.approx(states.velocity.max(), rel=1e-12)
    assert velocity.min() * 1e-3 == pytest.approx(states.velocity.min(), rel=1e-4)
    assert velocity.min() * 1e-3 <= states.velocity.min()
    _, force = reference.line(FORCE, 1)
    assert (force.min(), force.max()) == (forces.force.min(), forces.force.max())


def test_the_shade_is_the_share_of_time_that_it_sticks(limit_cycle: Drawn) -> None:
    for panel in (POSITION_END, VELOCITY_END, FORCE_END):
        (shade,) = limit_cycle.panel(panel).images
        share = float(np.mean(shade.get_array()))
        # Of five periods, but for a step.
        assert share == pytest.approx(limit_cycle.measures.stick_fraction, abs=0.1 / 32.0)
    (whole,) = limit_cycle.panel(VELOCITY).images
    assert np.mean(whole.get_array()) * 100.0 == pytest.approx(
        sum(cycle.stick_fraction * cycle.period for cycle in limit_cycle.cycles), abs=1.0
    )


def test_the_end_is_the_last_cycles(limit_cycle: Drawn) -> None:
    start, end = limit_cycle.panel(POSITION_END).get_xlim()
    assert end - start == pytest.approx(LAST_CYCLES * limit_cycle.measures.period, rel=0.01)
    assert end == pytest.approx(100.0, abs=0.1)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_stick_that_single_cycles_do_not_tell_is_no_zero(tmp_path: Path, noise: float) -> None:
    time = np.arange(0.0, 8.0, 0.002)
    turn = np.floor(time / 0.8)
    slip = np.maximum(time / 0.8 - turn - 0.85, 0.0) / 0.15
    position = 3.2e-3 * (turn + (1.0 - np.cos(np.pi * slip)) / 2.0)
    position += noise * np.random.default_rng(1).standard_normal(len(time))
    rows = np.column_stack([time, 2e-6 * np.round(position / 2e-6)])
    np.savetxt(tmp_path / "axis.csv", rows, delimiter=",", header="t [s],x [m]", comments="")
    run = ss.read_table(tmp_path / "axis.csv", {"time": "t", "position": "x"})
    panels = run.draw(SCREEN).axes
    (panel,) = [axes for axes in panels if axes.get_ylabel() == "stick fraction"]
    if noise:
        assert [text.get_text() for text in panel.texts] == ["not known of single cycles"]
        assert not panel.lines
    else:
        assert panel.lines[0].get_ydata()[1:] == pytest.approx(0.85, abs=0.02)


def test_the_portrait_has_belt_speed_and_equilibrium(reference: Drawn) -> None:
    *_, belt, equilibrium = reference.panel(PORTRAIT).lines
    assert set(belt.get_ydata()) == {40.0}
    ((x, y),) = equilibrium.get_xydata()
    assert x == pytest.approx(FEED_DRIVE.equilibrium_position * 1e6, rel=1e-12)
    assert y == 0.0
    _, rest = reference.line(POSITION, 0)
    assert rest == pytest.approx(x, rel=1e-12)


def test_a_belt_that_changes_its_speed_moves_the_equilibrium() -> None:
    history = RunHistory()
    time = np.arange(0.0, 10.0, 0.01)
    belt = np.where(time < 5.0, 0.4, 0.2)
    none = np.full(len(time), np.nan)
    see(history, time, np.sin(time), 0.1 * np.cos(time), belt, none)
    history.take_control(time, np.where(time < 9.9, 0.0, 3.0), all_acted(time))
    figure = figure_of(history, CycleMeter(20).measures(), PAPER)
    # What happens at the very end has no panel of its own.
    assert not any("switched on" in title for title in titles(figure))
    slow = replace(PAPER, belt_speed=0.2)
    *_, belt_line, equilibrium = figure.axes[PORTRAIT].lines
    assert equilibrium.get_xdata()[0] == slow.equilibrium_position
    assert set(belt_line.get_ydata()) == {0.2}
    rest = figure.axes[POSITION].lines[0].get_ydata()
    assert (rest[0], rest[-1]) == (PAPER.equilibrium_position, slow.equilibrium_position)
    assert set(figure.axes[VELOCITY].lines[0].get_ydata()) == {0.4, 0.2}


def test_the_friction_law_is_drawn_over_the_range_of_the_run(limit_cycle: Drawn) -> None:
    law = limit_cycle.panel(LAW)
    curve = np.array(law.lines[0].get_xydata()).T
    assert curve[1] == pytest.approx(PAPER.friction.coefficient(curve[0], -1.0), rel=1e-12)
    (span,) = law.patches
    motion = limit_cycle.history.motion
    extremes = np.array([motion.velocity.min(), motion.velocity.max()]) - 0.4
    drawn = span.get_path().get_extents(span.get_patch_transform())
    assert drawn.intervalx == pytest.approx(extremes)
    ((x, y),) = law.lines[-2].get_xydata()
    assert (x, y) == (-0.4, PAPER.equilibrium_position)


def test_without_a_drive_and_with_stamps_that_go_back_it_says_so() -> None:
    history = RunHistory()
    time = np.arange(0.0, 10.0, 0.01)
    ones = np.ones(len(time))
    for _ in range(2):
        see(history, time, np.sin(time), np.cos(time), 2.0 * ones, np.nan * ones)
        history.take_control(time, ones, all_acted(ones))
    assert np.all(np.diff(history.motion.time) > 0.0)
    assert np.all(np.diff(history.control.columns()[0]) > 0.0)
    figure = figure_of(history, CycleMeter(20).measures(), None, notes=["a $note"])
    assert titles(figure)[PORTRAIT:] == ["phase portrait"]  # no drive, no law; no cycle, no cycles
    assert len(figure.axes[PORTRAIT].lines) == 5
    title, measures, note, unknown, left_out = figure.get_suptitle().split("\n")
    assert (title, measures, note) == ("it", "no whole cycle", "a $note")
    assert unknown.startswith("it is not recorded what drive it was")
    assert left_out.startswith("not drawn: 1000 samples")
    assert "equilibrium" not in legend_texts(figure)
    # The control acts from the first sample on.
    assert not any("switched on" in title for title in titles(figure))


def test_gaps_of_samples_and_forces_are_not_drawn_over() -> None:
    history = RunHistory()
    time = np.r_[np.arange(0.0, 3.0, 0.01), np.arange(6.0, 9.0, 0.01)]
    ones = np.ones(len(time))
    # Sticking on both sides of the gap is not known to be sticking within.
    see(history, time, 0.1 * time, 0.4 * ones, 0.4 * ones, ones)
    came = (time <= 1.0) | (time >= 1.5)
    acted = (time <= 2.0) | (time >= 2.5)
    history.take_control(time[came], 7.0 * time[came], acted[came])
    figure = figure_of(history, CycleMeter(20).measures(), PAPER)

    def gaps(panel: int, number: int) -> list[tuple[float, float]]:
        x, y = np.array(figure.axes[panel].lines[number].get_xydata()).T
        missing = np.flatnonzero(np.isnan(y))
        return [(round(x[row - 1], 9), round(x[row + 1], 9)) for row in missing]

    for panel, number in ((POSITION, 1), (VELOCITY, 1), (FORCE, 0)):
        assert gaps(panel, number) == [(2.99, 6.0)]
    (shade,) = figure.axes[POSITION].images
    assert np.mean(shade.get_array()) == pytest.approx(5.98 / 8.99, rel=1e-3)
    # Where no force came the last one is dotted, and those that did not act are dots.
    assert gaps(FORCE, 1) == [(1.0, 1.5), (2.0, 2.5), (2.99, 6.0)]
    _, _, held, dropped = figure.axes[FORCE].lines
    assert held.get_linestyle() == ":"
    x, y = np.array(held.get_xydata()).T
    assert x[[0, 1, 3, 4]] == pytest.approx([1.0, 1.5, 2.99, 6.0])
    assert y[0] == pytest.approx(7.0)
    assert dropped.get_linestyle() == "None"
    x = np.asarray(dropped.get_xdata(), dtype=float)
    assert (x.min(), x.max()) == pytest.approx((2.01, 2.49))
    assert {"no new force: last one", "sent, did not act"} <= set(legend_texts(figure))
    # The control acts soon after the start.
    assert not any("switched on" in title for title in titles(figure))


def test_rounding_is_no_wave() -> None:
    history = RunHistory()
    time = np.arange(0.0, 3.0, 0.01)
    wave = np.sin(time)
    belt = np.full(len(time), 0.4)
    see(history, time, 0.25 + 1e-16 * wave, 1e-16 * wave, belt, 0.25 + 1e-16 * wave)
    figure = figure_of(history, CycleMeter(20).measures(), PAPER)
    for panel in (POSITION, VELOCITY, FORCE, PORTRAIT):
        bottom, top = figure.axes[panel].get_ylim()
        assert top - bottom >= 0.9e-6 * max(abs(bottom), abs(top))


@pytest.mark.parametrize(
    ("samples", "forces", "drive"),
    [
        (0, 0, None),
        pytest.param(0, 2, PAPER, marks=pytest.mark.long),
        pytest.param(1, 0, PAPER, marks=pytest.mark.long),
        pytest.param(2, 1, None, marks=pytest.mark.long),
    ],
)
def test_very_little_makes_a_figure_too(samples: int, forces: int, drive: Drive | None) -> None:
    history = RunHistory()
    column = np.arange(float(samples))
    see(history, column, column, column, column, column)
    history.take_control(np.arange(float(forces)), np.zeros(forces), np.ones(forces, dtype=bool))
    figure_of(history, CycleMeter(20).measures(), drive).draw_without_rendering()


def test_implausible_values_are_omitted() -> None:
    history = RunHistory()
    time = np.arange(0.0, 1.0, 0.01)
    position = np.where(np.arange(100) % 10 == 3, np.nan, 1e99)
    velocity = np.where(np.arange(100) % 10 == 5, np.inf, 1e101 * (time > 0.9))
    see(history, time, position, velocity, np.ones(100), np.full(100, np.inf))
    history.take_control(time, np.full(100, np.nan), np.zeros(100, dtype=bool))
    assert len(history.motion.time) < 90
    assert np.isfinite(history.motion).all()
    for trace in (history.friction, history.control):
        assert len(trace.columns()[0]) == 0


def test_a_motion_that_runs_away_on_a_belt_at_rest_has_no_equilibrium() -> None:
    history = RunHistory()
    time = np.arange(0.0, 400.0, 1.0)
    growing, at_rest = np.exp(0.5 * time), np.zeros(len(time))
    see(history, time, growing * np.sin(time), growing, at_rest, growing)
    meter = CycleMeter(20)
    meter.unbounded = True
    drive = replace(PAPER, belt_speed=0.0)
    figure = figure_of(history, meter.measures(), drive)
    assert figure.get_suptitle() == "it\nat the end: unbounded"
    marked = [line.get_marker() for panel in (PORTRAIT, LAW) for line in figure.axes[panel].lines]
    assert "o" not in marked
    rest = np.asarray(figure.axes[POSITION].lines[0].get_ydata(), dtype=float)
    assert np.isnan(rest).all()
    figure.draw_without_rendering()


@pytest.mark.long
def test_friction_with_a_memory_is_drawn_as_its_loop() -> None:
    """The loop has the samples of the last cycles: they leave the curve of steady slip."""
    law = {"friction_law": "lugre", "friction_bristle_stiffness": 1e5}
    run = ss.simulate(ss.scenario("feed_drive", expects_control=False, **law), duration=2.0)
    (loop,) = (line for line in run.plot().axes[LAW].lines if line.get_label() == "loop")
    speed, coefficient = np.asarray(loop.get_xydata(), dtype=float).T
    table = run.to_pandas()[-len(speed) :]
    assert 1000.0 * (table["velocity"] - 0.04).to_numpy() == pytest.approx(speed, abs=1e-9)
    assert (table["friction_force"] / 1000.0).to_numpy() == pytest.approx(coefficient, abs=1e-12)
    assert len(speed) > LAST_CYCLES * 60


def test_the_mean_cycle_of_a_noisy_record_is_shown() -> None:
    """Raw samples, the fit, and the edges of the stick with their intervals."""
    position, velocity, _ = motion(0.04)
    noise = 1e-6 * np.random.default_rng(1).standard_normal(2000)
    stamp, unknown = np.arange(2000) * 1_000_000, np.full(2000, np.nan)
    samples = SampleColumns(
        stamp, position[:2000] + noise, velocity[:2000], unknown, unknown, np.full(2000, 0.04)
    )
    history = RunHistory()
    meter = SampleMeter(20, history, reading=SampleAssumptions(noisy=True))
    meter.feed(samples)
    measures, _, mean = meter.measured()
    history.take_analysis(RunAnalysis(mean, None))
    figure = figure_of(history, measures, None, style=STYLES["paper"])
    assert faults(figure) == []
    (axes,) = (each for each in figure.axes if "mean cycle" in each.get_title())
    labels = [text.get_text() for text in axes.texts]
    assert any("landing ±" in label for label in labels)
    assert any("departure ±" in label for label in labels)
    raw, fitted = axes.lines[:2]
    assert len(raw.get_xdata()) == len(fitted.get_xdata()) > 1200


def test_slips_may_be_alike_to_a_rounding() -> None:
    history = RunHistory()
    alike = (4e-3, 4e-3 + 1e-18, 4e-3)
    each = dict.fromkeys(("stick_time", "drop", "slip_time"), alike)
    history.take_analysis(RunAnalysis(None, {"each": each}))
    figure = figure_of(history, CycleMeter(20).measures(), None)
    assert titles(figure).count("3 slips") == 3


def test_of_a_long_run_the_motion_around_switching_on_is_complete() -> None:
    history = RunHistory()
    step, rows = 1e-3, 5_000
    for block in range(80):
        time = step * (np.arange(rows) + block * rows)
        belt = np.full(rows, 0.4)
        see(history, time, np.sin(40.0 * time), 40.0 * np.cos(40.0 * time), belt, 0.1 * belt)
        history.take_control(time, np.where(time < 100.0, 0.0, 3.0), all_acted(time))
    assert history.switched_on == pytest.approx(100.0)
    shown = history.around_switch_on(0.5, 1.5)
    assert np.diff(shown.time).max() == pytest.approx(step)
    assert shown.time[[0, -1]] == pytest.approx([99.5, 101.5], abs=2.0 * step)


@in_styles
def test_the_instant_of_switching_on_is_enlarged(style: str) -> None:
    history = RunHistory()
    time = np.arange(0.0, 4.0, 0.01)
    belt = np.full(len(time), 0.4)
    see(history, time, np.sin(40.0 * time), 40.0 * np.cos(40.0 * time), belt, 0.1 * belt)
    history.take_control(time, np.where(time < 2.0, 0.0, 3.0), all_acted(time))
    measures = CycleMeter(20).measures()
    drawn_style = replace(STYLES[style], titled=style != "paper")
    figure = figure_of(history, measures, FEED_DRIVE, style=drawn_style)
    assert faults(figure) == []
    (axes,) = (each for each in figure.axes if "control switched on" in each.get_title())
    low, high = axes.get_xlim()
    assert low < 2.0 < high
    assert high - low < 1.0
    x = np.asarray(axes.lines[-1].get_xdata(), dtype=float)
    assert len(x) > 20
    assert low - 0.02 <= x.min() < x.max() <= high + 0.02


@cache
def drawn(name: str, end: float, drive: Drive = FEED_DRIVE) -> DrawnRun:
    history = RunHistory()
    report = report_of_recording(REFERENCE, end=end, observer=history)
    return DrawnRun(name, history, measures_of(report), drive)


@in_styles
def test_each_run_has_a_column_and_a_line_in_each_common_panel(style: str) -> None:
    # The units are SI, since not all drives are without units.
    runs = [drawn("long", 2.0), drawn("short", 1.0), drawn("shortest", 0.02, PAPER)]
    figure = run_figure(*runs, style=STYLES[style])
    assert faults(figure) == []
    assert legend_texts(figure) == ["long", "short", "shortest"]
    upper, (portrait, amplitude, stick_fraction) = figure.axes[:6], figure.axes[6:]
    shown = [axes for axes in upper if axes.get_title()]
    assert [axes.get_title().split("\n")[0] for axes in shown] == ["long", "short", "shortest"]
    assert len({axes.get_xlim() for axes in upper}) == 1
    assert len({axes.get_ylim() for axes in shown}) == 1
    colours = {axes.lines[0].get_color() for axes in shown}
    assert len(colours) == 3
    for axes in (portrait, amplitude, stick_fraction):
        assert {line.get_color() for line in axes.lines} == colours
    for number, run in enumerate(runs):
        drawn_amplitude = np.asarray(amplitude.lines[number].get_ydata(), dtype=float)
        assert drawn_amplitude == pytest.approx(1e6 * run.history.cycles[1])
    assert amplitude.get_ylabel().replace("\n", " ") == "amplitude (µm)"


@in_styles
def test_behind_a_motor_are_the_force_of_the_spring_and_two_phase_planes(style: str) -> None:
    run = ss.simulate("feed_drive_motor", duration=1.0)
    figure = run.plot(style=style)
    found = {axes.get_title(): axes for axes in figure.axes}
    shown = ["force of the transmission", "phase plane of the slide", "phase plane of the motor"]
    if style != "screen":  # there is no room
        assert found.keys().isdisjoint(shown)
        return
    assert faults(figure) == []
    assert found.keys() >= {*shown}
    spring, *_ = found[shown[0]].lines
    assert float(np.asarray(spring.get_ydata())[-1]) == pytest.approx(258.4, abs=80.0)  # N


def test_a_friction_force_reaches_its_extremes_at_the_edges_of_a_stick() -> None:
    """Between samples: at them its least values would beat. A force that jumps is left as it is."""
    edges = np.array([0.0, 0.31, 0.90, 1.27, 1.90, 2.23, 3.0])
    sticks = np.array([0.0, 0.0, 0.59, 0.59, 1.22, 1.22, 1.99])
    motion = DrawnMotion(edges, *np.zeros((3, len(edges))), sticks)
    time = np.arange(0.0, 3.0, 0.1)
    sticking = np.searchsorted(edges, time, "right") % 2 == 0
    since = time - edges[np.searchsorted(edges, time, "right") - 1]
    force = np.where(sticking, 150.0 + 400.0 * since, 380.0)
    shown_time, shown = with_edges((time, force), motion)
    assert np.all(np.diff(shown_time) >= 0.0)
    for begin, end in ((0.31, 0.90), (1.27, 1.90), (2.23, 3.0)):
        stick = shown[(shown_time >= begin - 1e-12) & (shown_time <= end + 1e-12)]
        assert [stick.min(), stick.max()] == pytest.approx([150.0, 150.0 + 400.0 * (end - begin)])
    jumping = force + 100.0 * (np.arange(len(time)) % 2)
    assert np.array_equal(with_edges((time, jumping), motion)[1], jumping)
