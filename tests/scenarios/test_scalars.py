"""Scalars are read as by rcl, which differs from YAML 1.1 and from PyYAML."""

from math import isfinite, isnan
from pathlib import Path
from typing import Any

from stickslip_ros.scenarios.files import load_scenario
from tests.scenarios.conftest import ReadByRos
from tests.scenarios.files import refusal, scenario_file, section

INF, NAN = float("inf"), float("nan")

FINITE: dict[str, Any] = {
    **{"1e3": 1000.0, "1E3": 1000.0, "1.0e6": 1e6, "-.5e-3": -5e-4, ".5": 0.5, "5.": 5.0},
    **{"0": 0, "-5": -5, "+5": 5, "0x10": 16, "-0x10": -16, "010": 8, "08": 8.0},
    **dict.fromkeys(["true", "True", "yes", "Yes", "on", "y"], True),
    **dict.fromkeys(["FALSE", "no", "off", "n"], False),
    **{text: text for text in ("1_000", "0o17", "1e", "12:30", "2001-01-01", "tRue", "stribeck")},
    **{"'yes'": "yes", '"1e3"': "1e3", "[a, b]": ["a", "b"]},
}
NOT_FINITE = {".inf": INF, "-.Inf": -INF, "inf": INF, "-inf": -INF, ".nan": NAN, "nan": NAN}

# A parameter that takes what the scalar is; whole numbers are taken for numbers.
TAKERS = {
    bool: ("plant", "use_sim_time"),
    str: ("analyzer", "bag"),
    list: ("plant", "wait_for"),
    int: ("plant", "initial.position"),
    float: ("plant", "initial.position"),
}


def same(one: Any, other: Any) -> bool:
    """Whether both are of one type and equal, NaN being NaN."""
    if isinstance(one, float) and isnan(one):
        return isinstance(other, float) and isnan(other)
    return type(one) is type(other) and one == other


def test_ros_reads_them_so(tmp_path: Path, read_by_ros: ReadByRos) -> None:
    scalars = FINITE | NOT_FINITE
    lines = [f"\n    p{number}: {text}" for number, text in enumerate(scalars)]
    read = read_by_ros(scenario_file(tmp_path, section("/**", "".join(lines))))
    for number, (text, value) in enumerate(scalars.items()):
        assert same(read[f"p{number}"], value), text


def test_a_scenario_reads_them_so(tmp_path: Path) -> None:
    for text, value in FINITE.items():
        node, name = TAKERS[type(value)]
        path = scenario_file(tmp_path, section(f"/**/{node}", f"{{{name}: {text}}}"))
        given = float(value) if type(value) is int else value
        assert same(load_scenario(path).as_dict()[node][name], given), text
    for text, value in NOT_FINITE.items():
        path = scenario_file(tmp_path, section("/**/plant", f"{{mass: {text}}}"))
        assert f"mass = {value!r} is invalid" in refusal(path)
    for text in (".inf", "inf"):
        path = scenario_file(tmp_path, section("/**/plant", f"{{duration: {text}}}"))
        assert not isfinite(load_scenario(path).plant.duration)
