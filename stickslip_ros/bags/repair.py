"""Saving what is left of a damaged bag into a sound one."""

import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from stickslip_ros.bags.mcap_file import McapFile
from stickslip_ros.bags.metadata import METADATA_FILE
from stickslip_ros.bags.reader import Recording
from stickslip_ros.bags.recorder import Recorder, check_new_bag
from stickslip_ros.errors import BagError
from stickslip_ros.text import printable

_Definition = tuple[object, ...]


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
    cannot be written; then there is no `out`.
    """
    check_new_bag(out)
    original = path.parent if (path.parent / METADATA_FILE).exists() else path
    if out.resolve().is_relative_to(original.resolve()):
        raise BagError(f"the bag {out} would lie within {original}, which is only to be read")
    repaired = Repaired()
    with Recording(path) as recording:
        if not recording.topics:
            why = "; ".join(recording.missing) or "it holds no topics"
            raise BagError(f"nothing of the bag {path} can be saved: {why}")
        try:
            with Recorder(out) as recorder:
                channels: dict[_Definition, int] = {}
                for file in recording.files:
                    _copy_tables(file, recorder)
                    _copy_messages(file, recorder, channels, repaired, progress)
        except BaseException:
            shutil.rmtree(out, ignore_errors=True)  # it would look like a sound bag of everything
            raise
        repaired.missing[:0] = recording.missing
    return repaired


def _copy_tables(file: McapFile, recorder: Recorder) -> None:
    for table in file.tables():
        if table.name != "rosbag2":  # of which the new bag has one of its own
            recorder.add_metadata(table.name, table.metadata)
    for attachment in file.attachments():
        times = attachment.log_time, attachment.create_time
        recorder.attach(attachment.name, attachment.data, attachment.media_type, *times)


def _copy_messages(
    file: McapFile,
    recorder: Recorder,
    channels: dict[_Definition, int],
    repaired: Repaired,
    progress: Callable[[int], None],
) -> None:
    """Copy the messages of a file; `channels` are those of the new bag by their definition."""
    topics: dict[int, str] = {}
    targets: dict[int, int] = {}
    for number, channel in file.channels.items():
        schema = file.schemas.get(channel.schema_id)
        if schema is None:
            name = file.path.name
            topic = printable(channel.topic)
            repaired.missing.append(f"{name}: {topic} is left out: it has no known type")
            continue
        details = (channel.message_encoding, *sorted(channel.metadata.items()))
        definition = (channel.topic, schema.name, schema.encoding, schema.data, details)
        if definition not in channels:
            channels[definition] = recorder.add_channel(channel, schema)
        topics[number], targets[number] = channel.topic, channels[definition]
    untimely = 0
    for block in file.blocks(targets):
        times = block.log_time, block.publish_time, block.sequence
        columns = block.channel, block.begin, block.end, *times
        for channel, begin, end, log_time, publish_time, sequence in zip(
            *(column.tolist() for column in columns), strict=True
        ):
            if log_time < 0 or publish_time < 0:  # beyond 63 bits, which rosbag2 cannot read
                untimely += 1
                continue
            message = block.data[begin:end]
            recorder.write(targets[channel], message, log_time, publish_time, sequence)
            repaired.messages[topics[channel]] += 1
        progress(repaired.messages.total())
    if untimely:
        repaired.missing.append(
            f"{file.path.name}: {untimely} messages are left out: their times exceed 2^63 - 1 ns"
        )
