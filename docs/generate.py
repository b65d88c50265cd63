"""Parts of the pages from the code: parameters, topics, numbers of the theory, of an example.

Fills in what stands between `<!-- generated: NAME -->` and `<!-- end: NAME -->` on the pages beside
this file.
"""

import json
import re
from argparse import Action
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from math import isinf
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.constants import Parameter
from stickslip_ros.record.topics import TOPICS
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.parameter_group import NodeParameters
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, ReplayParameters
from stickslip_ros.studies.stability import stability

HERE = Path(__file__).parent
PAGES = (
    "parameters.md",
    "topics.md",
    "theory.md",
    "controllers.md",
    "command-line.md",
    "identification.md",
)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def parameters() -> Iterator[str]:
    """Yield what every node has, what controllers share, and what each node has, with defaults."""
    common = NodeParameters()
    models = {**NODE_PARAMETERS, "replay": ReplayParameters()}
    texts = {
        node: [_with_default(p) for p in _listed(model) if p.name not in common.known]
        for node, model in models.items()
    }
    laws = [own for node, own in texts.items() if node.endswith("_controller")]
    every = [text for text in laws[0] if all(text in own for own in laws)]
    tracked = dict.fromkeys(text for own in laws for text in own if "`reference." in text)
    lists = {
        "every node": [_with_default(p) for p in _listed(common)],
        "every controller": every,
        "every controller that tracks a reference": [*tracked],
        **{
            node: [text for text in own if text not in {*every, *tracked}]
            for node, own in texts.items()
        },
    }
    for title, own in lists.items():
        yield f"## {title}\n"
        for _, group in groupby(own, key=_prefix):
            yield f"- {', '.join(group)}"
        yield ""
        if title == "plant":
            names = ", ".join(f"`{name}`" for name in models[title].known if ".reverse." in name)
            yield f"Of the other direction, by default as forward: {names}.\n"


def _listed(model: NodeParameters) -> Iterator[Parameter]:
    """Yield the parameters with a default of their own: neither those as forward nor the law."""
    for parameter in model.known.values():
        if ".reverse." not in parameter.name and parameter.name != "law":
            yield parameter


def _prefix(text: str) -> str:
    """Return the first part of a parameter's name; empty if it has one part only."""
    return text.split("`")[1].rpartition(".")[0].partition(".")[0]


def _with_default(parameter: Parameter) -> str:
    default = parameter.default
    if parameter.kind is bool:
        default = str(default).lower()
    elif parameter.kind is float:
        default = "inf" if isinf(default) else parameter.text(default)
    known = default if default not in ("", [], parameter.unset) else default or "empty"
    return " ".join(filter(None, [f"`{parameter.name}`", str(known), parameter.unit]))


def commands() -> Iterator[str]:
    """Yield every command by group: its arguments, and what it does."""
    from stickslip_ros.app.commands import COMMANDS

    for group in dict.fromkeys(group for group, _ in COMMANDS.values()):
        yield f"## {group}\n"
        rows = [
            [f"`{name}`", line, _arguments(name)]
            for name, (own, line) in COMMANDS.items()
            if own == group
        ]
        yield table(["command", "task", "arguments"], rows)


def _arguments(command: str) -> str:
    """Return the names of the arguments and options of a command."""
    from stickslip_ros.app.commands import command_parser

    actions = [a for a in command_parser(command)._actions if a.dest not in ("help", "quiet")]
    return ", ".join(f"`{(a.option_strings or [_value(a)])[0]}`" for a in actions)


def _value(action: Action) -> str:
    return str(action.metavar or f"{{{','.join(action.choices or ())}}}")


def topics() -> Iterator[str]:
    """Yield the table of topics; who writes and reads them is what the policy for SROS2 allows."""
    policy = ElementTree.parse(HERE.parent / "config" / "sros2_policy.xml")
    uses: dict[tuple[str, str], list[str]] = {}
    for profile in policy.iter("profile"):
        for rules in profile.iter("topics"):
            (rule,) = rules.attrib
            for topic in rules:
                users = uses.setdefault((rule, topic.text or ""), [])
                if profile.attrib["node"] in NODE_PARAMETERS:
                    users.append(profile.attrib["node"])
    yield table(
        ["topic", "type", "from", "to", "depth", "meaning"],
        [
            [
                f"`{topic.name}`",
                topic.type_name.replace("/msg/", "/"),
                ", ".join(uses.get(("publish", topic.name), [])),
                ", ".join(uses.get(("subscribe", topic.name), [])),
                f"{topic.depth}",
                topic.meaning.removesuffix("."),
            ]
            for topic in TOPICS
        ],
    )


