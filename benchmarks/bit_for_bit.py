"""Do lockstep runs and commands still give the same bytes?

`python -m benchmarks.bit_for_bit` runs 26 loops in lockstep and 16 commands with `--json`, hashes
what they recorded and printed, and names each hash that differs from `bit_for_bit.json`. `--write`
replaces that file: run it before a change that should move no bit, and without it afterwards. The
hashes hold for one instruction set and one set of versions, which the file names; with others
nothing is compared (exit status 77).
"""

import argparse
import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.slices import LACKING
from stickslip_ros.installed_packages import versions
from stickslip_ros.record.reader import Recording
from stickslip_ros.testing import ClosedLoop, own_domain

FILE = Path(__file__).with_suffix(".json")
TOPICS = (
    "joint_states",
    "control_force",
    "applied_force",
    "applied_disturbance",
    "reference",
    "true_joint_states",
)

SOON = "-p washout_controller.start_after=1.0"
LUGRE = "-p plant.friction.law=lugre -p plant.friction.bristle_stiffness=5e4"
SIGNAL = (
    "-p plant.disturbance.kind={} -p plant.disturbance.amplitude=60 -p plant.disturbance.start=2.5"
)

RUNS = {
    **{
        f"{scenario}{control}{composed}": f"{scenario} --duration {duration}{control}{composed}"
        for scenario, duration in (("feed_drive", 7), ("paper", 60))
        for control in ("", " --no-control")
        for composed in ("", " --composed")
    },
    "late start": "paper --duration 60 -p washout_controller.start_after=30",
    "delay": f"feed_drive --duration 4 {SOON} -p plant.force_delay=0.0015",
    "delay, jitter, sine": f"feed_drive --duration 4 {SOON} -p plant.force_delay=0.0015 "
    "-p plant.force_jitter=0.002 -p plant.force_jitter_seed=7 "
    f"{SIGNAL.format('sine')} -p plant.disturbance.frequency=7",
    "step": f"feed_drive --duration 4 {SOON} {SIGNAL.format('step')}",
    "impulse": f"feed_drive --duration 4 {SOON} {SIGNAL.format('impulse')}",
    "impulse, composed": f"feed_drive --duration 4 {SOON} {SIGNAL.format('impulse')} --composed",
    "trapezoid": "feed_profile --duration 6",
    "load": "vibrating_load --duration 6",
    "reference": "axis --duration 4",
    "coulomb": f"feed_drive --duration 4 {SOON} -p plant.friction.law=coulomb",
    "exponential": f"feed_drive --duration 4 {SOON} -p plant.friction.law=exponential "
    "-p plant.friction.decay_speed=0.02",
    "lugre": f"feed_drive --duration 4 {SOON} {LUGRE}",
    "maxwell_slip, composed": f"feed_drive --duration 4 {SOON} --composed "
    "-p plant.friction.law=maxwell_slip -p plant.friction.bristle_stiffness=5e4",
    "velocity_feedback": "feed_drive --duration 4 --controller velocity_feedback "
    "-p velocity_feedback_controller.velocity_gain=-2000",
    "encoder": f"feed_drive --duration 4 {SOON} -p plant.sensor.position_resolution=1e-6 "
    "-p plant.sensor.velocity=difference -p plant.publish_truth=true",
    "actuator": f"feed_drive --duration 4 {SOON} -p plant.actuator.limit=50 "
    "-p plant.actuator.time_constant=0.002 -p plant.actuator.resolution=0.5",
    "directions": f"feed_drive --duration 4 {SOON} -p plant.friction.reverse.static=0.35",
}

COMMANDS = {
    "simulate": "simulate feed_drive --duration 8 --out feed_drive.csv",
    "simulate paper": "simulate paper --duration 200 --continuous-control",
    "simulate lugre": f"simulate feed_drive --no-control --duration 4 {LUGRE}",
    "simulate encoder": "simulate feed_drive --no-control --duration 8 "
    "-p plant.sensor.position_resolution=1e-6 -p plant.sensor.velocity=difference",
    "stability": "stability feed_drive",
    "stability paper": "stability paper --no-control",
    "stability lugre": f"stability feed_drive --no-control {LUGRE}",
    "sweep": "sweep feed_drive --no-control --over plant.belt_speed=0.02:0.06:60",
    "sweep, sampled": "sweep feed_drive --over plant.belt_speed=0.02:0.06:20 "
    "--over washout_controller.linear_gain=-4000:-100:4",
    "sweep, both ways": "sweep paper --no-control --carry both --over plant.belt_speed=0.02:0.6:60",
    "basin": "basin feed_drive --no-control --position -5e-4:5e-4:8 --velocity -0.05:0.05:8",
    "design": "design feed_drive",
    "report": "report {reference}",
    "report, table": "report feed_drive.csv",
    "identify": "identify feed_drive.csv --to 4 --law stribeck --fix plant.mass=100",
    "show": "show feed_drive",
}


