"""Which changes to the physics does the test suite not detect?

`mutants.json` holds 200 mutants. Each names a function of the physics and changes one expression
in it: another sign, operator, comparison, number or condition. It is found by these, whatever the
file, so that the same mutants are tried before and after code moves. The tests that start neither
a process nor a node run against a copy of the checkout with one mutant, those of the physics
first, until one fails. The output lists each mutant and the test that caught it. Some mutants that
survive are equivalent to the original up to rounding.
"""

import argparse
import ast
import copy
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

CHECKOUT = Path(__file__).parents[1]
PACKAGE = Path("stickslip_ros")
ROOMS = ("model", "motion", "measures", "theory")
FILE = Path(__file__).with_suffix(".json")
TIERS = (
    tuple(f"tests/{room}" for room in ROOMS),
    ("tests/studies", "reproduction", "tests/show", "tests/scenarios", "tests/record", "tests/app"),
)
TIMEOUT = 600.0

OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.And: ast.Or,
    ast.Or: ast.And,
}


class Mutant(NamedTuple):
    """One expression of a function, before and after."""

    function: str
    """Qualified name within its file."""
    before: str
    after: str
    number: int
    """Which of the equal expressions of the function is changed."""

    def __str__(self) -> str:
        return f"{self.function}: {self.before} -> {self.after} ({self.number})"


class Place(NamedTuple):
    """An expression in the source."""

    file: Path
    node: ast.expr


def main() -> int:
    """Test the mutants; return 0 whether or not they are caught."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=__doc__)
    parser.add_argument("--count", type=int, help="try so many of them, spread over all")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="parallel runs")
    parser.add_argument("--choose", type=int, metavar="COUNT", help=f"choose those of {FILE.name}")
    parser.add_argument("--seed", type=int, default=0, help="seed of the choice (default: 0)")
    arguments = parser.parse_args()
    places = expressions()
    if arguments.choose:
        chosen = random.Random(arguments.seed).sample(sorted(places), arguments.choose)
        FILE.write_text(json.dumps([each._asdict() for each in sorted(chosen)], indent=1) + "\n")
        return 0
    mutants = [Mutant(**each) for each in json.loads(FILE.read_text(encoding="utf-8"))]
    if arguments.count:
        mutants = mutants[:: max(1, len(mutants) // arguments.count)][: arguments.count]
    for gone in [mutant for mutant in mutants if mutant not in places]:
        print(f"GONE     {gone}")
    mutants = [mutant for mutant in mutants if mutant in places]
    if failure := first_failure(None, ""):
        parser.error(f"without a change {failure}: the tests must pass before mutants are tried")
    caught = 0
    with ThreadPoolExecutor(arguments.workers) as pool:
        tried = pool.map(lambda mutant: first_failure(places[mutant], mutant.after), mutants)
        for mutant, failure in zip(mutants, tried, strict=True):
            print(f"{'caught  ' if failure else 'SURVIVES'} {mutant}  {failure}", flush=True)
            caught += bool(failure)
    print(f"{caught} of {len(mutants)} caught")
    return 0


def expressions() -> dict[Mutant, Place]:
    """Return every mutant whose function and expression are found once, and its place."""
    found: dict[Mutant, list[Place]] = {}
    for file in sorted(
        file for room in ROOMS for file in (CHECKOUT / PACKAGE / room).rglob("*.py")
    ):
        for function, definition in functions(ast.parse(file.read_text(encoding="utf-8"))):
            seen: dict[tuple[str, str], int] = {}
            for node, mutated in changes(definition):
                texts = ast.unparse(node), ast.unparse(mutated)
                number = seen[texts] = seen.get(texts, 0) + 1
                mutant = Mutant(function, *texts, number)
                found.setdefault(mutant, []).append(Place(file.relative_to(CHECKOUT), node))
    return {mutant: places[0] for mutant, places in found.items() if len(places) == 1}


def functions(tree: ast.AST, outer: str = "") -> Generator[tuple[str, ast.AST]]:
    """Yield the qualified name of each function that is not within another, and the function."""
    for node in ast.iter_child_nodes(tree):
        match node:
            case ast.ClassDef(name=name):
                yield from functions(node, f"{outer}{name}.")
            case ast.FunctionDef(name=name):
                yield f"{outer}{name}", node
            case _:
                pass


def changes(function: ast.AST) -> Generator[tuple[ast.expr, ast.expr]]:
    """Yield each expression of a function that can be changed, and what it becomes."""
    within_texts = {
        part
        for node in ast.walk(function)
        if isinstance(node, ast.JoinedStr)
        for part in ast.walk(node)
    }
    for node in ast.walk(function):
        if node in within_texts:
            continue
        match node:
            case ast.BinOp(op=op) | ast.BoolOp(op=op) if type(op) in OPERATORS:
                mutated = copy.deepcopy(node)
                mutated.op = OPERATORS[type(op)]()
                yield node, mutated
            case ast.Compare(ops=[op]) if type(op) in OPERATORS:
                mutated = copy.deepcopy(node)
                mutated.ops = [OPERATORS[type(op)]()]
                yield node, mutated
            case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
                yield node, operand
            case ast.Constant(value=float(value)) if value not in (0.0, float("inf")):
                yield node, ast.Constant(1.01 * value)
            case _:
                pass


def first_failure(place: Place | None, after: str) -> str:
    """Return the first test that fails with a mutant, and how; empty if none fails."""
    with tempfile.TemporaryDirectory() as directory:
        checkout = Path(directory) / "checkout"
        listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        for name in subprocess.check_output(listing, cwd=CHECKOUT, text=True).split("\0"):
            if (CHECKOUT / name).is_file():
                (checkout / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(CHECKOUT / name, checkout / name)
        if place is not None:
            change(checkout / place.file, place.node, after)
        return next(filter(None, (failure_of(checkout, tests) for tests in TIERS)), "")


def change(file: Path, node: ast.expr, after: str) -> None:
    """Write the expression `after` where `node` stands in a file."""
    lines = file.read_bytes().splitlines(keepends=True)
    end = node.end_lineno or node.lineno
    head = b"".join(lines[: node.lineno - 1]) + lines[node.lineno - 1][: node.col_offset]
    tail = lines[end - 1][node.end_col_offset :] + b"".join(lines[end:])
    file.write_bytes(head + f"({after})".encode() + tail)


def failure_of(checkout: Path, tests: Sequence[str]) -> str:
    """Return the first test of a copy that fails, or that the tests do not finish."""
    pytest = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not process and not long"]
    environment = os.environ | {"PYTHONPATH": str(checkout), "CI": "true"}
    try:
        done = subprocess.run(
            [*pytest, *tests], cwd=checkout, env=environment, timeout=TIMEOUT, capture_output=True
        )
    except subprocess.TimeoutExpired:
        return f"not finished after {TIMEOUT:g} s"
    if done.returncode == 0:
        return ""
    lines = done.stdout.decode().splitlines()
    return next((line for line in lines if line.startswith(("FAILED", "ERROR"))), "no test ran")


if __name__ == "__main__":
    sys.exit(main())
