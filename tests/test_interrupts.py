"""SIGINT while a process of this package imports."""

import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from stickslip_ros.interrupts import NODE_SCRIPTS
from tests.nodes.graph import PATIENCE

IMPORTED = """
import signal, time
signal.raise_signal(signal.SIGINT)
time.sleep(0.2)  # the signal is looked at again meanwhile
done = True
"""

IMPORTS = """
import signal, sys
from stickslip_ros.interrupts import raise_interrupts
raise_interrupts()
try:
    import slow
    signal.pause()
except KeyboardInterrupt:
    print(sys.modules["slow"].done)
"""


def test_every_installed_script_is_known() -> None:
    scripts = metadata.distribution("stickslip_ros").entry_points.select(group="console_scripts")
    assert {"stickslip", *NODE_SCRIPTS} == set(scripts.names)


@pytest.mark.process
def test_an_interrupt_amid_an_import_comes_after_it(tmp_path: Path) -> None:
    """Within the import of a C extension it would be an ImportError."""
    (tmp_path / "slow.py").write_text(IMPORTED, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", IMPORTS],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (done.stdout, done.stderr) == ("True\n", "")
