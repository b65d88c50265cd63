"""Which changes to the physics does the test suite not detect?

Each mutant is a copy of the checkout with one change below `stickslip_ros/physics`: another sign,
operator, comparison, number or condition, chosen at random by the seed. The tests that start
neither a process nor a node run against each mutant, those of the physics first, until one fails.
The output lists each mutant and the test that caught it. Some mutants that survive are equivalent
to the original up to rounding.
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path
from typing import NamedTuple

CHECKOUT = Path(__file__).parents[1]
PHYSICS = Path("stickslip_ros/physics")
TIERS = (
    ("tests/physics",),
    ("tests/studies", "tests/paper", "tests/plots", "tests/scenarios", "tests/bags", "tests/app"),
)
TIMEOUT = 600.0

OPERATORS = {"+": "-", "-": "+", "*": "/", "/": "*", "<": ">=", ">": "<=", "<=": ">", ">=": "<"}
OPERATORS |= {"is": "is not", "is not": "is", "==": "!=", "!=": "==", "and": "or", "or": "and"}


class Mutant(NamedTuple):
    """A change of one file: the text from byte `start` to `end`, before and after."""

    file: Path
    line: int
    start: int
    end: int
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.before} -> {self.after}"


def main() -> int:
    """Test the mutants; return 0 whether or not they are caught."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutants", description=__doc__)
    parser.add_argument("--count", type=int, default=44, help="number of mutants (default: 44)")
    parser.add_argument("--seed", type=int, default=0, help="seed that selects them (default: 0)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="parallel runs")
    arguments = parser.parse_args()
    everything = list(chain.from_iterable(map(mutants_of, sorted(PHYSICS.rglob("*.py")))))
    chosen = random.Random(arguments.seed).sample(everything, arguments.count)
    if failure := first_failure(Mutant(chosen[0].file, 0, 0, 0, "", "")):
        parser.error(f"without a change {failure}: the tests must pass before mutants are tried")
    caught = 0
    with ThreadPoolExecutor(arguments.workers) as pool:
        for mutant, failure in zip(chosen, pool.map(first_failure, chosen), strict=True):
            print(f"{'caught  ' if failure else 'SURVIVES'} {mutant}  {failure}", flush=True)
            caught += bool(failure)
    print(f"{caught} of {len(chosen)} caught")
    return 0


def mutants_of(file: Path) -> Generator[Mutant]:
    """Return every mutant of a file."""
    source = (CHECKOUT / file).read_text(encoding="utf-8")
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def place(line: int, column: int) -> int:
        return starts[line - 1] + column

    def between(one: ast.expr, other: ast.expr) -> Generator[Mutant]:
        start = place(one.end_lineno or 0, one.end_col_offset or 0)
        end = place(other.lineno, other.col_offset)
        text = source.encode()[start:end].decode()
        if (operator := text.strip("() \n")) in OPERATORS:
            after = text.replace(operator, OPERATORS[operator])
            yield Mutant(file, one.end_lineno or 0, start, end, operator, after)

    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.BinOp(left=left, right=right):
                yield from between(left, right)
            case ast.Compare(left=left, comparators=[right]):
                yield from between(left, right)
            case ast.BoolOp(values=[left, right, *_]):
                yield from between(left, right)
            case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=operand):
                start = place(node.lineno, node.col_offset)
                end = place(operand.lineno, operand.col_offset)
                before = source.encode()[start:end].decode()
                yield Mutant(file, node.lineno, start, end, before, "")
            case ast.Constant(value=float(value)) if value not in (0.0, float("inf")):
                start = place(node.lineno, node.col_offset)
                end = place(node.end_lineno or 0, node.end_col_offset or 0)
                yield Mutant(file, node.lineno, start, end, str(value), repr(1.01 * value))
            case _:
                pass


def first_failure(mutant: Mutant) -> str:
    """Return the first test that fails for the mutant, and how; empty if none fails."""
    with tempfile.TemporaryDirectory() as directory:
        copy = Path(directory) / "checkout"
        listing = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        for name in subprocess.check_output(listing, cwd=CHECKOUT, text=True).split("\0"):
            if (CHECKOUT / name).is_file():
                (copy / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(CHECKOUT / name, copy / name)
        text = (copy / mutant.file).read_bytes()
        changed = text[: mutant.start] + mutant.after.encode() + text[mutant.end :]
        (copy / mutant.file).write_bytes(changed)
        return next(filter(None, (failure_of(copy, tests) for tests in TIERS)), "")


def failure_of(copy: Path, tests: Sequence[str]) -> str:
    """Return the first test of a copy that fails, or that the tests do not finish."""
    pytest = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not process and not long"]
    environment = os.environ | {"PYTHONPATH": str(copy), "CI": "true"}
    try:
        done = subprocess.run(
            [*pytest, *tests], cwd=copy, env=environment, timeout=TIMEOUT, capture_output=True
        )
    except subprocess.TimeoutExpired:
        return f"not finished after {TIMEOUT:g} s"
    if done.returncode == 0:
        return ""
    lines = done.stdout.decode().splitlines()
    return next((line for line in lines if line.startswith(("FAILED", "ERROR"))), "no test ran")


if __name__ == "__main__":
    sys.exit(main())
