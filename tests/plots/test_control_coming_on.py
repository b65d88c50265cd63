"""The plot of a run in which the control is switched on."""

from pathlib import Path

import numpy as np
import pytest

from stickslip_ros.plots.control_coming_on import control_coming_on_figure
from stickslip_ros.plots.style import save
from stickslip_ros.samples import ForceColumns, SampleColumns


def decaying_run() -> tuple[SampleColumns, ForceColumns]:
    time = np.linspace(0.0, 2.0, 2001)
    fading = np.where(time < 1.0, 1.0, np.exp(-8.0 * (time - 1.0)))
    velocity = np.minimum(4e-2 * fading * np.sin(100.0 * time), 3e-2)
    stamp = np.rint(time * 1e9).astype(np.int64)
    position, belt = -4e-4 * fading * np.cos(100.0 * time), np.full_like(time, 3e-2)
    states = SampleColumns(stamp, position, velocity, position, belt, belt)
    return states, ForceColumns(stamp, np.where(time < 1.0, 0.0, -3e3 * velocity))


@pytest.mark.parametrize(("ending", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml")])
def test_the_format_follows_the_ending(tmp_path: Path, ending: str, start: bytes) -> None:
    path = tmp_path / f"run{ending}"
    save(control_coming_on_figure(*decaying_run(), 1.0, (0.3, 0.5)), path)
    assert path.read_bytes().startswith(start)


def test_axes_have_units_with_sensible_prefixes(tmp_path: Path) -> None:
    path = tmp_path / "run.svg"
    figure = control_coming_on_figure(*decaying_run(), 1.0, (0.3, 0.5))
    labels = {axes.get_ylabel() for axes in figure.axes}
    assert labels >= {"displacement $x$ (µm)", "velocity $x'$ (mm/s)", "control force $u$ (N)"}
    save(figure, path)
    assert "slide sticks" in path.read_text(encoding="utf-8")
