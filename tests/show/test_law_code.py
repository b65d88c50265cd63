"""Exported control laws: the C code, compiled, gives the forces of the Python law."""

import ctypes
import re
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.model.control import CONTROL_LAWS, ControlLaw, VelocityFeedback
from stickslip_ros.samples import MotorSample, Reference, Sample
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.show.law_code import LANGUAGES, law_code
from stickslip_ros.show.law_program import Decision, law_program

COUNT = 100_000
GAINS = {
    "washout": ["corner_frequency=30.0", "linear_gain=-900.0", "cubic_gain=-2e4"],
    "velocity_feedback": ["position_gain=-3e4", "velocity_gain=-800.0"],
    "cascade": [
        "position_gain=20.0", "velocity_gain=900.0", "integral_gain=5e3", "feed_forward_mass=3.0",
        "linear_gain=-50.0", "cubic_gain=-4.0", "velocity_feedback=motor", "feedback=motor",
    ],
    "pid": ["position_gain=1e4", "integral_gain=3e4", "velocity_gain=500.0"],
    "disturbance_observer": ["bandwidth=60.0", "nominal_mass=7.0", "position_gain=1e4"],
    "sliding_mode": ["slope=30.0", "switching_force=200.0", "boundary_layer=0.01"],
    "reset_integral": ["position_gain=1e4", "integral_gain=3e4", "reset_band=1e-4"],
    "friction_feedforward": [
        "kinetic_force=50.0", "static_force=90.0", "decay_speed=0.01", "exponent=1.7",
        "nominal_mass=4.0", "viscous_damping=30.0",
    ],
    "lugre_observer": [
        "kinetic_force=50.0", "static_force=90.0", "decay_speed=0.01", "bristle_stiffness=1e5",
        "observer_gain=2.0",
    ],
}  # fmt: skip
REFERENCE = "reference_position", "reference_velocity", "reference_acceleration"


