"""Saving what is left of a damaged bag into a sound one."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from stickslip_ros.bags.mcap_file import McapFile
from stickslip_ros.bags.reader import Recording
from stickslip_ros.bags.recorder import Recorder, check_new_bag
from stickslip_ros.errors import BagError

_ROSBAG2 = "rosbag2"
"""Name of rosbag2's own table in every file, of which the new bag has one of its own."""


@dataclass
class Repaired:
    """What was saved."""

    messages: Counter[str] = field(default_factory=Counter[str])
    """How many, by topic."""
    missing: list[str] = field(default_factory=list[str])
    """What the original lacks, in sentences; empty if it was sound."""


def repair(path: Path, out: Path, progress: Callable[[int], None] = lambda _: None) -> Repaired:
    """Write all that can be read of the bag at `path` into a new bag directory `out`.

    Messages of every topic come over with their times, as do tables and attached files. `progress`
    is told now and then how many messages are done. The original is only read. Raises BagError for
    what is no bag or has nothing to be saved, and if `out` exists, lies within the original or
    cannot be written.
    """
    check_new_bag(out)
    if out.resolve().is_relative_to(path.resolve()):
        raise BagError(f"the bag {out} would lie within {path}, which is only to be read")
    repaired = Repaired()
    with Recording(path) as recording:
        if not recording.topics:
            why = "; ".join(recording.missing) or "it holds no topics"
            raise BagError(f"nothing of the bag {path} can be saved: {why}")
        with Recorder(out) as recorder:
            channels: dict[tuple[str, str], int] = {}
            for file in recording.files:
                _copy_tables(file, recorder)
                _copy_messages(file, recorder, channels, repaired, progress)
        repaired.missing = recording.missing
    return repaired


def _copy_tables(file: McapFile, recorder: Recorder) -> None:
    for name in file.metadata_names:
        table = file.metadata(name)
        if table is not None and name != _ROSBAG2:
            recorder.add_metadata(name, table)
    for name in file.attachment_names:
        attachment = file.attachment(name)
        if attachment is not None:
            recorder.attach(name, attachment.data, attachment.media_type)


def _copy_messages(
    file: McapFile,
    recorder: Recorder,
    channels: dict[tuple[str, str], int],
    repaired: Repaired,
    progress: Callable[[int], None],
) -> None:
    """Copy the messages of a file; `channels` are those of the new bag by topic and type."""
    topics: dict[int, str] = {}
    targets: dict[int, int] = {}
    for number, channel in file.channels.items():
        schema = file.schemas.get(channel.schema_id)
        if schema is None:
            continue
        key = channel.topic, schema.name
        if key not in channels:
            channels[key] = recorder.add_channel(channel, schema)
        topics[number], targets[number] = channel.topic, channels[key]
    for block in file.blocks(targets):
        columns = (
            block.channel,
            block.begin,
            block.end,
            block.log_time,
            block.publish_time,
            block.sequence,
        )
        for channel, begin, end, *times in zip(*(c.tolist() for c in columns), strict=True):
            recorder.write(targets[channel], block.data[begin:end], *times)
            repaired.messages[topics[channel]] += 1
        progress(repaired.messages.total())
