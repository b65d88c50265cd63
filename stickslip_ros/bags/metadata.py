"""The `metadata.yaml` of a bag, version 9, by which rosbag2 knows it."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from stickslip_ros.bags.mcap_file import McapFile

METADATA_FILE = "metadata.yaml"

# What rosbag2 writes where there is no message yet.
_NO_STARTING_TIME = 2**63 - 1


def opening_information(file_name: str, custom_data: Mapping[str, str]) -> dict[str, Any]:
    """Return what there is to say of a bag when its only file is opened for writing."""
    return _information(file_name, custom_data, [], 0, _NO_STARTING_TIME, 0)


def closing_information(file: McapFile, custom_data: Mapping[str, str]) -> dict[str, Any]:
    """Return what there is to say of a bag of one complete file."""
    statistics = file.statistics
    assert statistics is not None
    topics = [
        {
            "topic_metadata": {
                "name": channel.topic,
                "type": file.schemas[channel.schema_id].name,
                "serialization_format": channel.message_encoding,
                "offered_qos_profiles": yaml.safe_load(channel.metadata["offered_qos_profiles"]),
                "type_description_hash": channel.metadata["topic_type_hash"],
            },
            "message_count": statistics.channel_message_counts.get(channel_id, 0),
        }
        for channel_id, channel in file.channels.items()
    ]
    start = statistics.message_start_time if statistics.message_count else _NO_STARTING_TIME
    duration = statistics.message_end_time - statistics.message_start_time
    return _information(
        file.path.name, custom_data, topics, statistics.message_count, start, duration
    )


def write_metadata(directory: Path, information: Mapping[str, Any]) -> None:
    """Write `metadata.yaml` into a bag directory: all of it, or OSError is raised."""
    temporary = directory / f".{METADATA_FILE}.part"
    temporary.write_text(
        yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False),
        encoding="utf-8",
    )
    os.replace(temporary, directory / METADATA_FILE)


def _information(
    file_name: str,
    custom_data: Mapping[str, str],
    topics: list[dict[str, Any]],
    message_count: int,
    start: int,
    duration: int,
) -> dict[str, Any]:
    return {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": duration},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": message_count,
        "topics_with_message_count": topics,
        # Of whole messages or files; compressed chunks are MCAP's own affair.
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file_name],
        "files": [
            {
                "path": file_name,
                "starting_time": {"nanoseconds_since_epoch": start},
                "duration": {"nanoseconds": duration},
                "message_count": message_count,
            }
        ],
        "custom_data": dict(custom_data),
        "ros_distro": "jazzy",
    }
