"""Benchmarks with a missing requirement, or a party that fails."""

import json
import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from benchmarks.parties import Slice, party, results_by_turns
from tests.nodes.graph import PATIENCE

ROUNDS = 3
REASONS = {
    "at the start": "no message came",
    "in a slice": "three are too many",
    "at the end": "samples are missing",
}


@contextmanager
def counting(fails: str) -> Generator[Slice[int]]:
    """Return the length of each slice, until it fails."""
    slices = 0

    def run(length: int) -> int:
        nonlocal slices
        slices += 1
        if slices == 3 and fails == "is killed":
            os.abort()
        if slices == 3 and fails == "in a slice":
            raise ValueError("three are too many")
        return length

    if fails == "at the start":
        raise SystemExit("no message came")
    yield run
    if fails == "at the end":
        raise SystemExit("samples are missing")


def first_slice(run: Slice[int]) -> int:
    return run(7)


@pytest.mark.long
@pytest.mark.process
def test_a_party_that_fails_is_named_with_the_reason_and_the_others_have_results() -> None:
    kinds = ("never", *REASONS, "is killed")
    results, failures = results_by_turns(
        ROUNDS, {kind: party(counting, kind) for kind in kinds}, first_slice
    )
    assert results == {kind: [7] * ROUNDS for kind in ("never", "at the end")}
    reasons = REASONS | {"is killed": "it ended early, with status -6"}
    assert {row.what: row.failure for row in failures} == reasons


@pytest.mark.process
def test_a_benchmark_that_needs_a_browser_is_skipped_without_one(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks", "dashboard", "--json"],
        cwd=Path(__file__).parents[2],
        env={**os.environ, "PATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 77
    assert "this needs chromium" in done.stderr
    assert "benchmarks.dashboard skipped" in done.stderr
    report = json.loads(done.stdout)
    assert (report["skipped"], report["failed"]) == (["dashboard"], {})
