"""Parts of the pages from the code: parameters, topics, numbers of the theory, of an example.

Fills in what stands between `<!-- generated: NAME -->` and `<!-- end: NAME -->` on the pages beside
this file.
"""

import json
import re
from argparse import Action
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from math import isinf
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.constants import Parameter
from stickslip_ros.record.topics import TOPICS
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS, NodeParameters, ReplayParameters
from stickslip_ros.studies.stability import stability
from stickslip_ros.theory.closed_forms import CubicLoop

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
    """Yield a table for what every node has, what controllers share, and what each node has."""
    common = NodeParameters()
    models = {**NODE_PARAMETERS, "replay": ReplayParameters()}
    rows = {
        node: [_parameter_row(p) for p in _listed(model) if p.name not in common.known]
        for node, model in models.items()
    }
    laws = [own for node, own in rows.items() if node.endswith("_controller")]
    every = [row for row in laws[0] if all(row in own for own in laws)]
    tracked = {row[0]: row for own in laws for row in own if row[0].startswith("`reference.")}
    shared = [*every, *tracked.values()]
    tables = {
        "every node": [_parameter_row(p) for p in _listed(common)],
        "every controller": every,
        "every controller that tracks a reference": [*tracked.values()],
        **{node: [row for row in own if row not in shared] for node, own in rows.items()},
    }
    for title, own in tables.items():
        yield f"## {title}\n"
        yield table(["parameter", "unit", "default", "allowed", "can be changed", "meaning"], own)
        if title == "plant":
            names = ", ".join(f"`{name}`" for name in models[title].known if ".reverse." in name)
            yield f"Of the other direction, by default as forward: {names}.\n"


def _listed(model: NodeParameters) -> Iterator[Parameter]:
    """Yield the parameters with a row of their own: neither those as forward nor the law."""
    for parameter in model.known.values():
        if ".reverse." not in parameter.name and parameter.name != "law":
            yield parameter


def _parameter_row(parameter: Parameter) -> list[str]:
    default = parameter.default
    if parameter.kind is bool:
        default = str(default).lower()
    elif parameter.kind is float:
        default = "inf" if isinf(default) else parameter.text(default)
    allowed = parameter.bounds
    if not parameter.finite:
        allowed += ", or inf" if allowed else "inf"
    return [
        f"`{parameter.name}`",
        parameter.unit or "",
        f"`{default}`" if default not in ("", [], parameter.unset) else default or "empty",
        allowed,
        parameter.changes,
        parameter.meaning.removesuffix("."),
    ]


def commands() -> Iterator[str]:
    """Yield what several commands share, and every command by group."""
    from stickslip_ros.app.commands import COMMANDS, EXAMPLES

    rows = {name: _arguments(name) for name in COMMANDS}
    count = Counter(tuple(row) for own in rows.values() for row in own)
    # Of an option with several meanings, the most frequent one is shared.
    often = {_first(row): [*row] for row, uses in reversed(count.most_common()) if uses >= SHARED}
    shared = sorted(often.values())
    yield "## Arguments of several commands\n"
    yield table(["argument", "meaning"], shared)
    groups = dict.fromkeys(group for group, _ in COMMANDS.values())
    for group in groups:
        yield f"## {group}\n"
        for name, (own_group, line) in COMMANDS.items():
            if own_group == group:
                yield from _command(name, line, rows[name], shared)
                yield f"Example: `{EXAMPLES.get(name, f'stickslip {name}')}`\n"


SHARED = 3
"""Number of commands from which on an argument is described once for all of them."""


def _arguments(command: str) -> list[list[str]]:
    """Return a row for each argument and option of a command."""
    from stickslip_ros.app.commands import command_parser

    parser = command_parser(command)
    formatter = parser._get_formatter()
    rows: list[list[str]] = []
    for action in parser._actions:
        if action.dest not in ("help", "quiet"):
            values = f" {_value(action)}" if action.nargs != 0 else ""
            names = [f"`{option}{values}`" for option in action.option_strings]
            meaning = formatter._expand_help(action).replace("|", "\\|")
            rows.append([", ".join(names or [f"`{_value(action)}`"]), meaning])
    return rows


def _first(row: Sequence[str]) -> str:
    """Return the name of an argument, without its value."""
    return row[0].strip("`").split()[0].strip("`,")


def _value(action: Action) -> str:
    return str(action.metavar or f"{{{','.join(action.choices or ())}}}")


def _command(name: str, line: str, rows: list[list[str]], shared: list[list[str]]) -> Iterator[str]:
    from stickslip_ros.app.commands import command_parser

    parser = command_parser(name)
    positional: list[str] = []
    for action in parser._actions:
        value = _value(action)
        if not action.option_strings:
            positional.append(f"{value} [{value} ...]" if action.nargs == "+" else value)
        elif action.required:
            positional.append(f"{action.option_strings[0]} {value}")
    yield f"### {name}\n"
    usage = ["stickslip", name, *positional, *(["[OPTION ...]"] if rows else [])]
    yield f"`{' '.join(usage)}`\n"
    description = " ".join((parser.description or line).split())
    yield f"{description[0].upper()}{description[1:].rstrip('.')}.\n"
    own = [row for row in rows if row not in shared]
    if own:
        yield table(["argument", "meaning"], own)
    names = [f"`{_first(row)}`" for row in rows if row in shared]
    if names:
        yield f"Also: {', '.join(names)}.\n"


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
    cubic = CubicLoop.from_drive(scenario.plant.as_drive())
    assert cubic is not None
    opened, closed, sampled = (found[f"{loop}_loop"] for loop in ("open", "closed", "sampled"))
    (cycle,), sticking = opened["limit_cycles"], found["sticking"]
    rows: dict[str, Any] = {
        "$a$, $b$": (cubic.slope, cubic.cubic),
        "equilibrium $X_0$, eq. 6": found["equilibrium_position"],
        "trace $p$, eq. 8": cubic.trace,
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
                f"{case['seconds']:.1f}",
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
            "seconds a run",
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
