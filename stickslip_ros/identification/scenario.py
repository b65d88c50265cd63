"""A complete scenario of an identified drive."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from stickslip_ros.files import written
from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.identified_law import LAG, by_group, numbers_of
from stickslip_ros.model.friction import CurveFollower, FrictionLaw, Table
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.scenarios.template import commented_file

_BASE = "feed_drive"
_DIRECTIONS = ("forward", "backward")


def curve_files(path: Path) -> tuple[Path, Path]:
    """Return where the curves of a scenario file are written: for forward and backward slip."""
    forward, backward = (path.with_name(f"{path.stem}-{way}.csv") for way in _DIRECTIONS)
    return forward, backward


def written_scenario(findings: Findings, path: Path) -> list[Path]:
    """Write a scenario with the identified drive, and its friction curves beside it.

    An axis is held by the position controller of the recording, if it was found; a drive on a
    spring has a washout controller without gains, for `stickslip design`. Returns the files that
    were written; raises OSError if one exists or cannot be written.
    """
    laws = by_group(findings.drive.friction)
    curves: list[Path] = []
    files: dict[str, str] = {}
    with ExitStack() as undo:
        for group, law in laws.items():
            curve = law.curve if isinstance(law, CurveFollower) else law
            if isinstance(curve, Table):
                file = curve_files(path)["reverse" in group]
                with written(file, then=partial(undo.callback, file.unlink, missing_ok=True)) as to:
                    to.writelines(f"{w!r},{size!r}\n" for w, size in curve.points)
                curves.append(file)
                files[f"plant.{group}file"] = str(file.absolute())
        # A scenario reads its curves: it can only be made when they are written.
        made = replace(_scenario(findings, laws, files), fit=findings.spread)
        text = commented_file(made, _heading(findings, path))
        for file in curves:
            text = text.replace(str(file.absolute()), file.name)
        with written(path, then=undo.pop_all) as stream:
            stream.write(text)
    return [path, *curves]


def _scenario(model: Findings, laws: Mapping[str, FrictionLaw], files: dict[str, str]) -> Scenario:
    drive, record, servo = model.drive, model.records[0], model.servo
    values: dict[str, Any] = {
        f"plant.{name}": getattr(drive, name)
        for name in ("mass", "damping", "stiffness", "normal_force", "belt_speed", "bias_force")
    }
    values["plant.friction.law"] = laws["friction."].name
    for group, law in laws.items():
        # What the contact remembers is one in both directions.
        numbers = {} if isinstance(law, CurveFollower) and group != "friction." else numbers_of(law)
        values |= {f"plant.{group}{name}": value for name, value in numbers.items()}
        if isinstance(law, CurveFollower) and group == "friction.":
            values["plant.friction.curve"] = law.curve.name
    values |= files
    values["plant.rate"] = float(f"{1.0 / record.period:.9g}")
    values["plant.force_delay"] = max(model.chosen.delay, 0.0)
    values["plant.initial.position"] = float(record.position[0])
    if model.chosen.has_spring:
        if LAG in model.fitted:
            values[f"plant.{LAG}"] = model.fitted[LAG].value
        values |= {"washout_controller.linear_gain": 0.0, "washout_controller.start_after": 0.0}
        return load_scenario(_BASE).changed(values)
    values["plant.duration"] = 10.0
    if servo is None:
        return load_scenario(_BASE).changed({**values, "plant.expects_control": False})
    values["plant.sensor.velocity"] = "difference"
    values["plant.sensor.difference_samples"] = servo.difference_samples
    values["plant.actuator.limit"] = servo.limit
    values["velocity_feedback_controller.position_gain"] = -servo.position_gain
    values["velocity_feedback_controller.velocity_gain"] = -servo.velocity_gain
    return load_scenario(_BASE, controller="velocity_feedback").changed(values)


def _heading(findings: Findings, path: Path) -> str:
    names = ", ".join(dict.fromkeys(record.name for record in findings.records))
    law = f"law {findings.law}, validation error {findings.chosen.error:.2%}"
    return f"{path.stem}: a drive identified from {names}; {law}.\nstickslip simulate {path.name}"
