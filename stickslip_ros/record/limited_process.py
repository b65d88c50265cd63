"""Files of other tools are read in a process of its own: false sizes in a file can end it."""

import os
import resource
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from typing import BinaryIO

_MEMORY = 1 << 30
"""Bytes that reading a file may take."""


def result_of(
    module: str, *arguments: str, seconds: float, stream: BinaryIO | None = None
) -> tuple[bytes, list[str]]:
    """Return what a module of the package writes as a process, with a stream as standard input.

    That is standard output, and the lines of standard error. Raises ValueError, with the last of
    these lines, if it fails.
    """
    paths = os.pathsep.join(filter(None, sys.path))
    settings = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-P", "-m", module, *arguments]
    try:
        child = subprocess.run(
            command, stdin=stream, capture_output=True, env=settings, timeout=seconds, check=False
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"it takes more than {seconds} s") from None
    lines = child.stderr.decode(errors="replace").strip().splitlines()
    if child.returncode != 0:
        raise ValueError(lines[-1] if lines else "it is damaged")
    return child.stdout, lines


@contextmanager
def limited(libraries: str) -> Generator[None]:
    """Limit the memory of this process, and end it after the block.

    It ends with a sentence where reading a file fails; `libraries` is that for missing ones.
    """
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    failure: object = None
    try:
        yield
    except SystemExit as error:
        failure = error.code
    except ImportError:
        failure = libraries
    except MemoryError:
        failure = f"it takes more than {_MEMORY} bytes of memory"
    except Exception as error:
        failure = f"it is damaged: {type(error).__name__}"
    if failure:
        print(failure, file=sys.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    # At a normal exit threads of pyarrow abort a few of a hundred processes.
    os._exit(bool(failure))
