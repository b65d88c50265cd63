"""Benchmarks with a missing requirement."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.nodes.graph import PATIENCE


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
