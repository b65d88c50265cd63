"""The `metadata.yaml` of a bag (version 9), which rosbag2 needs to open it.

It describes the finished files. While a bag is recorded, and after a recorder was killed, there is
one file more. This distinguishes a bag that was closed properly from others.
"""

from collections.abc import Iterator, Sequence
from io import TextIOWrapper
from itertools import pairwise, takewhile
from pathlib import Path
from typing import Any

import yaml

from stickslip_ros.files import open_regular, written
from stickslip_ros.record.mcap_file import McapFile

METADATA_FILE = "metadata.yaml"

_LARGEST_METADATA = 4_000_000
"""Characters of the largest `metadata.yaml` that is read: a bag of about ten thousand files."""
_LARGEST_QOS = 100_000
"""Characters of the longest YAML of QoS profiles that is read: about a hundred publishers."""

# libyaml's are five and ten times as fast, which matters with thousands of files.
_LOADER: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
_DUMPER: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)

# rosbag2 writes this if there is no message yet.
_NO_STARTING_TIME = 2**63 - 1


def opening_information(file_name: str) -> str:
    """Return the metadata, as YAML, of a bag's file that is opened for writing."""
    file = _file_entry(file_name, 0, _NO_STARTING_TIME, 0)
    return _as_yaml(_information([], _NO_STARTING_TIME, 0, [file]))


class BagDescription:
    """The metadata of the finished files of a bag."""

    def __init__(self) -> None:
        self._topics: dict[str, dict[str, Any]] = {}
        self._start = _NO_STARTING_TIME
        self._end = 0
        self._files: list[dict[str, Any]] = []

    def add(self, file: McapFile) -> None:
        """Add the next file of the bag, which is complete."""
        statistics = file.statistics
        assert statistics is not None
        for channel_id, channel in sorted(file.channels.items()):
            if channel.topic not in self._topics:
                profiles = channel.metadata.get("offered_qos_profiles", "")
                about = {
                    "name": channel.topic,
                    "type": file.schemas[channel.schema_id].name,
                    "serialization_format": channel.message_encoding,
                    "offered_qos_profiles": offered_profiles(profiles),
                    "type_description_hash": channel.metadata.get("topic_type_hash", ""),
                }
                self._topics[channel.topic] = {"topic_metadata": about, "message_count": 0}
            count = statistics.channel_message_counts.get(channel_id, 0)
            self._topics[channel.topic]["message_count"] += count
        start, end = statistics.message_start_time, statistics.message_end_time
        if statistics.message_count == 0:
            start = end = _NO_STARTING_TIME
        else:
            self._start, self._end = min(start, self._start), max(end, self._end)
        entry = _file_entry(file.path.name, statistics.message_count, start, end - start)
        self._files.append(entry)

    def write(self, directory: Path) -> None:
        """Write `metadata.yaml` into a bag directory and sync it to the disk.

        If this fails, OSError is raised and the previous file remains.
        """
        information = _information(
            list(self._topics.values()), self._start, max(0, self._end - self._start), self._files
        )
        with written(directory / METADATA_FILE, replace=True) as file:
            file.write(_as_yaml({"rosbag2_bagfile_information": information}))


def metadata_faults(directory: Path, files: Sequence[Path]) -> list[str]:
    """Return the differences, in sentences, between a bag's `metadata.yaml` and its files."""
    try:
        listed = _listed(directory / METADATA_FILE)
    except FileNotFoundError:
        return [f"{METADATA_FILE} is missing: the recorder is still running or was killed"]
    except (OSError, ValueError, yaml.YAMLError):
        return [f"{METADATA_FILE} cannot be read"]
    present = {file.name for file in files}
    if gone := sorted(listed - present):
        return [f"{', '.join(gone)} is listed in {METADATA_FILE} but does not exist"]
    if new := sorted(present - listed):
        return [f"{METADATA_FILE} does not list {', '.join(new)}: the recorder did not finish"]
    return []


def _as_yaml(information: dict[str, Any]) -> str:
    return yaml.dump(information, Dumper=_DUMPER, sort_keys=False)


def offered_profiles(qos: str) -> list[Any]:
    """Return the QoS profiles in rosbag2's YAML; empty if other recorders wrote something else.

    A text that is far too long, uses aliases or has values that YAML cannot write is not read.
    """
    if len(qos) > _LARGEST_QOS or "*" in qos:
        return []
    try:
        profiles = yaml.safe_load(qos)
        yaml.dump(profiles, Dumper=_DUMPER).encode()  # not a lone surrogate, nor a huge integer
    except Exception:  # a file of another recorder may hold anything
        return []
    return profiles if isinstance(profiles, list) else []


def _file_entry(name: str, message_count: int, start: int, duration: int) -> dict[str, Any]:
    return {
        "path": name,
        "starting_time": {"nanoseconds_since_epoch": start},
        "duration": {"nanoseconds": duration},
        "message_count": message_count,
    }


def _information(
    topics: list[dict[str, Any]], start: int, duration: int, files: list[dict[str, Any]]
) -> dict[str, Any]:
    return {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": duration},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(file["message_count"] for file in files),
        "topics_with_message_count": topics,
        # Of whole messages or files; the compression of chunks belongs to MCAP.
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file["path"] for file in files],
        "files": files,
        "custom_data": {},
        "ros_distro": "jazzy",
    }


def _listed(metadata: Path) -> set[str]:
    with TextIOWrapper(open_regular(metadata), encoding="utf-8") as file:
        text = file.read(_LARGEST_METADATA + 1)
    if len(text) > _LARGEST_METADATA:
        raise ValueError
    # Only this list of strings is built, whatever the file contains.
    events: Iterator[Any] = yaml.parse(text, _LOADER)
    for key, value in pairwise(events):
        named = isinstance(key, yaml.ScalarEvent) and key.value == "relative_file_paths"
        if named and isinstance(value, yaml.SequenceStartEvent):
            listed = takewhile(lambda event: isinstance(event, yaml.ScalarEvent), events)
            return {event.value for event in listed}
    raise ValueError
