"""MAT files of MATLAB, read by scipy in a process of its own: false sizes in a file can end it."""

import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from stickslip_ros.arrays import FloatArray

_MATLAB, _HDF5 = b"MATLAB", b"\x89HDF\r\n\x1a\n"
"""First bytes of a MAT file, and of what a file of version 7.3 has in it."""
_MOST_LEVELS, _MOST_COLUMNS = 10, 1000
"""Structures in structures, and columns of a matrix, that are read."""
_MEMORY, _TIME = 1 << 30, 60
"""Bytes and seconds that reading a file may take."""


def is_mat(path: Path, stream: BinaryIO) -> bool:
    """Return whether an open file is a MAT file, by its end or its first bytes."""
    start = os.pread(stream.fileno(), len(_MATLAB), 0)
    return path.suffix.lower() == ".mat" or start == _MATLAB


def vectors_of(stream: BinaryIO, most: int) -> dict[str, FloatArray]:
    """Return the vectors and single numbers in a MAT file, by name.

    `log.t` is a field of a structure, and `data[2]` the second column of a matrix. Raises
    ValueError if the file cannot be read, or if these are more than `most` numbers.
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
    """Write the vectors in the file at standard input to standard output, as numpy does."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    try:
        content = sys.stdin.buffer.read()
        found = _of_hdf5(content) if _HDF5 in content[:1024] else _of_scipy(content)
        vectors = {f"={name}": values for name, values in found}  # numpy takes some names itself
    except ImportError:
        sys.exit("a MAT file of version 7.3 is read by h5py: install it, or save the file with -v7")
    except MemoryError:
        sys.exit(f"it takes more than {_MEMORY} bytes of memory")
    except Exception as error:
        sys.exit(f"it is damaged: {type(error).__name__}")
    if sum(map(len, vectors.values())) > (most := int(sys.argv[1])):
        sys.exit(f"it has more than {most} numbers")
    target = BytesIO()
    np.savez(target, **{name: values.astype(float) for name, values in vectors.items()})
    sys.stdout.buffer.write(target.getbuffer())


def _of_scipy(content: bytes) -> Iterator[tuple[str, Any]]:
    from scipy.io import loadmat

    variables: Any = loadmat(BytesIO(content), squeeze_me=True)
    for name, values in variables.items():
        if name[:2] != "__":
            yield from _vectors(name, values)


def _of_hdf5(content: bytes) -> Iterator[tuple[str, Any]]:
    import h5py

    def of_group(prefix: str, group: Any) -> Iterator[tuple[str, Any]]:
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                sys.exit(f"{prefix}{name} is a link: it may point to another file")
            each = group[name]
            if isinstance(each, h5py.Dataset) and (each.external or each.is_virtual):
                sys.exit(f"{prefix}{name} is stored in another file")
            if isinstance(each, h5py.Group):
                yield from of_group(f"{prefix}{name}.", each)
            elif each.dtype.kind in "biuf":
                yield from _vectors(prefix + name, np.squeeze(each[()].T))

    with h5py.File(BytesIO(content)) as file:
        yield from of_group("", file)


def _vectors(name: str, values: Any, depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield the vectors of a variable: itself, columns of a matrix, fields of a structure."""
    values = np.atleast_1d(values)
    if values.dtype.names and values.size == 1 and depth < _MOST_LEVELS:
        for field in values.dtype.names:
            yield from _vectors(f"{name}.{field}", values[field].item(), depth + 1)
    elif values.dtype.kind in "biuf" and values.ndim == 1:
        yield name, values
    elif values.dtype.kind in "biuf" and values.ndim == 2 and values.shape[1] <= _MOST_COLUMNS:
        for number, column in enumerate(values.T, start=1):
            yield f"{name}[{number}]", column


if __name__ == "__main__":
    _main()
