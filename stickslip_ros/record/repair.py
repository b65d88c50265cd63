"""Copy the readable part of a damaged bag into a new, sound one."""

import shutil
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from stickslip_ros.errors import BagError
from stickslip_ros.record.bag_files import BagFiles
from stickslip_ros.record.mcap_file import McapFile
from stickslip_ros.record.metadata import METADATA_FILE
from stickslip_ros.record.recorder import Recorder, check_new_bag
from stickslip_ros.text import printable

_Definition = tuple[object, ...]


@dataclass
class Repaired:
    """The result of a repair."""

    messages: Counter[str] = field(default_factory=Counter[str])
    """Number of copied messages by topic."""
    missing: list[str] = field(default_factory=list[str])
    """Sentences on what the original lacks; empty if it was sound."""


def repair(path: Path, out: Path, progress: Callable[[int], None] = lambda _: None) -> Repaired:
    """Write all readable data of the bag at `path` into a new bag directory `out`.

    The messages of every topic are copied with their times, as are metadata tables and attached
    files. `progress` is called from time to time with the number of copied messages. The original
    is not changed. Raises BagError if `path` is not a bag or holds nothing readable, and if `out`
    exists, lies within the original or cannot be written; `out` is then not left behind.
    """
    check_new_bag(out)
    original = path.parent if (path.parent / METADATA_FILE).exists() else path
    if out.resolve().is_relative_to(original.resolve()):
        raise BagError(f"the bag {out} would lie within {original}, which must not be changed")
    repaired = Repaired()
    with BagFiles(path) as bag:
        if not bag.topics:
            why = "; ".join(bag.damage) or "it holds no topics"
            raise BagError(f"nothing in the bag {path} can be repaired: {why}")
        try:
            with Recorder(out) as recorder:
                channels: dict[_Definition, int] = {}
                for file in bag.files:
                    for table in file.tables():
                        if table.name != "rosbag2":  # the new bag has its own
                            recorder.add_metadata(table.name, table.metadata)
                    for attached in file.attachments():
                        times = attached.log_time, attached.create_time
                        recorder.attach(attached.name, attached.data, attached.media_type, *times)
                    _copy_messages(file, recorder, channels, repaired, progress)
        except BaseException:
            shutil.rmtree(out, ignore_errors=True)  # it would look like a complete bag
            raise
        repaired.missing[:0] = bag.damage
    return repaired


def _copy_messages(
    file: McapFile,
    recorder: Recorder,
    channels: dict[_Definition, int],
    repaired: Repaired,
    progress: Callable[[int], None],
) -> None:
    """Copy the messages of a file; `channels` maps definitions to channels of the new bag."""
    topics: dict[int, str] = {}
    targets: dict[int, int] = {}
    for number, channel in file.channels.items():
        schema = file.schemas.get(channel.schema_id)
        if schema is None:
            name = file.path.name
            topic = printable(channel.topic)
            repaired.missing.append(f"{name}: {topic} is omitted: its type is unknown")
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
            if log_time < 0 or publish_time < 0:  # more than 63 bits, which rosbag2 cannot read
                untimely += 1
                continue
            message = block.data[begin:end]
            recorder.write(targets[channel], message, log_time, publish_time, sequence)
            repaired.messages[topics[channel]] += 1
        progress(repaired.messages.total())
    if untimely:
        repaired.missing.append(
            f"{file.path.name}: {untimely} messages are omitted: their times exceed 2^63 - 1 ns"
        )
