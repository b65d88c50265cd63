"""Tables: framed on a terminal of any width, plain text into a pipe."""

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
import threading
from pathlib import Path

import pytest

from stickslip_ros.app import output
from stickslip_ros.app.output import print_parts, progress_bar
from stickslip_ros.show.measure_table import measure_table
from stickslip_ros.tables import TextTable
from tests.nodes.graph import PATIENCE, wait_for

REFERENCE = Path(__file__).parents[2] / "bags" / "reference"
REPORT = [sys.executable, "-m", "stickslip_ros.app.main", "report"]
LONG = "bags/" + 20 * "long_"


def on_terminal(command: list[str], columns: int) -> list[str]:
    """Run a command on a terminal of that width; return the lines that it shows."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
    inherited = {
        name: value
        for name, value in os.environ.items()
        if name not in {"COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE"}
    }
    with subprocess.Popen(command, stdout=theirs, env=inherited | {"TERM": "xterm"}) as process:
        os.close(theirs)
        shown = b""
        try:
            while block := os.read(ours, 65536):
                shown += block
        except OSError:  # how Linux tells that the other side is closed
            pass
        os.close(ours)
        assert process.wait(timeout=PATIENCE) == 0
    return shown.decode().splitlines()


@pytest.mark.process
def test_a_person_gets_a_frame_and_a_colour() -> None:
    lines = on_terminal([*REPORT, str(REFERENCE)], 80)
    (regime,) = (line for line in lines if "stick-slip" in line)
    assert regime.count("│") == 3
    assert re.search(r"\x1b\[[0-9;]*3[0-9]m", regime)


@pytest.mark.process
def test_nothing_is_lost_on_a_narrow_terminal(tmp_path: Path) -> None:
    """Headings and labels may be broken over lines, figures may not."""
    other = tmp_path / "the other one"
    other.symlink_to(REFERENCE)
    shown = on_terminal([*REPORT, str(REFERENCE), str(other)], 30)
    lines = [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in shown]
    assert max(map(len, lines)) <= 30
    text = "\n".join(lines)
    assert "…" not in text
    for figure in ("stick-slip", "325.8 µm", "30.77 mm/s", "114.9 N"):
        assert text.count(figure) == 2


def test_a_pipe_gets_plain_lines(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever forces colours. One column has no heading; control characters are escapes."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    rows = [["regime", "stick-slip", LONG], ["bag", "-", ""]]
    print_parts(TextTable("drives [bold]", ["", "first", "second"], rows))
    assert capsys.readouterr().out.splitlines() == [
        "drives [bold]",
        "        first       second",
        f"regime  stick-slip  {LONG}",
        "bag     -",
    ]
    print_parts(measure_table("run", {"": {"amplitude": 434e-6, "bag": "bags/机床"}}))
    assert capsys.readouterr().out == "run\namplitude  434 µm\nbag        bags/机床\n"
    print_parts(
        measure_table("", {"": {"regime": "stick_slip", "steady": False, "trend": "decaying"}})
    )
    assert capsys.readouterr().out == "regime  stick-slip, not steady: decaying\n"
    print_parts(TextTable("empty", ["topic", "messages"], []))
    assert capsys.readouterr().out == "empty\ntopic  messages\n"
    print_parts(TextTable("a\x1b[2J", ["", ""], [["b\n", "\x07"]]))
    assert capsys.readouterr().out == "a\\x1b[2J\nb\\n  \\x07\n"


def test_rounding_reads_zero(capsys: pytest.CaptureFixture[str]) -> None:
    before = {"regime": "stick_slip", "amplitude": 4e-4, "midpoint": 3e-4, "peak_force": 120.0}
    resting = {"amplitude": 9e-17, "velocity_amplitude": 1e-15, "midpoint": 2.5e-4}
    after = {"regime": "equilibrium", **resting, "peak_force": 7e-15, "resting_force": 7e-15}
    print_parts(measure_table("", {"before": before, "after": after}))
    shown = [line.split(maxsplit=1)[-1].strip() for line in capsys.readouterr().out.splitlines()]
    assert re.search(r"400 µm +0 µm", shown[2])
    assert re.search(r"- +0 m/s", shown[3])
    assert re.search(r"300 µm +250 µm", shown[4])
    assert re.search(r"120 N +0 N", shown[5])
    assert re.search(r"- +0 N", shown[6])


def test_a_progress_bar_says_what_is_done_next(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    with progress_bar("identifying", None) as progress:
        progress(0.0)
        progress(0.0, "identifying: stribeck")
    assert "identifying: stribeck" in capsys.readouterr().err


def test_a_long_work_writes_lines_into_a_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    monkeypatch.setattr(output, "tell", told.append)
    monkeypatch.setattr(output, "_LINE_INTERVAL", 1e-3)
    with progress_bar("identifying", None, lines=True) as progress:
        wait_for(lambda: told and re.fullmatch(r"identifying, \d+ s", told[-1]), "a line")
        progress(0.0, "identifying: stribeck")
        wait_for(lambda: re.fullmatch(r"identifying: stribeck, \d+ s", told[-1]), "the next law")


@pytest.mark.timeout(60)
def test_the_end_of_a_work_waits_for_no_line_and_none_follows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(output, "_LINE_INTERVAL", 1e6)
    before = {*threading.enumerate()}
    with progress_bar("identifying", None, lines=True):
        (own,) = {*threading.enumerate()} - before
    assert not own.is_alive()


@pytest.mark.parametrize("on_a_terminal", [True, False])
@pytest.mark.parametrize(("first", "begin"), [(0, 30.0), (100, 0.0)], ids=["compiles", "goes on"])
def test_the_time_left_is_told_after_a_quarter(
    on_a_terminal: bool, first: int, begin: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """True within a half, of points that compile at the begin; not of points that differ."""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: on_a_terminal)
    monkeypatch.setattr(output, "monotonic", lambda: clock)
    told: list[tuple[float, int, str]] = []

    def tell(text: str) -> None:
        told.append((clock, done, text))

    monkeypatch.setattr(output, "tell", tell)
    total = first + 200
    for even in (True, False):
        clock, done = 0.0, first
        with progress_bar("sweep", total, "; this is quicker", even=even) as progress:
            for done in range(first, total + 1):
                progress(done)
                clock += 2.0 * (0.5 + done % 2) + begin * (done == first)
        (_, _, hint), *rest = told
        assert hint == "sweep; this is quicker"
        assert [text for *_, text in rest] == ["sweep: about 5 min more"] * even
        for when, points, _ in rest:
            assert (points - first) * 4 in range(200, 250)
            assert 300.0 / 1.5 < clock - when < 300.0 * 1.5
        told.clear()
    for total, step in ((100, 10), (None, 1), (1000, 0)):
        with progress_bar("short, of unknown length, or without progress", total) as progress:
            for done in range(10):
                clock += 1.2
                progress(step * done)
    assert not told


@pytest.mark.parametrize(("cycles", "label"), [(0, "no whole cycle"), (4, "regime not known")])
def test_cycles_without_a_regime_are_not_denied(cycles: int, label: str) -> None:
    (row, _) = measure_table("", {"": {"regime": None, "cycles": cycles}}).rows
    assert row == ["regime", label]