def main() -> int:
    """Compare the hashes, or write them; return 1 if one differs, 77 if none can be compared."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bit_for_bit", description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"write {FILE.name}")
    arguments = parser.parse_args()
    known = json.loads(FILE.read_text(encoding="utf-8"))
    others = made_with().items() - known["made_with"].items()
    if others and not arguments.write:
        found = ", ".join(f"{name} {value}" for name, value in sorted(others))
        print(f"{FILE.name} does not hold for {found}: --write replaces its hashes by your own")
        return LACKING
    hashes: dict[str, str] = {}
    reference = Path(__file__).parents[1] / "bags" / "reference"
    with tempfile.TemporaryDirectory() as folder, own_domain() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        for name, compute in cases(Path(folder), reference):
            hashes[name] = compute()
            before = known["hashes"].get(name)
            verdict = "new" if before is None else "same" if before == hashes[name] else "DIFFERS"
            print(f"{verdict:8} {hashes[name]}  {name}", flush=True)
    if arguments.write:
        found = {"made_with": made_with(), "hashes": hashes}
        FILE.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
        return 0
    return int(any(known["hashes"].get(name) != found for name, found in hashes.items()))


def made_with() -> dict[str, str]:
    """Return what the last bits depend on: numpy and OpenBLAS choose by the instruction sets."""
    extensions = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    processor = " ".join([platform.machine(), *extensions])
    found = {"processor": processor, "libm": " ".join(platform.libc_ver()), **versions()}
    del found["stickslip_ros"]  # what is compared
    return found


def cases(folder: Path, reference: Path) -> Generator[tuple[str, Callable[[], str]]]:
    """Yield each name, and what computes its hash."""
    for number, (name, options) in enumerate(RUNS.items()):
        bag = folder / f"run{number}"
        yield f"run: {name}", lambda bag=bag, options=options: run(folder, bag, options)
    yield "run: values set under way", lambda: set_under_way(folder / "set")
    for name, options in COMMANDS.items():
        text = options.format(reference=reference)
        yield name, lambda text=text: result(folder, text)


def run(folder: Path, bag: Path, options: str) -> str:
    stickslip(folder, f"run --pace lockstep --json --bag {bag} {options}")
    return hash_of_bag(bag)


def set_under_way(bag: Path) -> str:
    with ClosedLoop("feed_drive", "washout_controller.start_after=0.5", bag=bag) as loop:
        loop.run(1.5)
        loop.set("plant.belt_speed=0.03", "washout_controller.linear_gain=-1500.0")
        loop.run(1.5)
    return hash_of_bag(bag) + hash_of_bag(bag.with_name(f"{bag.name}_2"))


def hash_of_bag(bag: Path) -> str:
    digest = hashlib.sha256()
    with Recording(bag) as recording:
        for topic in TOPICS:
            for _, _, payload in recording.messages(f"/feed_drive/{topic}"):
                digest.update(payload)
    return digest.hexdigest()[:16]


def result(folder: Path, options: str) -> str:
    found = json.loads(stickslip(folder, f"{options} --json"))
    text = json.dumps(without_versions(found), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def without_versions(found: Any) -> Any:
    """Leave out what says with what, from where and when it was made."""
    if isinstance(found, dict):
        left_out = {"versions", "bag", "bags", "path", "seconds", "out", "recordings", "scenario"}
        return {name: without_versions(found[name]) for name in found if name not in left_out}
    return [without_versions(each) for each in found] if isinstance(found, list) else found


def stickslip(folder: Path, options: str) -> str:
    command = [sys.executable, "-m", "stickslip_ros.app.main", *options.split()]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"stickslip {options}: {done.stderr}")
    return done.stdout


if __name__ == "__main__":
    sys.exit(main())
