"""`stickslip design`: the proposal as a table, as JSON, as a parameter file and as a figure."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import stickslip_ros.api.comparison  # noqa: F401 - keeps the function that it finds when loaded
from stickslip_ros.progress import Progress
from stickslip_ros.studies.design import Design, Task, design
from tests.app.conftest import Run

LIMIT = ("--belt-speed", "0.04", "-p", "washout_controller.force_limit=200")

DESIGN = "stickslip_ros.studies.design.design"


def once() -> Callable[[Task, Progress], Design]:
    """Return the function that designs, but once only: a test looks at one result several times."""
    found: list[Design] = []

    def designed(task: Task, _: Progress) -> Design:
        if not found:
            found.append(design(task))
        return found[0]

    return designed


def test_the_parameter_file_quenches_the_vibration(
    stickslip: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(DESIGN, once())
    found = stickslip.json("design", "feed_drive", *LIMIT, "--out", "gains.yaml", "--plot", "m.png")
    assert (tmp_path / "gains.yaml").read_text() == found["parameter_file"]
    assert (tmp_path / "m.png").read_bytes().startswith(b"\x89PNG")
    for name in ("corner_frequency", "linear_gain", "cubic_gain", "force_limit", "start_after"):
        assert f'"{name}": {found[name]}' in found["parameter_file"]
    assert found["peak_force"] <= found["force_limit"] == 200.0
    assert found["scenario"]["name"] == "feed_drive"
    done = stickslip("simulate", "gains.yaml", "--json")
    assert json.loads(done.stdout)["regime"] == "equilibrium"
    assert done.stderr == ""
    done = stickslip("design", "feed_drive", *LIMIT)
    for text in ("belt speed 40 mm/s", "linear gain", "delay margin", "peak force"):
        assert text in done.stdout
    assert "--out FILE" in done.stdout
    assert "nan" not in done.stdout
    assert "ros__parameters" not in done.stdout


def test_without_vibration_there_are_gains_and_it_is_told(stickslip: Run) -> None:
    where = ("design", "feed_drive", "--belt-speed", "60mm/s")
    found = stickslip.json(*where, "-p", "plant.force_jitter=0.01")
    assert "nothing vibrates" in found["remark"]
    assert "force_jitter is omitted" in found["remark"]
    assert not any(check["vibrates"] for check in found["checks"])
    assert found["predicted_settling_time"] > 0.0
    done = stickslip(*where, "--out", "gains.yaml")
    assert done.stderr.endswith("gains.yaml is written: `stickslip run gains.yaml` runs it\n")
    quiet = stickslip(*where, "--out", "again.yaml", "--quiet")
    assert (quiet.stdout, quiet.stderr) == (done.stdout, "")
    assert "--out" not in done.stdout


def test_no_proposal_is_a_result_with_a_reason(stickslip: Run, tmp_path: Path) -> None:
    late = ("-p", "plant.force_delay=0.05", "--belt-speed", "0.04")
    files = ("--out", "gains.yaml", "--plot", "map.png", "--html", "page.html")
    done = stickslip("design", "feed_drive", *late, *files)
    assert done.returncode == 0, done.stderr
    assert "no gains make the loop stable" in done.stdout
    (page,) = tmp_path.iterdir()
    shown = page.read_text(encoding="utf-8")
    assert "There is no figure: there is nothing to propose" in shown
    assert "<svg" not in shown
    lines = [line for line in done.stderr.splitlines() if "nothing to propose" in line]
    options = "--plot map.png: not drawn", "--out gains.yaml: not written"
    for line, option in zip(lines, options, strict=True):
        assert option in line


def test_what_cannot_be_written_in_the_end_costs_no_result(
    stickslip: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    designed = once()

    def design_while_the_directory_goes(task: Task, progress: Progress) -> Design:
        (tmp_path / "below").rmdir()
        return designed(task, progress)

    monkeypatch.setattr(DESIGN, design_while_the_directory_goes)
    for option, file in (("--out", "x.yaml"), ("--plot", "x.png")):
        (tmp_path / "below").mkdir()
        where = ("--belt-speed", "0.06", "--json", option, f"below/{file}")
        done = stickslip("design", "feed_drive", *where)
        assert done.returncode == 2
        assert json.loads(done.stdout)["linear_gain"] is not None
        line = done.stderr.splitlines()[-1]
        assert f"{option} below/{file}: cannot be written" in line
