"""Scalars are read as rcl reads them, which is neither YAML 1.1 nor what PyYAML makes of it."""

from math import isnan
from pathlib import Path
from typing import Any

import pytest
import yaml

from stickslip_ros.scenario.files import load_scenario
from tests.scenario.files import scenario_file, section

INF, NAN = float("inf"), float("nan")

SCALARS: dict[str, Any] = {
    "1e3": 1000.0,
    "1E3": 1000.0,
    "1.0e6": 1e6,
    "-.5e-3": -5e-4,
    ".5": 0.5,
    "5.": 5.0,
    "0": 0,
    "-5": -5,
    "+5": 5,
    "0x10": 16,
    "-0x10": -16,
    "010": 8,
    "08": 8.0,
    ".inf": INF,
    "-.Inf": -INF,
    "inf": INF,
    "-inf": -INF,
    ".nan": NAN,
    "nan": NAN,
    "true": True,
    "True": True,
    "yes": True,
    "Yes": True,
    "on": True,
    "y": True,
    "FALSE": False,
    "no": False,
    "off": False,
    "n": False,
    "'yes'": "yes",
    '"1e3"': "1e3",
    "1_000": "1_000",
    "0o17": "0o17",
    "1e": "1e",
    "12:30": "12:30",
    "2001-01-01": "2001-01-01",
    "tRue": "tRue",
    "stribeck": "stribeck",
    "[a, b]": ["a", "b"],
}


def same(one: Any, other: Any) -> bool:
    both_nan = isinstance(one, float) and isinstance(other, float) and isnan(one) and isnan(other)
    return type(one) is type(other) and (one == other or both_nan)


def test_ros_reads_them_so(tmp_path: Path) -> None:
    pytest.importorskip("rclpy")
    from tests.scenario.ros import parameters_by_ros

    lines = ", ".join(f"p{number}: {text}" for number, text in enumerate(SCALARS))
    read = parameters_by_ros(scenario_file(tmp_path, section("/**", f"{{{lines}}}")))
    for number, (text, value) in enumerate(SCALARS.items()):
        assert same(read[f"p{number}"], value), text


# A parameter of each type, and what a scalar must be for it.
TYPES = [("plant", "use_sim_time", bool), ("analyzer", "window", int), ("analyzer", "bag", str)]


@pytest.mark.parametrize(("text", "value"), SCALARS.items(), ids=SCALARS.keys())
def test_a_scenario_reads_them_so(tmp_path: Path, text: str, value: Any) -> None:
    node, name, given = {
        bool: ("plant", "use_sim_time", value),
        str: ("analyzer", "bag", value),
        list: ("plant", "wait_for", value),
        int: ("plant", "initial.position", float(value) if isinstance(value, int) else value),
        float: ("plant", "initial.position", value),
    }[type(value)]
    if isinstance(value, float) and not abs(value) < INF:
        # Only a duration may be infinite, and nothing may be NaN; what is refused is shown.
        from tests.scenario.files import refusal

        path = scenario_file(tmp_path, section(f"/**/{node}", f"{{{name}: {text}}}"))
        assert f"{name} = {value!r} is refused" in refusal(path)
        return
    path = scenario_file(tmp_path, section(f"/**/{node}", f"{{{name}: {text}}}"))
    assert same(load_scenario(path).as_dict()[node][name], given)


def test_pyyaml_alone_would_not() -> None:
    """Why the loader has rules of its own."""
    assert yaml.safe_load("1e3") == "1e3"
    assert yaml.safe_load("1_000") == 1000
