import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

SOURCE = Path(__file__).parents[2]


@pytest.fixture
def set_up(tmp_path):
    """Asks make for an environment made by a given Python."""
    # The make that runs the tests hands its own variables on.
    environment = {name: value for name, value in os.environ.items() if name != "MAKEFLAGS"}

    def run(python):
        command = ["make", "--silent", f"VENV={tmp_path / 'venv'}", f"PYTHON={python}"]
        return subprocess.run(command, cwd=SOURCE, env=environment, capture_output=True, text=True)

    return run


@pytest.fixture
def fake_python(tmp_path):
    """Makes a Python of which only this much goes wrong."""

    def make(pattern, action):
        python = tmp_path / "python3"
        python.write_text(
            f'#!/bin/sh\ncase "$*" in {pattern}) {action};; *) exec {sys.executable} "$@";; esac\n'
        )
        python.chmod(0o755)
        return python

    return make


def test_says_in_a_line_which_python_to_install(set_up):
    refused = set_up("false")
    assert refused.returncode != 0
    assert "install python3 python3-venv" in refused.stderr.splitlines()[0]


def test_says_in_a_line_what_to_install_where_venv_is_missing(set_up, fake_python):
    refused = set_up(fake_python("*ensurepip*", "exit 1"))
    assert refused.returncode != 0
    assert "-venv" in refused.stderr.splitlines()[0]


def test_an_interrupted_environment_is_not_taken_as_done(set_up, fake_python, tmp_path):
    half = tmp_path / "venv" / "bin" / "python"
    python = fake_python("*--clear*", f"mkdir -p {half.parent}; ln -sf $(which false) {half}")
    for _ in range(2):
        assert set_up(python).returncode != 0
        assert half.exists()
