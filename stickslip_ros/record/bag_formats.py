"""Bags of sqlite3 and of ROS 1 as MCAP, by rosbags in a limited process."""

import os
import sys
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from stickslip_ros.errors import BagError
from stickslip_ros.record.limited_process import limited, result_of

OTHER_BAGS = (b"#ROSBAG", b"SQLite")
"""First bytes of the files of bags that are no MCAP."""
_TIME = 600
"""Seconds that converting a bag may take."""


def mcap_of(path: Path, opened: ExitStack) -> Path:
    """Return a bag as MCAP, converted until `opened` closes if it is of sqlite3 or ROS 1.

    Raises BagError if it cannot be converted.
    """
    is_other = False
    if os.path.isdir(path):
        is_other = any(path.glob("*.db3")) and not any(path.glob("*.mcap*"))
    elif os.path.isfile(path):
        with suppress(OSError), path.open("rb") as stream:
            is_other = stream.read(max(map(len, OTHER_BAGS))).startswith(OTHER_BAGS)
    if not is_other:
        return path
    directory = opened.enter_context(TemporaryDirectory(prefix="stickslip_ros_"))
    target = Path(directory, path.stem)
    source = path.parent if path.suffix == ".db3" else path
    try:
        result_of(__name__, str(source), str(target), seconds=_TIME)
    except ValueError as error:
        raise BagError(f"the bag {path} cannot be converted: {error}") from None
    return target


def _main(source: Path, target: Path) -> None:
    with limited("it is not MCAP; rosbags reads it: install rosbags, or use `ros2 bag convert`"):
        from rosbags.convert.cli import main

        sys.argv[1:] = ["--src", str(source), "--dst", str(target), "--dst-storage", "mcap"]
        main()


if __name__ == "__main__":
    _main(Path(sys.argv[1]), Path(sys.argv[2]))