def numbers() -> Iterator[str]:
    """Yield what `stickslip stability paper` finds, with the symbols of the page."""
    scenario = load_scenario("paper")
    found, _ = stability(scenario)
    drive = scenario.plant.as_drive().dimensionless
    drop, speed = drive.friction.static - drive.friction.minimum, drive.friction.minimum_speed
    opened, closed, sampled = (found[f"{loop}_loop"] for loop in ("open", "closed", "sampled"))
    (cycle,), sticking = opened["limit_cycles"], found["sticking"]
    rows: dict[str, Any] = {
        "$a$, $b$": (1.5 * drop / speed, 0.5 * drop / speed**3),
        "equilibrium $X_0$, eq. 6": found["equilibrium_position"],
        "trace $p$, eq. 8": float(opened["eigenvalues"].sum().real),
        "eigenvalues of the open loop": _complex(opened["eigenvalues"]),
        "critical feed speed (Hopf) $v_{b1}$": opened["hopf_speeds"],
        "$d \\mathrm{Re} \\lambda / d v_0$ there, eq. 11": opened["crossing_speeds"],
        "first Lyapunov coefficient $\\sigma$, eq. 15": opened["first_lyapunov_coefficients"],
        "stick-slip onset speed $v_{b0}$, by averaging": sticking["onset_speed_approximate"],
        "the same, exactly": sticking["onset_speed"],
        "limit cycle: amplitude, period": (cycle["amplitude"], cycle["period"]),
        "its stick fraction, and Floquet multiplier": (
            cycle["stick_fraction"],
            cycle["multipliers"][0].real,
        ),
        "eigenvalues with control, eq. 20": _complex(closed["eigenvalues"]),
        "critical linear gain $k_1^{\\ast}$, eq. 21": closed["critical_linear_gain"],
        "$\\sigma$ there, with $k_2 = -1$": closed["first_lyapunov_coefficient"],
        "critical cubic gain": closed["critical_cubic_gain"],
        "sampled at 100 Hz: spectral radius": sampled["spectral_radius"],
        "its stable linear gains": sampled["stable_linear_gains"][0],
    }
    yield table(["quantity", "value"], [[name, _values(value)] for name, value in rows.items()])


def _complex(values: Iterable[complex]) -> str:
    """Return eigenvalues, of a conjugate pair one."""
    return ", ".join(
        f"{value.real:.5g}{f' ± {value.imag:.5g} i' if value.imag else ''}"
        for value in values
        if value.imag >= 0.0
    )


def _values(value: Any) -> str:
    if isinstance(value, str):
        return value
    return ", ".join(f"{v:.5g}" for v in (value if isinstance(value, list | tuple) else [value]))


def comparison() -> Iterator[str]:
    """Yield what examples/compare_controllers.py has written, as a table."""
    kept = (HERE / "gallery" / "comparison.json").read_text(encoding="utf-8")
    yield table(
        [
            "belt speed, mm/s",
            "control",
            "regime",
            "amplitude, µm",
            "settles at, µm",
            "peak force, N",
            "final force, N",
        ],
        [
            [
                f"{row['belt_speed'] * 1e3:g}",
                row["controller"],
                Regime.label(row["regime"]),
                f"{row['amplitude'] * 1e6:.1f}",
                f"{row['midpoint'] * 1e6:.1f}" if row["regime"] == "equilibrium" else "",
                _newtons(row["peak_force"]),
                _newtons(row["resting_force"]),
            ]
            for row in json.loads(kept)
        ],
    )


def _newtons(force: float | None) -> str:
    return "" if force is None else f"{force:.1f}"


STUDIES = HERE.parent / "benchmarks"


def axis() -> Iterator[str]:
    """Yield what the command finds on a ball-screw axis, beside what is published."""
    found = json.loads((STUDIES / "ball_screw_axis.json").read_text(encoding="utf-8"))
    coulomb, chosen, bristles = found["coulomb"], found["chosen"], found["lugre"]
    published, symmetric = found["published"], found["published_symmetric"]

    def constant(model: dict[str, Any], name: str, digits: int) -> str:
        if name not in model["parameters"]:
            return "a curve"
        each = model["parameters"][name]
        low, high = each["interval"]
        return f"{each['value']:.{digits}f} ± {(high - low) / 2.0:.{digits}f}"

    rows = [
        [
            name,
            f"{published[key]:.{digits}f}",
            *(constant(each, key, digits) for each in (coulomb, chosen, bristles)),
        ]
        for name, key, digits in (
            ("mass, kg", "plant.mass", 2),
            ("viscous friction forward, N s/m", "plant.friction.viscous", 1),
            ("viscous friction backward, N s/m", "plant.friction.reverse.viscous", 1),
            ("Coulomb friction forward, N", "plant.friction.static", 2),
            ("Coulomb friction backward, N", "plant.friction.reverse.static", 2),
        )
    ]

    def held_out(model: dict[str, Any]) -> str:
        (own,) = (each for each in model["candidates"] if each["law"] == model["law"])
        return f"{100.0 * own['held_out_error']:.2f} %"

    three = (coulomb, chosen, bristles)
    for name, key, known, text in (
        ("force error", "force_error", published["force_error"], "{:.2%}"),
        (
            "closed loop: position",
            "position_error",
            symmetric["position_error"],
            "{:.5%}",
        ),
        (
            "closed loop: force",
            "closed_loop_force_error",
            symmetric["closed_loop_force_error"],
            "{:.2%}",
        ),
    ):
        note = " (symmetric fit)" if key in symmetric else ""
        own = [text.format(each[key]).replace("%", " %") for each in three]
        rows.append([name, text.format(known).replace("%", " %") + note, *own])
        if key == "force_error":
            rows.append(["validation error of the force", "", *map(held_out, three)])
    runs = [f"{1e3 * each['free_run_error']:.2f} mm" for each in three]
    name = "simulation error: 24.8 s with the recorded force and no feedback, in-sample"
    rows.append([name, "", *runs])
    yield table(
        [
            "",
            "published, by direction",
            "`--law coulomb`",
            f"chosen: `{chosen['law']}`",
            "`--law lugre`",
        ],
        rows,
    )
    halves = found["halves"]
    yield table(
        ["fitted to the first half", "force error", "closed loop: position", "closed loop: force"],
        [
            [
                f"{half} half",
                f"{100.0 * each['force_error']:.2f} %",
                f"{100.0 * each['position_error']:.5f} %",
                f"{100.0 * each['closed_loop_force_error']:.2f} %",
            ]
            for half, each in (("first", halves["fitted"]), ("second", halves["predicted"]))
        ],
    )


