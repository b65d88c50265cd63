"""A loopback-only run is invisible on the network.

The run is in a network namespace of its own. A stranger is in another, at the other end of a cable,
and knows the host of the run as its peer. Beside the run there are ordinary tools, and a witness
that is open to the network: it tells the stranger that the cable works, and makes the host listen
to the group by which ROS nodes find each other.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from stickslip_ros.nodes.base.network import this_machine_only
from tests.nodes.graph import PATIENCE
from tests.nodes.processes import wait_for_samples

HOST, STRANGER = "192.0.2.1", "192.0.2.2"
LOOPBACK, GROUP = "127.0.0.1", "239.255.0.1"
RUN = ["-m", "stickslip_ros.app.main", "run", "paper", "--pace", "realtime", "--bag", "bag"]
OURS = {f"/feed_drive/{node}" for node in ("analyzer", "bringup", "plant", "washout_controller")}

WITNESS = """
import rclpy
rclpy.init()
rclpy.spin(rclpy.create_node("witness"))
"""

LOOKER = """
import json, sys, time
import rclpy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

expected, patience = set(sys.argv[2:]), float(sys.argv[1])
rclpy.init()
node = rclpy.create_node("looker")
states = []
node.create_subscription(JointState, "/feed_drive/joint_states", states.append, 10)
force = node.create_publisher(WrenchStamped, "/feed_drive/control_force", 10)
deadline = time.monotonic() + patience
seen, enough = set(), None

def is_connected():
    return len(states) > 0 and force.get_subscription_count() > 0

while time.monotonic() < (enough or deadline):
    rclpy.spin_once(node, timeout_sec=0.1)
    seen |= {ns.rstrip("/") + "/" + name for name, ns in node.get_node_names_and_namespaces()}
    if enough is None and seen >= expected:
        if "/feed_drive/plant" not in expected or is_connected():
            enough = time.monotonic() + 3.0
print(json.dumps([sorted(seen), len(states) > 0, force.get_subscription_count()]))
"""

SNIFFER = """
import socket
link = socket.socket(socket.AF_PACKET, socket.SOCK_RAW)  # until it is bound, it hears nothing
link.bind(("cable", 0x0003))
print("ready", flush=True)
came, left = 0, []
while came < 100:
    frame, (_, protocol, direction, _, _) = link.recvfrom(65535)
    if protocol == 0x0800 and frame[23] == socket.IPPROTO_UDP:
        came += direction == socket.PACKET_HOST
        if direction == socket.PACKET_OUTGOING:
            left.append(socket.inet_ntoa(frame[30:34]))
print(left)
"""

LOOP = """
import sys
from threading import Event, Thread
from stickslip_ros.testing import ClosedLoop

with ClosedLoop("paper", "plant.pace=realtime") as loop:
    print(loop.environment["ROS_DOMAIN_ID"], flush=True)
    over = Event()
    Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
    while not over.is_set():
        loop.run(1.0)
"""

ADDRESSES = """
import os, rclpy
from stickslip_ros.nodes.base import network

print({call})
rclpy.init()
node = rclpy.create_node("addresses")
files = "/proc/self/fd/"
links = {{os.readlink(files + f) for f in os.listdir(files) if os.path.islink(files + f)}}
for line in open("/proc/self/net/udp").readlines()[1:]:
    if f"socket:[{{line.split()[9]}}]" in links:
        print(line.split()[1])
"""


def addresses_in(table: str) -> set[str]:
    """Return the local addresses of a table of sockets as the kernel gives it."""
    packed = [bytes.fromhex(line.split(":")[0])[::-1] for line in table.split()]
    return {".".join(map(str, address)) for address in packed}


class Namespaces:
    """Two network namespaces, joined by a cable."""

    def __init__(self) -> None:
        self.host, self.elsewhere = (f"stickslip-{os.getpid()}-{end}" for end in "ab")

    def make(self) -> None:
        for name in (self.host, self.elsewhere):
            self._ip("netns", "add", name)
        peer = ["peer", "name", "cable", "netns", self.elsewhere]
        self._ip("link", "add", "cable", "netns", self.host, "type", "veth", *peer)
        for name, address in ((self.host, HOST), (self.elsewhere, STRANGER)):
            self._ip("-n", name, "addr", "add", f"{address}/24", "dev", "cable")
            for link in ("lo", "cable"):
                self._ip("-n", name, "link", "set", link, "up")

    def remove(self) -> None:
        for name in (self.host, self.elsewhere):
            subprocess.run(["ip", "netns", "del", name], capture_output=True)

    def _ip(self, *arguments: str) -> None:
        subprocess.run(["ip", *arguments], check=True, capture_output=True, text=True)


@pytest.fixture(scope="module")
def namespaces() -> Iterator[Namespaces]:
    namespaces = Namespaces()
    try:
        namespaces.make()
        yield namespaces
    except (OSError, subprocess.CalledProcessError) as error:
        why = getattr(error, "stderr", None) or error
        if os.environ.get("CI"):
            raise
        pytest.skip(f"network namespaces need root and iproute2: {why}")
    finally:
        if shutil.which("ip"):
            namespaces.remove()


Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def start(namespaces: Namespaces, domain: int, tmp_path: Path) -> Iterator[Start]:
    """Start Python in a namespace, in an environment that says nothing of the network."""
    started: list[subprocess.Popen[str]] = []
    clean = {name: v for name, v in os.environ.items() if name not in this_machine_only()}

    def start(
        namespace: str, *arguments: str, stderr: int | None = None, **variables: str
    ) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            ["ip", "netns", "exec", namespace, sys.executable, *arguments],
            cwd=tmp_path,
            env={**clean, "ROS_DOMAIN_ID": str(domain), **variables},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=stderr,
            text=True,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    for process in started:
        try:
            process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def profile_with_every_port(path: Path, domain: int) -> str:
    """Write a profile that names every port of a domain on the host of the run as a peer."""
    first = 7400 + 250 * domain
    peers = "".join(
        f"<locator><udpv4><address>{HOST}</address><port>{port}</port></udpv4></locator>"
        for port in [first, first + 1, *range(first + 10, first + 60)]
    )
    path.write_text(
        '<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>'
        '<participant profile_name="stranger" is_default_profile="true"><rtps>'
        "<builtinTransports>UDPv4</builtinTransports>"
        f"<builtin><initialPeersList>{peers}</initialPeersList></builtin>"
        "</rtps></participant></profiles></dds>",
        encoding="utf-8",
    )
    return str(path)


def result(process: subprocess.Popen[str]) -> Any:
    """Wait for what a process prints, a line of JSON."""
    return json.loads(process.communicate(timeout=2.0 * PATIENCE)[0])


class Strangers:
    """Two strangers who know the host of a run as their peer, and look for nodes."""

    def __init__(
        self, start: Start, namespaces: Namespaces, directory: Path, domain: str, expected: set[str]
    ) -> None:
        profile = profile_with_every_port(directory / "stranger.xml", int(domain))
        self._sniffer = start(namespaces.host, "-c", SNIFFER)
        assert self._sniffer.stdout.readline() == "ready\n"
        self._strangers = look(
            partial(start, namespaces.elsewhere, ROS_DOMAIN_ID=domain),
            expected,
            {"ROS_STATIC_PEERS": HOST},
            {"FASTRTPS_DEFAULT_PROFILES_FILE": profile},
        )

    def answers(self) -> str:
        """Return where their host's nodes have sent packets while they sent it a hundred."""
        return self._sniffer.communicate(timeout=2.0 * PATIENCE)[0].strip()

    def results(self) -> list[Any]:
        """Return what each has seen: nodes, whether states, how many take its forces."""
        return [result(stranger) for stranger in self._strangers]