class Compiled:
    """The C code of the law of a scenario."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        source, library = folder / "law.c", folder / "law.so"
        source.write_text(law_code(scenario, LANGUAGES[".c"]))
        strict = "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2"
        subprocess.run(
            ["cc", *strict, "-shared", "-fPIC", str(source), "-o", str(library), "-lm"], check=True
        )
        name, loaded = scenario.controller.law, ctypes.CDLL(str(library))
        head = source.read_text().split(f"double {name}_force(")[1].split(")")[0]
        self.inputs = [part.split()[-1] for part in head.split(",")[1:]]
        self._state = ctypes.create_string_buffer(100_000)
        self._call = getattr(loaded, f"{name}_force")
        self._call.restype = ctypes.c_double
        self._call.argtypes = [ctypes.c_char_p, *[ctypes.c_double] * len(self.inputs)]
        getattr(loaded, f"{name}_reset")(self._state)

    def force(self, **values: float) -> float:
        return float(self._call(self._state, *(values[name] for name in self.inputs)))


def scenario_of(law: str, *overrides: str) -> Scenario:
    node = f"{law}_controller"
    gains = [f"{node}.{gain}" for gain in GAINS[law]]
    motor = ["plant.motor.kind=mass"] if any("motor" in gain for gain in gains) else []
    limit = f"{node}.force_limit=300.0"
    return load_scenario("feed_drive", [*motor, *gains, limit, *overrides], controller=law)


def random_inputs(law: type[ControlLaw]) -> Any:
    """Yield samples and references: some coincide, so that errors pass through zero."""
    random = np.random.default_rng(5)
    positions, velocities = random.normal(0.0, [[2e-3], [5e-2]], (2, COUNT))
    velocities[random.random(COUNT) < 0.05] = 0.0
    rows = np.stack([
        positions, velocities, random.choice([0.0, 0.04], COUNT),
        positions + 1e-5, 1.1 * velocities, random.choice([0.0, 1e-3], COUNT),
        random.choice([0.0, 0.04], COUNT), random.normal(0.0, 1.0, COUNT),
    ])  # fmt: skip
    for row in rows.T.tolist():
        x, v, belt, motor_x, motor_v, *reference = row
        sample = Sample(0, x, v, 0.0, 0.0, belt, MotorSample(motor_x, motor_v))
        yield sample, Reference(*reference) if law.follows_reference else Reference()


@pytest.mark.long
@pytest.mark.parametrize("law", CONTROL_LAWS)
def test_compiled_it_gives_the_forces_of_the_law(law: str, tmp_path: Path) -> None:
    scenario = scenario_of(law)
    compiled, python = Compiled(scenario, tmp_path), scenario.controller.control_law
    forces, largest, state, elapsed = [], 0.0, None, 0.0
    for sample, reference in random_inputs(type(python)):
        if state is None:
            state = python.initial_state(sample, reference)
        force, state = python.respond(state, elapsed, sample, reference)
        elapsed, force = scenario.plant.period, python.limited(force)
        given = compiled.force(
            position=sample.position, velocity=sample.velocity, belt_velocity=sample.belt_velocity,
            motor_position=sample.motor.position, motor_velocity=sample.motor.velocity,
            **dict(zip(REFERENCE, reference, strict=True)),
        )  # fmt: skip
        forces.append(given - force)
        largest = max(largest, abs(force))
    assert largest > 30.0
    assert np.abs(forces).max() <= 1e-12 * largest


@pytest.mark.process
@pytest.mark.parametrize("spans", [1, 4])
def test_velocities_are_differences_as_the_sensor_takes_them(spans: int, tmp_path: Path) -> None:
    sensor = ["plant.sensor.velocity=difference", f"plant.sensor.difference_samples={spans}"]
    scenario = scenario_of("washout", *sensor)
    compiled, law = Compiled(scenario, tmp_path), scenario.controller.control_law
    assert compiled.inputs == ["position"]
    measure = scenario.plant.sensor.start(scenario.plant.period)
    assert measure is not None
    state, elapsed = None, 0.0
    for position in np.random.default_rng(1).normal(0.0, 1e-5, 50).tolist():
        sample = Sample(0, *measure(position, 0.0), 0.0, 0.0, 0.0)
        state = state or law.initial_state(sample, Reference())
        force, state = law.respond(state, elapsed, sample, Reference())
        elapsed = scenario.plant.period
        assert compiled.force(position=position) == pytest.approx(law.limited(force), rel=1e-12)


def test_structured_text_has_the_statements_of_the_c_code() -> None:
    scenario = scenario_of("friction_feedforward")
    c, text = (law_code(scenario, LANGUAGES[ending]) for ending in (".c", ".st"))
    for name in ("position", "reference_velocity", "belt_velocity"):
        assert f"    {name} : LREAL;" in text
    same = {
        "const double ": "", "self->integral": "kept_integral", "self->": "", " = ": " := ",
        "} else {": "ELSE", "}": "END_IF;", "fabs": "ABS", "exp(": "EXP(", "pow": "EXPT", "==": "=",
    }  # fmt: skip
    for old, new in same.items():
        c = c.replace(old, new)
    c = re.sub(r"if \((.*)\) {", r"IF \1 THEN", c)
    of_c, of_text = (
        [line.strip() for line in code.splitlines() if re.match(r" *(force|t\d|IF|kept) ?", line)]
        for code in (c.partition("double force;")[2], text.partition("VAR_TEMP")[2])
    )
    literal = re.compile(r"\d+\.?\d*[eE]?[-+]?\d*")
    assert len(of_c) > 5
    assert [literal.sub("", line) for line in of_c if "samples" not in line] == [
        literal.sub("", line) for line in of_text
        if "samples" not in line and "LIMIT" not in line and ": LREAL" not in line
        and line != "IF reset THEN"
    ]  # fmt: skip


@dataclass(frozen=True)
class Timely(VelocityFeedback):
    name: ClassVar[str] = "timely"

    def respond(self, state: Any, elapsed: float, sample: Sample, reference: Reference) -> Any:
        return 1.0 * sample.stamp, state


@dataclass(frozen=True)
class Numeric(VelocityFeedback):
    name: ClassVar[str] = "numeric"

    def respond(self, state: Any, elapsed: float, sample: Sample, reference: Reference) -> Any:
        return float(np.tanh(sample.velocity)), state


@pytest.mark.parametrize(("law", "why"), [(Timely, "uses stamp"), (Numeric, "with more than sums")])
def test_a_law_that_is_no_such_program_is_refused(law: type[ControlLaw], why: str) -> None:
    with pytest.raises(InvalidInputError, match=why):
        law_program(law(), 1e-3)


def test_no_name_ends_the_comment() -> None:
    scenario = scenario_of("pid")
    hostile = replace(scenario, name="*/ int x; /* *) x := 1; (*")
    for ending, end in ((".c", "*/"), (".st", "*)")):
        text = law_code(hostile, LANGUAGES[ending])
        assert "int x" in text.partition(end)[0]


@dataclass(frozen=True)
class Stepping(VelocityFeedback):
    name: ClassVar[str] = "stepping"

    def respond(self, state: Any, elapsed: float, sample: Sample, reference: Reference) -> Any:
        return (1.0 if sample.velocity == 0 else 2.0), state


def test_a_comparison_with_a_whole_number_is_a_decision() -> None:
    decision = law_program(Stepping(), 1e-3).next
    assert isinstance(decision, Decision)
    assert (decision.holds.key, decision.fails.key) == ((1.0,), (2.0,))
