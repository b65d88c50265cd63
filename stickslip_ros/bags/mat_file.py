"""MAT files of MATLAB, read by scipy in a process of its own: false sizes in a file can end it."""

import os
import resource
import subprocess
import sys
from io import BytesIO
from typing import Any, BinaryIO

import numpy as np

from stickslip_ros.arrays import FloatArray

_MEMORY, _TIME = 1 << 30, 60
"""Bytes and seconds that reading a file may take."""


def vectors_of(stream: BinaryIO, most: int) -> dict[str, FloatArray]:
    """Return the variables of a MAT file that are one number or a row or column of them, by name.

    Raises ValueError if it cannot be read, or if these are more than `most` numbers.
    """
    paths = os.pathsep.join(filter(None, sys.path))
    settings = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-P", "-m", __name__, str(most)]
    try:
        child = subprocess.run(
            command, stdin=stream, capture_output=True, env=settings, timeout=_TIME, check=False
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"it takes more than {_TIME} s") from None
    if child.returncode != 0:
        reason = child.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        raise ValueError(reason or "it is damaged")
    with np.load(BytesIO(child.stdout), allow_pickle=False) as found:
        return {name[1:]: found[name] for name in found}


def _main() -> None:
    """Write the variables of the file at standard input to standard output, as numpy does."""
    from scipy.io import loadmat

    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    try:
        found: Any = loadmat(sys.stdin.buffer, squeeze_me=True)
    except NotImplementedError:
        sys.exit("a MAT file of version 7.3 is refused: save it with the option -v7")
    except MemoryError:
        sys.exit(f"it takes more than {_MEMORY} bytes of memory")
    except Exception as error:
        sys.exit(f"it is damaged: {type(error).__name__}")
    variables = {name: np.atleast_1d(values) for name, values in found.items() if name[:2] != "__"}
    vectors: dict[str, Any] = {
        f"={name}": values  # numpy has meanings of its own for some names
        for name, values in variables.items()
        if values.ndim == 1 and values.dtype.kind in "biuf"
    }
    if sum(map(len, vectors.values())) > (most := int(sys.argv[1])):
        sys.exit(f"it has more than {most} numbers")
    target = BytesIO()
    np.savez(target, **{name: values.astype(float) for name, values in vectors.items()})
    sys.stdout.buffer.write(target.getbuffer())


if __name__ == "__main__":
    _main()