def look(
    start: Start, expected: set[str], *environments: dict[str, str]
) -> list[subprocess.Popen[str]]:
    """Start processes that look until they have seen what is expected, and a little longer."""
    return [start("-c", LOOKER, str(2.0 * PATIENCE), *expected, **e) for e in environments]


@pytest.mark.long
@pytest.mark.parametrize("command", [RUN, ["-c", LOOP]])
def test_a_run_is_seen_by_local_tools_and_by_no_stranger(
    start: Start, namespaces: Namespaces, tmp_path: Path, domain: int, command: list[str]
) -> None:
    run = start(namespaces.host, *command)
    if command[0] == "-c":
        its_domain, ours = run.stdout.readline().strip(), OURS - {"/feed_drive/bringup"}
    else:
        wait_for_samples(run, tmp_path / "bag")
        its_domain, ours = str(domain), OURS
    table = Path(f"/proc/{run.pid}/net/udp").read_text(encoding="utf-8").splitlines()[1:]
    assert addresses_in("\n".join(line.split()[1] for line in table)) == {LOOPBACK, GROUP}
    strangers = Strangers(start, namespaces, tmp_path, its_domain, {"/witness"})
    assert strangers.answers() == "[]"
    local = partial(start, namespaces.host, ROS_DOMAIN_ID=its_domain)
    local("-c", WITNESS)
    tools = look(local, ours | {"/witness"}, {}, {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    for seen, states, readers in map(result, tools):
        assert set(seen) >= ours
        assert states
        assert readers > 0
    for seen, states, readers in strangers.results():
        assert "/witness" in seen
        assert not [node for node in seen if node.startswith("/feed_drive")]
        assert not states
        assert readers == 0


@pytest.mark.long
def test_a_run_that_is_open_to_the_network_is_seen_by_strangers(
    start: Start, namespaces: Namespaces, tmp_path: Path, domain: int
) -> None:
    run = start(namespaces.host, *RUN, "--network", "--composed")
    wait_for_samples(run, tmp_path / "bag")
    strangers = Strangers(start, namespaces, tmp_path, str(domain), OURS)
    assert STRANGER in strangers.answers()
    for seen, states, readers in strangers.results():
        assert set(seen) >= OURS
        assert states
        assert readers > 0


@pytest.mark.process
@pytest.mark.parametrize(
    ("call", "environment"),
    [
        (
            "network.keep_on_this_machine(network=False)",
            {"FASTRTPS_DEFAULT_PROFILES_FILE": "", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"},
        ),
        ("network.keep_on_this_machine(network=False)", {"ROS_LOCALHOST_ONLY": "1"}),
        (
            "network.prefer_prompt_middleware() or 'loopback only'",
            {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
        ),
    ],
)
def test_loopback_only_nodes_listen_on_the_loopback_only(
    process_environment: dict[str, str], tmp_path: Path, call: str, environment: dict[str, str]
) -> None:
    directory = tmp_path / "of_a_stranger"
    directory.mkdir()
    profile_with_every_port(directory / "DEFAULT_FASTRTPS_PROFILES.xml", 0)
    clean = {n: v for n, v in process_environment.items() if n not in this_machine_only()}
    output = subprocess.run(
        [sys.executable, "-c", ADDRESSES.format(call=call)],
        cwd=directory,
        env={**clean, **environment},
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    said, _, table = output.partition("\n")
    assert said == "loopback only"
    assert addresses_in(table) == {LOOPBACK, GROUP}
