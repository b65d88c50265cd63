"""Completion in bash and zsh, asked of the shells themselves."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from stickslip_ros.app.commands import COMMANDS
from tests.app.conftest import Run
from tests.nodes.graph import PATIENCE

pytestmark = pytest.mark.process

Complete = Callable[..., list[str]]

_CALL = """
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
_stickslip
printf '%s\\n' "${COMPREPLY[@]}"
"""
_AS_ZSH_DOES = "emulate -L sh; setopt kshglob noshglob braceexpand"


@pytest.fixture(params=["bash", "zsh"])
def shell(request: pytest.FixtureRequest) -> str:
    if shutil.which(request.param) is None:
        pytest.skip(f"{request.param} is not installed")
    return request.param


@pytest.fixture
def complete(stickslip: Run, tmp_path: Path, shell: str) -> Complete:
    """Return what the shell proposes for the last of the words of a line."""
    script = tmp_path / "completion"
    script.write_text(stickslip("completion", shell).stdout)
    (tmp_path / "mine.yaml").touch()
    (tmp_path / "notes.txt").touch()
    (tmp_path / "bags").mkdir()
    mode = _AS_ZSH_DOES if shell == "zsh" else ""

    def call(*words: str) -> list[str]:
        run = f'source ./completion; ask() {{ {mode}{_CALL}}}; ask "$@"'
        done = subprocess.run(
            [shell, "-c", run, shell, "stickslip", *words],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert done.returncode == 0, done.stderr
        proposed = [line.strip() for line in done.stdout.splitlines() if line]
        # compgen of bash filters by the word; zsh does so itself, after the function.
        return [word for word in proposed if shell == "bash" or word.startswith(words[-1])]

    return call


def test_what_is_completed(complete: Complete, shell: str) -> None:
    assert complete("") == list(COMMANDS)
    assert complete("simu") == ["simulate"]
    # Options of the command, and their choices.
    assert complete("run", "paper", "--no-") == ["--no-control"]
    assert "--carry" in complete("sweep", "paper", "--")
    assert "--carry" not in complete("simulate", "paper", "--")
    assert complete("run", "paper", "--pace", "lo") == ["lockstep"]
    assert complete("completion", "z") == ["zsh"]
    assert complete("simulate", "paper", "--duration", "") == []
    # Scenarios and files.
    proposed = complete("simulate", "")
    assert {"feed_drive", "paper", "mine.yaml", "bags"} <= set(proposed)
    assert "notes.txt" not in proposed
    assert complete("simulate", "pa") == ["paper"]
    assert complete("new", "x.yaml", "--from", "fe") == [
        "feed_drive",
        "feed_drive_motor",
        "feed_profile",
    ]
    assert complete("report", "b") == ["bags"]
    assert complete("simulate", "paper", "--plot", "no") == ["notes.txt"]
    # Parameters and their values.
    assert complete("simulate", "paper", "-p", "plant.belt_s") == ["plant.belt_speed="]
    assert complete("sweep", "paper", "--over", "plant.mas") == ["plant.mass="]
    assert complete("set", "washout_controller.lin") == ["washout_controller.linear_gain="]
    if shell == "bash":  # which splits words at "="
        assert complete("run", "paper", "-p", "plant.friction.law", "=", "cou") == ["coulomb"]
        assert complete("set", "plant.autostart", "=") == ["true", "false"]
    else:
        law = "plant.friction.law="
        assert complete("run", "paper", "-p", f"{law}cou") == [f"{law}coulomb"]
