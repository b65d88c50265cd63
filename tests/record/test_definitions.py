import re
import sys
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from stickslip_ros.errors import BagError
from stickslip_ros.record.definitions import message_definition, type_hash

SEPARATOR = "=" * 80


def installed_types():
    for file in sorted(Path(sys.prefix, "share").glob("*/msg/*.msg")):
        yield f"{file.parts[-3]}/msg/{file.stem}"


def heads(definition):
    return [line.removeprefix("MSG: ") for line in definition.splitlines() if line[:4] == "MSG:"]


def test_every_installed_type_is_defined_and_hashed():
    typestore = get_typestore(Stores.EMPTY)
    definitions = {name: message_definition(name) for name in installed_types()}
    assert len(definitions) > 100
    for name, text in definitions.items():
        typestore.register(get_types_from_msg(text, name))
    # rosbags takes `char` for another type than ROS 2 does when it computes a hash.
    hashed = [name for name, text in definitions.items() if not re.search(r"^char\b", text, re.M)]
    assert len(hashed) > 100
    for name in hashed:
        assert type_hash(name) == typestore.hash_rihs01(name)


def test_the_text_is_laid_out_as_rosbag2_does():
    share = Path(sys.prefix, "share")
    assert message_definition("std_msgs/msg/Header") == (
        (share / "std_msgs/msg/Header.msg").read_text()
        + f"\n{SEPARATOR}\nMSG: builtin_interfaces/Time\n"
        + (share / "builtin_interfaces/msg/Time.msg").read_text()
    )


@pytest.fixture
def overlay(tmp_path, monkeypatch):
    """Put a package of its own into an ament prefix, as a sourced workspace does."""
    messages = tmp_path / "share" / "my_msgs" / "msg"
    messages.mkdir(parents=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    return messages


def test_a_package_of_an_overlay_is_found(overlay):
    (overlay / "Outer.msg").write_text(
        "# a comment with a Word\n"
        "uint8 KIND=1\n"
        "wstring<=9 wide\n"
        "string[<=3] names\n"
        "Inner[4] inner  # of this package\n"
        "my_msgs/Inner again\n"
        "std_msgs/msg/Empty empty\n"
    )
    (overlay / "Inner.msg").write_text("float64 value\n")
    assert heads(message_definition("my_msgs/msg/Outer")) == ["my_msgs/Inner", "std_msgs/Empty"]


def test_an_overlay_comes_before_the_environment(overlay):
    messages = overlay.parent.parent / "std_msgs" / "msg"
    messages.mkdir(parents=True)
    (messages / "Empty.msg").write_text("# changed\n")
    assert message_definition("std_msgs/msg/Empty") == "# changed\n"


def test_what_is_not_installed_or_names_no_message_type_is_refused(overlay):
    for look_up in (message_definition, type_hash):
        for name in ("std_msgs/msg/Nothing", "no_such_package/msg/Empty"):
            with pytest.raises(BagError, match=f"'{name}' is not installed"):
                look_up(name)
        for name in ("", "Empty", "std_msgs/Empty", "../../etc/msg/passwd", "a/srv/B"):
            with pytest.raises(BagError, match="is not the name of a message type"):
                look_up(name)
    (overlay / "Outer.msg").write_text("Missing missing\n")
    with pytest.raises(BagError, match="'my_msgs/msg/Missing' is not installed"):
        message_definition("my_msgs/msg/Outer")
