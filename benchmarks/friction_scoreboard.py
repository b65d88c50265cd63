"""How do tools compare for friction with presliding: error, drift and time?

Stick-slip: the LuGre law with the constants of its paper (table I: S 1e5 1/m, a mass of 1 kg, a
spring of 2 N/m) on a belt of 0.1 m/s for 14 s, and the slide of a machine tool, 100 kg on 1e6 N/m,
with LuGre bristles of S 1e5 1/m on a belt of 40 mm/s for 20 natural periods. The error is the
largest difference of the displacement at 57 samples from DOP853 at rtol 1e-13, in shares of its
range. Drift: the first law without a spring under 0.5 N and a sine of 0.3 N at 1 Hz for 60 s, below
its break-away: the displacement from the 10th to the 60th second.

PathSim integrates the same equations with its adaptive solver of order 8. MuJoCo has LuGre friction
in its DC motor, here without the motor, at a fixed step. The tanh form has no memory: friction is
that of steady slip times tanh(v/v_t), v_t a hundredth of the decay speed, by scipy's LSODA.
Processor times are medians of the turns; tools that are not installed are left out.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from math import exp, inf, pi, sin, sqrt, tanh
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import DOP853, solve_ivp

from benchmarks.memory_reference import Array, Law, MemoryDrive
from stickslip_ros.installed_packages import versions
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import ElastoPlastic, Exponential, LuGre
from stickslip_ros.motion import Motion

TURNS = 3
SAMPLES = 57
STEP = 1e-5
"""Fixed step of MuJoCo, s; its quickest stable one is 2e-5."""
Force = Callable[[float], float]


@dataclass(frozen=True)
class Case:
    """A drive with LuGre friction from rest; per unit of the normal force `normal` (N)."""

    mass: float
    damping: float
    stiffness: float
    normal: float
    belt_speed: float
    curve: Exponential
    bristles: float
    bristle_damping: float
    duration: float
    force: Force | None = None

    @property
    def times(self) -> Array:
        return np.linspace(0.0, self.duration, SAMPLES)

    def drive(self, kind: type[LuGre] = LuGre) -> Drive:
        law = kind(self.curve, self.bristles, self.bristle_damping)
        return Drive(self.mass, self.damping, self.stiffness, self.normal, self.belt_speed, law)

    def size(self, w: float) -> float:
        """Return g, written again."""
        c = self.curve
        return c.kinetic + (c.static - c.kinetic) * exp(-((abs(w) / c.decay_speed) ** c.exponent))

    def equations(self, t: float, state: Array) -> list[float]:
        """Return the rates of x, v = x' - v_b and z."""
        x, v, z = state
        rate = v - self.bristles * abs(v) * z / self.size(v)
        friction = self.bristles * z + self.bristle_damping * rate + self.curve.viscous * v
        return [v + self.belt_speed, self._acceleration(t, x, v, friction), rate]

    def regularised(self, t: float, state: Array) -> list[float]:
        """Return the rates of x and v with the tanh form."""
        x, v = state
        friction = self.size(v) * tanh(100.0 * v / self.curve.decay_speed) + self.curve.viscous * v
        return [v + self.belt_speed, self._acceleration(t, x, v, friction)]

    def _acceleration(self, t: float, x: float, v: float, friction: float) -> float:
        pushed = self.force(t) if self.force is not None else 0.0
        held = self.damping * (v + self.belt_speed) + self.stiffness * x
        return (pushed - held - self.normal * friction) / self.mass


PAPER = Case(1.0, 0.0, 2.0, 1.0, 0.1, Exponential(1.5, 1.0, 1e-3, 0.4, 2.0), 1e5, sqrt(1e5), 14.0)
FEED = Case(
    100.0,
    200.0,
    1e6,
    1000.0,
    0.04,
    Exponential(0.4, 0.25, 0.02, exponent=2.0),
    1e5,
    100.0,
    20 * 2 * pi / 100,
)
SWING = Case(
    1.0, 0.0, 0.0, 1.0, 0.0, PAPER.curve, 1e5, sqrt(1e5), 60.0,
    lambda t: 0.5 + 0.3 * sin(2.0 * pi * t),
)  # fmt: skip
START = {PAPER: [0.0, -0.1, 0.0], FEED: [0.0, -0.04, 0.0], SWING: [0.0, 0.0, 0.0]}


def by_us(kind: type[LuGre], period: float = inf) -> Callable[[Case], Array]:
    """Return our motion; a force that varies is held for a `period` (s)."""

    def run(case: Case) -> Array:
        motion, found = Motion(case.drive(kind), 0.0, 0.0), [0.0]
        for start, end in zip(case.times[:-1], case.times[1:], strict=True):
            steps = 1 if case.force is None else round((end - start) / period)
            for number in range(steps):
                if case.force is not None:
                    motion.force = case.force(start + (number + 0.5) * period)
                motion.advance((end - start) / steps)
            found.append(motion.position)
        return np.array(found)

    return run


def by_radau(rtol: float, *, memory: bool = True) -> Callable[[Case], Array]:
    def run(case: Case) -> Array:
        start = START[case] if memory else START[case][:2]
        rates = case.equations if memory else case.regularised
        longest = 0.05 if case.force is not None else inf
        atol = 1e-3 * rtol * np.array([1e-3, 1e-3, 1e-5][: len(start)])
        method = "Radau" if memory else "LSODA"
        options = {"rtol": rtol, "atol": atol, "max_step": longest, "first_step": 1e-7}
        found = solve_ivp(rates, (0.0, case.duration), start, method, case.times, **options)
        return found.y[0]

    return run


