"""Completion in bash and zsh: what the Tab key makes of a line that is typed on a terminal."""

import os
import pty
import shutil
import subprocess
import termios
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Thread

import pytest

from tests.app.conftest import Run
from tests.nodes.graph import wait_for

pytestmark = pytest.mark.process

Complete = Callable[[str], str]

_BASH = """
eval "$(<completion)"
bind 'set enable-bracketed-paste off'
bind '"\\C-u": kill-whole-line'
tell() { printf '%s' "$READLINE_LINE" >part; mv part line; }
bind -x '"\\C-x": tell'
touch line
"""
_ZSH = """
eval "$(<completion)"
setopt no_auto_list
tell() { printf '%s' "$BUFFER" >part; mv part line }
zle -N tell
bindkey '^X' tell
touch line
"""


@pytest.fixture(params=["bash", "zsh"])
def complete(request: pytest.FixtureRequest, stickslip: Run, tmp_path: Path) -> Iterator[Complete]:
    """Return what stands behind `stickslip` after the Tab key."""
    shell = request.param
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    (tmp_path / "completion").write_text(stickslip("completion", shell).stdout)
    (tmp_path / "start").write_text(_BASH)
    (tmp_path / ".zshrc").write_text(_ZSH)
    (tmp_path / "logs").mkdir()
    for name in ("mine.yaml", "notes.txt", "loop.py", "logs/first.mcap"):
        (tmp_path / name).touch()
    command = ["bash", "--noprofile", "--rcfile", "start", "-i"] if shell == "bash" else ["zsh"]
    line = tmp_path / "line"
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 200))

    def drain() -> None:
        try:
            while os.read(ours, 65536):
                pass
        except OSError:  # how Linux tells that the other side is closed
            pass

    def call(text: str) -> str:
        line.unlink()
        os.write(ours, f"\x15stickslip {text}\t\x18".encode())
        wait_for(line.exists, f"the completion of {text!r}")
        return line.read_text().removeprefix("stickslip ")

    reader = Thread(target=drain)
    with subprocess.Popen(
        command,
        cwd=tmp_path,
        env=os.environ | {"HOME": str(tmp_path), "ZDOTDIR": str(tmp_path), "TERM": "dumb"},
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        start_new_session=True,
    ) as process:
        os.close(theirs)
        reader.start()
        wait_for(line.exists, f"the start of {shell}")
        yield call
        process.kill()
    reader.join()
    os.close(ours)


def test_what_is_completed(complete: Complete) -> None:
    assert complete("simu") == "simulate "
    # Options of the command, and their choices.
    assert complete("run paper --no-") == "run paper --no-control "
    assert complete("sweep paper --carr").startswith("sweep paper --carry")
    assert complete("simulate paper --carr") == "simulate paper --carr"
    assert complete("run paper --pace lo") == "run paper --pace lockstep "
    assert complete("run paper --pace=lo") == "run paper --pace=lockstep "
    assert complete("run paper --duration 3 --comp") == "run paper --duration 3 --composed "
    assert complete("sweep paper --colour amp") == "sweep paper --colour amplitude "
    assert complete("completion z") == "completion zsh "
    assert complete("simulate paper --duration n") == "simulate paper --duration n"
    # Scenarios, laws and files.
    assert complete("simulate pap") == "simulate paper "
    assert complete("simulate mi") == "simulate mine.yaml "
    assert complete("simulate lo") == "simulate logs/"
    assert complete("simulate not") == "simulate not"
    assert complete("new x.yaml --from feed_drive_") == "new x.yaml --from feed_drive_motor "
    assert complete("design paper --controller slid") == "design paper --controller sliding_mode "
    assert complete("run paper --controller slid") == "run paper --controller sliding_mode "
    assert complete("run paper --controller loo") == "run paper --controller loop.py "
    assert complete("report mine.yaml l") == "report mine.yaml lo"
    assert complete("report mine.yaml log") == "report mine.yaml logs/"
    assert complete("report logs/f") == "report logs/first.mcap "
    assert complete("repair logs/ n") == "repair logs/ notes.txt "
    assert complete("simulate paper --plot=not") == "simulate paper --plot=notes.txt "
    # Parameters and their values.
    assert complete("simulate paper -p plant.belt_s") == "simulate paper -p plant.belt_speed="
    assert complete("sweep paper --over plant.mas") == "sweep paper --over plant.mass="
    assert complete("sweep paper --over=plant.mas") == "sweep paper --over=plant.mass="
    assert complete("set plant.mass=3 washout_controller.lin") == (
        "set plant.mass=3 washout_controller.linear_gain="
    )
    law = "run paper -p plant.friction.law="
    assert complete(f"{law}cou") == f"{law}coulomb "
    assert complete("set plant.autostart=t") == "set plant.autostart=true "
