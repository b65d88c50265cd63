"""Files that commands leave where the disk is full."""

from pathlib import Path

import pytest

from tests.app.conftest import Run
from tests.record.runs import full_disk

_OLD = b"a figure of before"


@pytest.mark.parametrize(
    "command",
    ["new new.yaml --complete", "simulate feed_drive --duration 0.2 --out new.csv --plot old.png"],
)
def test_the_old_file_stays_and_the_next_call_works(
    command: str, stickslip: Run, tmp_path: Path
) -> None:
    words = command.split()
    for word in words:
        if word.startswith("old."):
            (tmp_path / word).write_bytes(_OLD)
    before = _files(tmp_path)
    with full_disk(4096):
        failed = stickslip(*words)
    assert failed.returncode == 2
    (line,) = failed.stderr.splitlines()
    assert line.endswith("cannot be written: File too large")
    assert _files(tmp_path) == before
    done = stickslip(*words)
    assert done.returncode == 0, done.stderr
    after = _files(tmp_path)
    assert all(after[word] != before.get(word) for word in words if word[:4] in ("new.", "old."))
    assert not [name for name in after if name.endswith(".part")]


def _files(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir()}
