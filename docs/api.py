"""The reference of the Python API: what is public, by section, from signatures and docstrings."""

import ast
import re
import textwrap
from collections.abc import Iterator
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

PUBLIC = {
    "testing": {
        "stickslip_ros.testing": ["ClosedLoop", "RunResult", "Diagnostics", "own_domain"],
    },
    "bags": {
        "stickslip_ros.bags": ["Recording", "RunBlock"],
        "stickslip_ros.samples": ["Sample", "SampleColumns", "ForceColumns"],
        "stickslip_ros.arrays": ["Table"],
        "stickslip_ros.bags.report": ["report_of_bag"],
    },
    "scenarios": {
        "stickslip_ros.scenarios.files": ["load_scenario", "Scenario", "parameter_file"],
    },
    "physics": {
        "stickslip_ros.physics.model.drive": ["Drive"],
        "stickslip_ros.physics.model.friction": [
            "FrictionLaw", "Stribeck", "Coulomb", "Linear", "Exponential", "LAWS",
        ],
        "stickslip_ros.physics.motion": ["Motion"],
        "stickslip_ros.physics.measures.breakpoints": ["Breakpoints"],
        "stickslip_ros.physics.loop.washout": ["WashoutParameters", "Washout"],
        "stickslip_ros.physics.model.equations": ["WashoutGains"],
        "stickslip_ros.physics.loop.sampled_loop": ["SampledLoop", "Verdict"],
        "stickslip_ros.physics.model.disturbance": ["Disturbance"],
        "stickslip_ros.physics.loop.simulation": ["simulate_sampled", "simulate_continuous"],
        "stickslip_ros.physics.measures": ["CycleMeter", "Measures", "Cycle", "Regime"],
    },
    "theory": {
        "stickslip_ros.physics.theory.linear": ["expand", "Expansion"],
        "stickslip_ros.physics.theory.hopf": [
            "hopf_points", "HopfPoint", "first_lyapunov_coefficient", "crossing_speed",
        ],
        "stickslip_ros.physics.theory.closed_forms": ["CubicLoop"],
        "stickslip_ros.physics.theory.sticking": ["sticking_onset", "StickingOnset"],
        "stickslip_ros.physics.theory.limit_cycles": [
            "limit_cycles", "limit_cycle_of_run", "shoot", "LimitCycle",
        ],
        "stickslip_ros.physics.theory.hopf_cycles": ["limit_cycle_from_hopf"],
        "stickslip_ros.physics.theory.critical_gains": ["critical_gains", "CriticalGains"],
        "stickslip_ros.physics.theory.linear_sampled_loop": ["LinearSampledLoop", "GainInterval"],
    },
    "studies": {
        "stickslip_ros.studies.plan": ["Axis", "Grid", "RandomSample", "Carry"],
        "stickslip_ros.studies.settling": ["SettlingCourse"],
        "stickslip_ros.studies.sweep": ["sweep_study"],
        "stickslip_ros.studies.basin": ["basin_study", "default_axes", "Basins", "Attractor"],
        "stickslip_ros.studies.columns": ["compute_columns", "Columns"],
        "stickslip_ros.studies.journal": ["Journal"],
        "stickslip_ros.studies.runner": ["run"],
        "stickslip_ros.studies.design": ["Task", "design", "Design", "Check", "Margins"],
    },
    "errors": {
        "stickslip_ros.errors": [
            "StickslipError", "InvalidInputError", "BagError", "MessageError", "RunError",
        ],
    },
}  # fmt: skip
"""The public Python API: what a program may rely on, by section of reference.md and module."""


def reference(section: str) -> Iterator[str]:
    """Yield the public API of a section."""
    for module, names in PUBLIC[section].items():
        for name in names:
            node, after = _definition(module, name)
            yield f"### {name}\n"
            yield f"`from {module} import {name}`\n"
            if isinstance(node, ast.FunctionDef):
                yield f"**`{_signature(node)}`**\n"
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                yield from _prose(ast.get_docstring(node) or "")
            else:
                yield f"{_text(after)}\n"
            if isinstance(node, ast.ClassDef) and (members := "".join(_members(node))):
                yield members


def _definition(module: str, name: str) -> tuple[ast.stmt, ast.stmt | None]:
    """Return the statement that defines a name, be it imported there, and the one behind it."""
    spec = find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    body = ast.parse(Path(spec.origin).read_text(encoding="utf-8")).body
    for node, after in pairwise([*body, None]):
        if isinstance(node, ast.ImportFrom) and name in {alias.name for alias in node.names}:
            return _definition(node.module or "", name)
        if node is not None and _name(node) == name:
            return node, after
    raise AssertionError(f"{module} has no {name}")


def _members(node: ast.ClassDef) -> Iterator[str]:
    """Yield an item for each public member of a class, those that `__init__` sets among them."""
    if node.bases:
        yield f"- bases: `{', '.join(ast.unparse(base) for base in node.bases)}`\n"
    for member, after in pairwise([*node.body, None]):
        if isinstance(member, ast.FunctionDef):
            yield from _method(node.name, member)
        elif isinstance(member, ast.AnnAssign | ast.Assign) and not _name(member).startswith("_"):
            yield _item(f"`{ast.unparse(member)}`", _text(after))


def _method(of: str, node: ast.FunctionDef) -> Iterator[str]:
    meaning, kinds = _text(node.body[0]), {ast.unparse(d) for d in node.decorator_list}
    if node.name == "__init__":
        if meaning:
            yield _item(f"**`{of}{_signature(node).removeprefix(node.name)}`**", meaning)
        for statement, after in pairwise([*node.body, None]):
            if isinstance(statement, ast.AnnAssign | ast.Assign) and _text(after):
                yield _item(f"`{_name(statement)}`", _text(after))
    elif node.name.startswith("_") or any(kind.endswith(".setter") for kind in kinds):
        return
    elif kinds & {"property", "cached_property"}:
        returns = f": {ast.unparse(node.returns)}" if node.returns else ""
        yield _item(f"`{node.name}{returns}`", meaning)
    else:
        yield _item(f"{'classmethod ' * ('classmethod' in kinds)}**`{_signature(node)}`**", meaning)


def _item(what: str, meaning: str) -> str:
    return f"- {what}: {meaning}\n" if meaning else f"- {what}\n"


def _name(node: ast.stmt) -> str:
    if isinstance(node, ast.AnnAssign | ast.Assign):
        target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
        return ast.unparse(target).removeprefix("self.")
    return getattr(node, "name", "")


def _signature(node: ast.FunctionDef) -> str:
    arguments = ast.unparse(node.args).removeprefix("self").removeprefix("cls").removeprefix(", ")
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    return f"{node.name}({arguments}){'' if node.name == '__init__' else returns}"


def _text(node: ast.stmt | None) -> str:
    """Return a docstring, given as a statement, in one line; nothing for another statement."""
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
        return " ".join(str(node.value.value).split())
    return ""


def _prose(docstring: str) -> Iterator[str]:
    """Yield the paragraphs of a docstring, an example among them as a block that the tests run."""
    for paragraph in docstring.split("\n\n"):
        if paragraph.startswith("    "):
            # The formatter looks at the page, too.
            code = re.sub(r"(?<=\S) +#", "  #", textwrap.dedent(paragraph))
            yield f"```python\n{code}\n```\n"
        else:
            yield f"{paragraph}\n"