def by_pathsim(case: Case) -> Array:
    from pathsim import Connection, Simulation
    from pathsim.blocks import ODE, Scope
    from pathsim.solvers import RKDP87

    block = ODE(lambda x, u, t: np.array(case.equations(t, x)), initial_value=np.array(START[case]))
    scope = Scope()
    simulation = Simulation(
        [block, scope],
        [Connection(block[0], scope[0])],
        dt=1e-5,
        log=False,
        Solver=RKDP87,
        tolerance_lte_rel=1e-9,
        tolerance_lte_abs=1e-12,
    )
    found = [0.0]
    for duration in np.diff(case.times):
        simulation.run(float(duration), reset=False, adaptive=True)
        found.append(float(block.engine.get()[0]))
    return np.array(found)


def by_mujoco(case: Case) -> Array:
    """Follow the slide in the frame of the belt: p = x - v_b t."""
    import mujoco

    curve, normal = case.curve, case.normal
    constants = (
        normal * case.bristles, normal * case.bristle_damping, normal * curve.kinetic,
        normal * curve.static, curve.decay_speed,
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler autolimits="false"/>
        <option timestep="{STEP}" gravity="0 0 0" integrator="implicitfast"/>
        <worldbody><body><joint name="slide" type="slide" axis="1 0 0"
          damping="{case.damping + normal * curve.viscous}"/>
          <geom type="sphere" size="0.01" mass="{case.mass}"/></body></worldbody>
        <actuator><dcmotor joint="slide" input="none" motorconst="0 0" resistance="1"
          lugre="{" ".join(map(repr, constants))}"/></actuator></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.qvel[0] = START[case][1]
    found, number = [0.0], 0
    for time in case.times[1:]:
        while number * STEP < time - 0.5 * STEP:
            now = number * STEP
            pushed = case.force(now) if case.force is not None else 0.0
            x = data.qpos[0] + case.belt_speed * now
            data.qfrc_applied[0] = pushed - case.stiffness * x - case.damping * case.belt_speed
            mujoco.mj_step(model, data)
            number += 1
        found.append(float(data.qpos[0] + case.belt_speed * time))
    return np.array(found)


TOOLS: Mapping[str, tuple[str, Callable[[Case], Array]]] = {
    "ours, lugre": ("", by_us(LuGre, 1e-3)),
    "scipy Radau, rtol 1e-6": ("", by_radau(1e-6)),
    "scipy Radau, rtol 1e-8": ("", by_radau(1e-8)),
    "scipy Radau, rtol 1e-10": ("", by_radau(1e-10)),
    "PathSim": ("pathsim", by_pathsim),
    "MuJoCo": ("mujoco", by_mujoco),
    "tanh form": ("", by_radau(1e-8, memory=False)),
    "ours, elasto_plastic": ("", by_us(ElastoPlastic, 1e-3)),
}


def reference(case: Case) -> Array:
    law = Law(case.size, case.bristles, case.bristle_damping, case.curve.viscous)
    drive = MemoryDrive(
        case.mass, case.damping, case.stiffness, case.normal, case.belt_speed, law, law,
        solver=DOP853, rtol=1e-13,
    )  # fmt: skip
    return drive.run(0.0, 0.0, case.times)[:, 0]


def row(run: Callable[[Case], Array], references: Mapping[str, Array]) -> dict[str, Any]:
    """Return errors, drift and times of a tool."""
    found: dict[str, Any] = {}
    for name, case in (("lugre_1995", PAPER), ("feed_drive", FEED)):
        run(case)
        expected, times, error = references[name], list[float](), 0.0
        for _ in range(TURNS):
            start = process_time()
            error = float(np.abs(run(case) - expected).max() / np.ptp(expected))
            times.append(process_time() - start)
        found[name] = {"error": float(f"{error:.2g}"), "seconds": float(f"{median(times):.3g}")}
    try:
        swing = run(SWING)
    except ValueError:  # scipy's Radau meets a norm of zero
        return found | {"drift_micrometres": None}
    late = SWING.times > 10.0
    drift = np.polyfit(SWING.times[late], swing[late], 1)[0] * 50.0
    return found | {"drift_micrometres": round(1e6 * float(drift), 3)}


def speed_ups(rows: Mapping[str, Any]) -> dict[str, Any]:
    """Return how much faster we are than the quickest Radau that reaches an error."""
    ours = rows["ours, lugre"]
    found: dict[str, Any] = {}
    for case, error in (("lugre_1995", 1e-8), ("feed_drive", 1e-7)):
        enough = [
            each[case]["seconds"]
            for name, each in rows.items()
            if name.startswith("scipy") and each[case]["error"] <= error
        ]
        accurate = ours[case]["error"] <= error and enough
        found[f"{case}, error {error:g}"] = (
            round(min(enough) / ours[case]["seconds"]) if accurate else None
        )
    return found


def main() -> int:
    """Run the scoreboard; print it."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.friction_scoreboard",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="also write JSON to this file")
    arguments = parser.parse_args()
    references = {"lugre_1995": reference(PAPER), "feed_drive": reference(FEED)}
    rows: dict[str, Any] = {}
    for name, (needed, run) in TOOLS.items():
        if needed and find_spec(needed) is None:
            print(f"{name} is left out: pip install {needed}", file=sys.stderr)
            continue
        rows[name] = row(run, references)
        print(f"{name:26}{rows[name]}", flush=True)
    found = {"rows": rows, "times_faster_than_radau": speed_ups(rows), "versions": versions()}
    print(found["times_faster_than_radau"])
    if arguments.out is not None:
        arguments.out.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
