"""examples/ and their pages: figures, values and forces are those of today, and published ones."""

import json
import runpy
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace

import nbformat
import numpy as np
import pytest

from tests.docs.page import CHECKOUT

EXAMPLES = CHECKOUT / "examples"
PAGE = (CHECKOUT / "docs/gallery.md").read_text(encoding="utf-8")
GALLERY = CHECKOUT / "docs/gallery"
WITHOUT_FIGURE = {"foresight", "plc_export", "velocity_feedback"}
SCRIPTS = sorted(
    path.stem
    for path in EXAMPLES.glob("*.py")
    if path.stem not in WITHOUT_FIGURE and not path.stem.startswith("test_")
)
NOTEBOOKS = sorted(path.stem for path in EXAMPLES.glob("notebooks/*.ipynb"))
QUICK = {"replay_into_a_controller"}
ELSEWHERE = {"compare_controllers"}  # below
SMALLER = {
    "basins": {"3.0, 30": "3.0, 6", "2.5, 30": "2.5, 6"},
    "custom_friction_law": {"0.6, 21": "0.6, 3"},
    "design_for_a_force_limit": {"(0.015, 0.05)": "0.03"},
    "encoder_and_actuator": {"3.0, 5.0": "0.5, 1.0", "(1, 2, 4, 8)": "(1, 8)"},
    "friction_with_memory": {"zeros(4000)": "zeros(1500)", "arange(1600)": "arange(300)"},
    "ramp_through_the_hopf_point": {"RAMP = 2500.0": "RAMP = 250.0", "fastest, 26)": "fastest, 4)"},
    "stiffer_bristles": {"5.1, 0.5": "4.1, 0.5"},
}
"""By script: what is computed for fewer values, or for a shorter time, than for its figure."""


@pytest.mark.parametrize(
    "script",
    [
        script if script in QUICK else pytest.param(script, marks=pytest.mark.long)
        for script in sorted(set(SCRIPTS) - ELSEWHERE)
    ],
)
def test_a_script_writes_its_figure(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", [script, str(tmp_path)])
    path = EXAMPLES / f"{script}.py"
    if script in SMALLER:
        text = path.read_text(encoding="utf-8")
        for old, new in SMALLER[script].items():
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / path.name
        path.write_text(text, encoding="utf-8")
    runpy.run_path(str(path), run_name="__main__")
    assert (tmp_path / f"{script}.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
@pytest.mark.process
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_has_the_outputs_of_its_run(name: str) -> None:
    gallery = runpy.run_path(str(CHECKOUT / "docs/gallery.py"))
    path = EXAMPLES / "notebooks" / f"{name}.ipynb"
    kept, now = (
        [(sorted(data), data.get("text/plain")) for data in gallery["results_in"](notebook)]
        for notebook in (nbformat.read(path, as_version=4), gallery["executed"](path))
    )
    assert kept == now


def test_examples_are_in_the_gallery_with_a_small_figure() -> None:
    for name in (*SCRIPTS, *NOTEBOOKS):
        assert f"](gallery/{name}.png)" in PAGE
        assert (GALLERY / f"{name}.png").stat().st_size < 60_000


KEPT = json.loads((CHECKOUT / "docs/gallery/comparison.json").read_text(encoding="utf-8"))


@pytest.fixture
def compare(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    monkeypatch.syspath_prepend(CHECKOUT / "examples")
    yield import_module("compare_controllers")
    for module in ("compare_controllers", "velocity_feedback"):
        del sys.modules[module]


@pytest.mark.long
def test_the_kept_values_are_those_of_today(compare: ModuleType, tmp_path: Path) -> None:
    compare.main(tmp_path)
    assert (tmp_path / "compare_controllers.png").stat().st_size > 0
    today = json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))
    assert len(today) == len(KEPT) == len(compare.BELT_SPEEDS) * len(compare.CONTROLLERS)
    for found, row in zip(today, KEPT, strict=True):
        assert found.keys() == row.keys()
        for name, value in row.items():
            close = pytest.approx(value, rel=1e-6, abs=1e-8) if isinstance(value, float) else value
            assert found[name] == close, (row["belt_speed"], row["controller"], name)


GTAU, KP, KV = 35.15065, 160.18, 243.45
"""N/V, 1/s and V/(m/s), as published."""


def test_the_axis_follows_its_reference_with_the_published_forces() -> None:
    example = SimpleNamespace(**runpy.run_path(str(EXAMPLES / "position_servo.py")))
    moved, reference = example.simulate(example.PositionServo(force_limit=example.FORCE_LIMIT))
    voltage = np.clip(KV * (KP * (reference - moved.position) - moved.velocity), -10.0, 10.0)
    assert moved.control_force == pytest.approx(GTAU * voltage, rel=1e-6, abs=1e-6)
    clipped = np.abs(moved.control_force) == example.FORCE_LIMIT
    assert 0.01 < np.mean(clipped) < 0.2
    error = reference - moved.position
    assert np.sqrt(np.mean(error**2)) < 0.6e-3  # m
    moving = (moved.time > 0.6) & (moved.time < 1.1)
    # At a constant speed v the velocity loop needs v and the friction force: a lag of both.
    drive, speed = example.AXIS, 0.1  # m/s
    lag = (speed + (drive.damping * speed + 20.4) / (GTAU * KV)) / KP
    assert error[moving] == pytest.approx(lag, rel=1e-3)
    assert abs(error[-1]) < 20.4 / (GTAU * KV * KP)  # friction holds it there
    free, _ = example.simulate(example.PositionServo())  # without the limit
    assert np.max(np.abs(free.control_force)) > 1.5 * np.max(np.abs(moved.control_force))
    assert np.max(np.abs(reference - free.position)) < np.max(np.abs(error))