def coverage() -> Iterator[str]:
    """Yield how often intervals cover, by the study of noisy runs."""
    found = json.loads((STUDIES / "identification.json").read_text(encoding="utf-8"))
    rows: list[list[str]] = []
    fastest = min(case["seconds"] for case in found["cases"])
    for case in found["cases"]:
        own = case["constants"].values() if case["kind"] != "narrow" else ()
        covered = sorted(100.0 * each["covered"] for each in own)
        bias = max((abs(each["bias"]) / each["standard_error"] for each in own), default=None)
        spread = f"{covered[0]:.0f} to {covered[-1]:.0f} %" if covered else ""
        mean = f" ({sum(covered) / len(covered):.0f} %)" if covered else ""
        rows.append(
            [
                case["law"],
                case["kind"],
                str(case["seeds"]),
                f"{100.0 * case['right']:.0f} %",
                f"{100.0 * (1.0 - case['told']):.0f} %",
                spread + mean,
                "" if bias is None else f"{bias:.2f}",
                f"{case['seconds'] / fastest:.1f}",
            ]
        )
    yield table(
        [
            "law",
            "run",
            "seeds",
            "law recovered",
            "“not identifiable”",
            "intervals of 95 % that cover: least to most covered constant (mean)",
            "largest bias, in standard errors",
            "processor time (median of 2 or 3 seeds), in that of the fastest",
        ],
        rows,
    )


def paper_on_paper() -> Iterator[str]:
    """Yield what laws that were fitted to two records predict of others."""
    found = json.loads((STUDIES / "paper_on_paper.json").read_text(encoding="utf-8"))
    records: dict[tuple[int, int], dict[str, dict[str, Any]]] = {}
    for row in found["rows"]:
        records.setdefault((row["stiffness"], row["speed"]), {})[row["law"]] = row

    def cell(row: dict[str, Any]) -> str:
        regime = Regime.label(row["regime"])
        if row["period"] is None:
            return regime
        return f"{regime}, {row['period']:.3g} s, {1e3 * row['drop']:.1f} mN"

    laws = [name for name in next(iter(records.values())) if name != "measured"]
    rows = [
        [
            f"{stiffness} N/m, {speed} µm/s",
            "fitted" if [stiffness, speed] in found["fitted"] else "predicted",
            *(cell(own[name]) for name in ("measured", *laws)),
        ]
        for (stiffness, speed), own in records.items()
    ]
    yield table(["record", "", "measured", *(f"`{name}`" for name in laws)], rows)


BLOCKS: dict[str, Callable[[], Iterator[str]]] = {
    "parameters": parameters,
    "commands": commands,
    "topics": topics,
    "numbers": numbers,
    "comparison": comparison,
    "axis": axis,
    "coverage": coverage,
    "paper_on_paper": paper_on_paper,
}


def filled(page: str) -> str:
    """Return the text of a page with all of its blocks made again."""

    def block(match: re.Match[str]) -> str:
        name = match[1]
        text = "\n".join(BLOCKS[name]())
        return f"<!-- generated: {name} -->\n\n{text}\n<!-- end: {name} -->"

    pattern = r"<!-- generated: (\w+) -->.*?<!-- end: \1 -->"
    return re.sub(pattern, block, page, flags=re.DOTALL)


def main() -> None:
    """Fill in all pages."""
    for page in PAGES:
        path = HERE / page
        path.write_text(filled(path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
