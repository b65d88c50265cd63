"""Definitions and type hashes of installed ROS message types, as rosbag2 stores them in a bag."""

import json
import re

from stickslip_ros.errors import BagError
from stickslip_ros.installed_packages import prefixes

_TYPE_NAME = re.compile(r"(\w+)/msg/(\w+)", re.ASCII)
_FIELD_TYPE = re.compile(r"\s*([A-Za-z][\w/]*)", re.ASCII)
_BUILT_IN_TYPES = re.compile(r"bool|byte|char|float(32|64)|u?int(8|16|32|64)|w?string")


def message_definition(type_name: str) -> str:
    """Return the definition of a message type such as `sensor_msgs/msg/JointState`.

    The encoding is `ros2msg`: the .msg file, followed by those of the types of its fields, depth
    first and sorted, each once under its name. Raises BagError for a type that is not installed.
    """
    included: set[str] = set()

    def expand(type_name: str) -> str:
        text = _read(type_name, ".msg")
        for nested in _nested_types(text, package=type_name.partition("/")[0]):
            if nested not in included:
                included.add(nested)
                text += f"\n{'=' * 80}\nMSG: {nested.replace('/msg/', '/')}\n{expand(nested)}"
        return text

    return expand(type_name)


def type_hash(type_name: str) -> str:
    """Return the hash (`RIHS01_…`) of a message type such as `sensor_msgs/msg/JointState`.

    Raises BagError for a type that is not installed.
    """
    description = json.loads(_read(type_name, ".json"))
    hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
    return hashes[type_name]


def _nested_types(definition: str, package: str) -> list[str]:
    """Return the sorted full names of the types of a definition's fields, without built-in ones."""
    nested: set[str] = set()
    for line in definition.splitlines():
        field = _FIELD_TYPE.match(line)
        if field and not _BUILT_IN_TYPES.fullmatch(field[1]):
            scope, _, name = field[1].rpartition("/")
            nested.add(f"{scope.removesuffix('/msg') or package}/msg/{name}")
    return sorted(nested)


def _read(type_name: str, suffix: str) -> str:
    """Read the file that describes a message type from the first prefix that has it."""
    parts = _TYPE_NAME.fullmatch(type_name)
    if parts is None:
        raise BagError(
            f"'{type_name}' is not the name of a message type; a valid name is "
            "sensor_msgs/msg/JointState"
        )
    package, name = parts.groups()
    for prefix in prefixes():
        path = prefix / "share" / package / "msg" / (name + suffix)
        if path.is_file():
            return path.read_text(encoding="utf-8")
    raise BagError(
        f"the message type '{type_name}' is not installed: no share/{package}/msg/{name}{suffix} "
        f"in {' or '.join(map(str, prefixes()))} (AMENT_PREFIX_PATH and the Python environment)"
    )
