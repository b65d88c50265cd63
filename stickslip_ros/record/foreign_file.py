"""Files of other tools: a table as text, or vectors, from a limited process."""

import os
import sys
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.record.limited_process import limited, result_of
from stickslip_ros.record.table_formats import BY_END, BY_START

_START = 16
"""First bytes that tell a format."""
_TIME = 60
"""Seconds that reading a file may take."""
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
    result = result_of(__name__, form, str(most), seconds=_TIME, stream=stream)
    if result.output.startswith(_TEXT):
        return ForeignTable(result.output[len(_TEXT) :], {}, {}, result.notes)
    with np.load(BytesIO(result.output), allow_pickle=False) as arrays:
        names = {name.partition("=")[2]: name for name in arrays}
        vectors = {name: arrays[key] for name, key in names.items()}
    units = {name: key.partition("=")[0] for name, key in names.items()}
    return ForeignTable(None, vectors, units, [])


def _main(form: str, most: int) -> None:
    """Write what is in the file at standard input to standard output, as text or as numpy does."""
    adapter = BY_END.get(form) or BY_START[form.encode()]
    with limited(f"{adapter.format} is read by {adapter.package}: install it"):
        table = adapter.read(sys.stdin.buffer.read())
        if isinstance(table, str):
            sys.stdout.buffer.write(_TEXT + table.encode())
            return
        # With a sign in its name, for numpy takes some names itself.
        vectors = {f"{unit.replace('=', ' ')}={name}": values for name, unit, values in table}
    if sum(map(len, vectors.values())) > most:
        sys.exit(f"it has more than {most} numbers")
    target = BytesIO()
    np.savez(target, **{name: values.astype(float) for name, values in vectors.items()})
    sys.stdout.buffer.write(target.getbuffer())


if __name__ == "__main__":
    _main(sys.argv[1], int(sys.argv[2]))
