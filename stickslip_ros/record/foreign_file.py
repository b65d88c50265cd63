"""Files of other tools, read in a process of its own: false sizes in a file can end it."""

import os
import resource
import subprocess
import sys
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.record.adapters import BY_END, BY_START

_START = 16
"""First bytes that tell a format."""
_MEMORY, _TIME = 1 << 30, 60
"""Bytes and seconds that reading a file may take."""
_TEXT = b"text:"
"""What comes before a table as text in what the process writes."""


class ForeignTable(NamedTuple):
    """What is in a file: a table as text, or vectors by name."""

    text: bytes | None
    vectors: Mapping[str, FloatArray]
    units: Mapping[str, str]
    """Units of the vectors by their names; empty where there is none."""
    notes: list[str]


def format_of(path: Path, stream: BinaryIO) -> str | None:
    """Return how the format of an open file is known, by its first bytes or its end; or None."""
    start = os.pread(stream.fileno(), _START, 0)
    sign = next((sign.decode() for sign in BY_START if start.startswith(sign)), None)
    return sign or (path.suffix.lower() if path.suffix.lower() in BY_END else None)


def read_foreign(stream: BinaryIO, form: str, most: int) -> ForeignTable:
    """Return what is in a file of a format as `format_of` names it.

    Of a structure `log` the vector `log.t` is a field, and `data[2]` is the second column of a
    matrix. Raises ValueError if the file cannot be read, or if its vectors have more than `most`
    numbers.
    """
    paths = os.pathsep.join(filter(None, sys.path))
    settings = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-P", "-m", __name__, form, str(most)]
    try:
        child = subprocess.run(
            command, stdin=stream, capture_output=True, env=settings, timeout=_TIME, check=False
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"it takes more than {_TIME} s") from None
    said = child.stderr.decode(errors="replace").strip()
    if child.returncode != 0:
        raise ValueError(said.rpartition("\n")[2] or "it is damaged")
    if child.stdout.startswith(_TEXT):
        return ForeignTable(child.stdout[len(_TEXT) :], {}, {}, said.splitlines())
    with np.load(BytesIO(child.stdout), allow_pickle=False) as arrays:
        names = {name.partition("=")[2]: name for name in arrays}
        vectors = {name: arrays[key] for name, key in names.items()}
    units = {name: key.partition("=")[0] for name, key in names.items()}
    return ForeignTable(None, vectors, units, [])


def _main(form: str, most: int) -> None:
    """Write what is in the file at standard input to standard output, as text or as numpy does."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    adapter = BY_END.get(form) or BY_START[form.encode()]
    try:
        table = adapter.read(sys.stdin.buffer.read())
        if isinstance(table, str):
            sys.stdout.buffer.write(_TEXT + table.encode())
            return
        # With a sign in its name, for numpy takes some names itself.
        vectors = {f"{unit}={name}": values for name, unit, values in table}
    except ImportError:
        sys.exit(f"{adapter.format} is read by {adapter.package}: install it")
    except MemoryError:
        sys.exit(f"it takes more than {_MEMORY} bytes of memory")
    except Exception as error:
        sys.exit(f"it is damaged: {type(error).__name__}")
    if sum(map(len, vectors.values())) > most:
        sys.exit(f"it has more than {most} numbers")
    target = BytesIO()
    np.savez(target, **{name: values.astype(float) for name, values in vectors.items()})
    sys.stdout.buffer.write(target.getbuffer())


if __name__ == "__main__":
    _main(sys.argv[1], int(sys.argv[2]))
