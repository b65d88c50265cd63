"""Bags of sqlite3 and of ROS 1 as MCAP, by rosbags in a process of its own."""

import os
import resource
import subprocess
import sys
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from stickslip_ros.errors import BagError

_ROS_1, _SQLITE = b"#ROSBAG", b"SQLite"
OTHER_BAGS = (_ROS_1, _SQLITE)
"""First bytes of the files of bags that are no MCAP."""
_MEMORY, _TIME = 1 << 30, 600
"""Bytes and seconds that converting a bag may take."""


def mcap_of(path: Path, opened: ExitStack) -> Path:
    """Return a bag as MCAP, converted until `opened` closes if it is of sqlite3 or ROS 1.

    Raises BagError if it cannot be converted.
    """
    if os.path.isdir(path):
        is_other = any(path.glob("*.db3")) and not any(path.glob("*.mcap*"))
    else:
        is_other = os.path.isfile(path) and _start(path).startswith(OTHER_BAGS)
    if not is_other:
        return path
    directory = opened.enter_context(TemporaryDirectory(prefix="stickslip_ros_"))
    target = Path(directory, path.stem)
    source = path.parent if path.suffix == ".db3" else path
    command = [sys.executable, "-P", "-m", __name__, str(source), str(target)]
    try:
        child = subprocess.run(command, capture_output=True, timeout=_TIME, check=False)
    except subprocess.TimeoutExpired:
        raise BagError(f"the bag {path} takes more than {_TIME} s to convert") from None
    if child.returncode != 0:
        reason = child.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        raise BagError(f"the bag {path} cannot be converted: {reason or 'it is damaged'}")
    return target


def _start(path: Path) -> bytes:
    with suppress(OSError), path.open("rb") as stream:
        return stream.read(max(map(len, OTHER_BAGS)))
    return b""


def _main(source: Path, target: Path) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    try:
        from rosbags.convert.cli import main
    except ImportError:
        sys.exit("it is not MCAP; rosbags reads it: install rosbags, or use `ros2 bag convert`")
    sys.argv[1:] = ["--src", str(source), "--dst", str(target), "--dst-storage", "mcap"]
    try:
        main()
    except MemoryError:
        sys.exit(f"it takes more than {_MEMORY} bytes of memory")
    except Exception as error:
        sys.exit(f"it is damaged: {type(error).__name__}")


if __name__ == "__main__":
    _main(Path(sys.argv[1]), Path(sys.argv[2]))
