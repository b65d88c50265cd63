"""The network that ROS uses: the environment of nodes after its preparation."""

import os
from pathlib import Path
from unittest import mock
from xml.etree import ElementTree

import pytest

from stickslip_ros.nodes.base.network import prefer_prompt_middleware

PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"


@pytest.mark.parametrize("discovery_range", ["SUBNET", "LOCALHOST"])
def test_the_profile_that_is_named_is_there(discovery_range: str) -> None:
    before = dict(os.environ) | {"ROS_AUTOMATIC_DISCOVERY_RANGE": discovery_range}
    for name in (PROFILES, "FASTDDS_BUILTIN_TRANSPORTS", "ROS_LOCALHOST_ONLY"):
        before.pop(name, None)
    with mock.patch.dict(os.environ, before, clear=True):
        prefer_prompt_middleware()
        profile = Path(os.environ[PROFILES])
    assert profile.stem == ("loopback" if discovery_range == "LOCALHOST" else "network")
    assert ElementTree.parse(profile).getroot().tag.endswith("dds")
