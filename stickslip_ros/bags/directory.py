"""The files of a bag: a directory as rosbag2 lays it out, or one MCAP file."""

import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Any

import yaml

from stickslip_ros.bags.compression import unpack_file
from stickslip_ros.bags.metadata import METADATA_FILE
from stickslip_ros.errors import BagError

_PACKED = ".mcap.zstd"
"""Ending of the files that rosbag2 packs as a whole."""

_LARGEST_METADATA = 4_000_000
"""Characters of a `metadata.yaml` that is read: that of a bag of some ten thousand files."""

_LOADER: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
"""That of libyaml is ten times as fast."""


def mcap_files(path: Path) -> list[Path]:
    """Return the files of a bag in the order in which they were recorded."""
    if not os.path.exists(path):
        raise BagError(f"the bag {path} does not exist")
    if not path.is_dir():
        if path.suffix == ".db3":
            raise _not_mcap(path)
        return [path]
    files = sorted([*path.glob("*.mcap"), *path.glob(f"*{_PACKED}")], key=_place_in_bag)
    if not files:
        if next(path.glob("*.db3"), None):
            raise _not_mcap(path)
        raise BagError(f"the directory {path} is not a bag: it holds no .mcap file")
    return files


def unpacked(path: Path, opened: ExitStack) -> Path:
    """Return a file as MCAP: what rosbag2 packed as a whole is unpacked until the bag closes."""
    if not path.name.endswith(_PACKED):
        return path
    directory = opened.enter_context(tempfile.TemporaryDirectory(prefix="stickslip_ros_"))
    unpacked = Path(directory, path.name.removesuffix(".zstd"))
    try:
        unpack_file(path, unpacked)
    except OSError as error:
        raise BagError(f"the file {path} cannot be unpacked: {error.strerror}") from error
    return unpacked


def _place_in_bag(file: Path) -> tuple[int, str]:
    """Sort `bag_2.mcap` before `bag_10.mcap`, as rosbag2 numbers the files of a bag it splits."""
    number = re.search(r"_(\d+)\.mcap", file.name)
    return (int(number[1]) if number else 0), file.name


def _listed(metadata: Path) -> set[str]:
    """Return the files that a `metadata.yaml` lists."""
    if metadata.exists() and not metadata.is_file():
        raise ValueError
    with metadata.open(encoding="utf-8") as file:
        text = file.read(_LARGEST_METADATA + 1)
    if len(text) > _LARGEST_METADATA:
        raise ValueError
    # Only this list is made, and of texts only, whatever the file asks for.
    events: Iterator[Any] = yaml.parse(text, _LOADER)
    for key, value in pairwise(events):
        named = isinstance(key, yaml.ScalarEvent) and key.value == "relative_file_paths"
        if named and isinstance(value, yaml.SequenceStartEvent):
            listed = takewhile(lambda event: isinstance(event, yaml.ScalarEvent), events)
            return {event.value for event in listed}
    raise ValueError


def metadata_faults(directory: Path, files: Sequence[Path]) -> list[str]:
    """Return in what the `metadata.yaml` of a bag fails to list its files."""
    try:
        listed = _listed(directory / METADATA_FILE)
    except FileNotFoundError:
        return [f"{METADATA_FILE} is missing: the recorder is still at work or was killed"]
    except (OSError, ValueError, yaml.YAMLError):
        return [f"{METADATA_FILE} cannot be understood"]
    present = {file.name for file in files}
    if gone := sorted(listed - present):
        return [f"{', '.join(gone)} is listed in {METADATA_FILE} but not there"]
    if new := sorted(present - listed):
        return [f"{METADATA_FILE} does not list {', '.join(new)}: the recorder did not finish"]
    return []


def _not_mcap(path: Path) -> BagError:
    return BagError(
        f"the bag {path} is stored as sqlite3, and only MCAP can be read; "
        "`ros2 bag convert` makes one of the other"
    )
