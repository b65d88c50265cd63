"""The figures that compare controllers, and a run before and after its own is switched on."""

import numpy as np

from stickslip_ros.plots.controller_comparison import (
    ControlledRun,
    comparison_figure,
    control_switched_on_figure,
)
from stickslip_ros.samples import ForceColumns, SampleColumns
from tests.plots.texts import faults, legend_texts


def decaying_run() -> tuple[SampleColumns, ForceColumns]:
    time = np.linspace(0.0, 2.0, 2001)
    fading = np.where(time < 1.0, 1.0, np.exp(-8.0 * (time - 1.0)))
    velocity = np.minimum(4e-2 * fading * np.sin(100.0 * time), 3e-2)
    stamp = np.rint(time * 1e9).astype(np.int64)
    position, belt = -4e-4 * fading * np.cos(100.0 * time), np.full_like(time, 3e-2)
    states = SampleColumns(stamp, position, velocity, position, belt, belt)
    return states, ForceColumns(stamp, np.where(time < 1.0, 0.0, -3e3 * velocity))


def test_before_and_after_the_control_is_switched_on() -> None:
    figure = control_switched_on_figure(*decaying_run(), 1.0, (0.3, 0.5))
    labels = {axes.get_ylabel() for axes in figure.axes}
    assert labels >= {"displacement $x$ (µm)", "velocity $x'$ (mm/s)", "control force $u$ (N)"}
    entries = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert entries == ["slide sticks to the belt"]
    assert figure.axes[1].get_xlim() == (0.7, 1.5)
    titles = [axes.get_title() for axes in figure.axes]
    assert titles[2:] == ["before: 0.5 s to 1 s", "after: 1 s to 2 s"]
    assert faults(figure) == []


def test_controllers_are_compared_in_a_column_for_each_belt_speed() -> None:
    runs = [
        ControlledRun(speed, controller, *decaying_run())
        for speed in (0.03, 0.04)
        for controller in ("none", "washout")
    ]
    figure = comparison_figure(runs)
    assert [axes.get_title() for axes in figure.axes[:2]] == [
        "belt speed 30 mm/s",
        "belt speed 40 mm/s",
    ]
    assert legend_texts(figure) == ["none", "washout"]
    looks = {(line.get_color(), line.get_linestyle()) for line in figure.axes[0].lines}
    assert len(looks) == 2
    assert faults(figure) == []
