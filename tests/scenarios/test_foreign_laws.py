"""The laws of other packages: found by entry point, or refused with the reason."""

import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from stickslip_ros import scenarios
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.model.control import CONTROL_LAWS
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import LAWS, Directional, Linear, Table
from stickslip_ros.motion import Motion
from stickslip_ros.scenarios import friction_parameters, parameters, plant_parameters
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.foreign_laws import (
    CONTROLLERS,
    FRICTION_LAWS,
    LawFamily,
    add_laws_of_other_packages,
    check_control_law,
    check_friction_law,
)
from stickslip_ros.scenarios.parameter_group import NodeParameters
from tests.scenarios.foreign_laws import BRAKE, FALLING, write_package

Install = Callable[..., None]

OWN_ENTRY = {
    FRICTION_LAWS.group: {"falling": "foreign:Falling"},
    CONTROLLERS.group: {"brake": "foreign:Brake"},
}


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Write the module `foreign` and its entry points, and look for laws."""
    families: tuple[LawFamily[Any], ...] = (FRICTION_LAWS, CONTROLLERS)
    known_before: list[tuple[dict[str, Any], dict[str, Any]]] = [
        (known, dict(known)) for each in families for known in (each.laws, each.refused)
    ]
    modules = set(sys.modules)
    monkeypatch.syspath_prepend(tmp_path)

    def write_and_find(
        text: str = FALLING, family: LawFamily[Any] = FRICTION_LAWS, **entry_points: str
    ) -> None:
        entries = entry_points or OWN_ENTRY[family.group]
        write_package(tmp_path, "foreign-laws", {"foreign": text}, entries, family.group)
        importlib.invalidate_caches()
        add_laws_of_other_packages()

    yield write_and_find
    for known, original in known_before:
        known.clear()
        known.update(original)
    for name in set(sys.modules) - modules:
        del sys.modules[name]


def parameters_anew() -> ModuleType:
    """The module of the parameters as a process has it that starts now."""
    spec = importlib.util.spec_from_file_location("parameters_anew", parameters.__file__)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    present = [sys.modules.pop(made.__name__) for made in (friction_parameters, plant_parameters)]
    try:
        spec.loader.exec_module(module)
    finally:
        sys.modules |= {made.__name__: made for made in present}
        scenarios.friction_parameters, scenarios.plant_parameters = present
    return module


def test_every_law_of_this_package_passes_the_check() -> None:
    points = {"points": ((0.0, 0.4), (0.1, 0.3), (1.0, 0.25))}
    for name, kind in LAWS.items():
        law = kind(**(points if name == Table.name else {}))
        check_friction_law(Directional(law, law))
    for control_law in CONTROL_LAWS.values():
        check_control_law(control_law())


def test_a_law_of_another_package_is_found_with_its_constants(install: Install) -> None:
    install()
    add_laws_of_other_packages()  # the same law again is no other law
    assert FRICTION_LAWS.refused == {}
    assert list(LAWS)[-1] == "falling"
    falling = LAWS["falling"]
    assert falling.constants() == ("static", "fall")
    plant = parameters_anew().PlantParameters()
    known = {parameter.name: parameter for parameter in plant.known.values()}
    assert known["friction.law"].choices == tuple(LAWS)
    fall = known["friction.fall"]
    assert (fall.unit, fall.default, fall.bounds) == ("s/m", 0.2, "at least 0")
    assert fall.meaning == "Decrease with speed (falling)."
    assert known["friction.static"].meaning == "Static (break-away) coefficient mu_s."

    given = {"friction.law": "falling", "friction.fall": 0.7}
    law = plant.changed(given, "test").as_drive().friction
    assert law == falling(static=0.4, fall=0.7)
    assert law.coefficient(0.3, 1.0) == Linear(0.4, 0.7).coefficient(0.3, 1.0)
    both = plant.changed(given | {"friction.reverse.fall": 0.3}, "test").as_drive().friction
    assert both == Directional(falling(0.4, fall=0.7), falling(0.4, fall=0.3))
    for name, value, reason in (
        ("fall", 11, "fall = 11.0 must not exceed 10 friction.static = 10.0"),
        ("reverse.fall", 11, "reverse.fall = 11.0 must not exceed 10 friction.static = 10.0"),
        ("reverse.fall", -1.0, "reverse.fall = -1.0 is invalid: must"),
    ):
        with pytest.raises(InvalidInputError) as refused:
            plant.changed(given | {f"friction.{name}": value}, "test")
        assert str(refused.value).startswith(f"test: friction.{reason}")


CONSTANT = '    fall: Any = constant(0.2, "Decrease with speed", "s/m", at_least=0.0)'
TERMS = '    terms: Any = constant(2, "Number of terms.", at_least=1, whole=True)'
FALLS = '    fall: Any = constant((0.2, 0.1), "Decreases with speed.", "s/m")'
IN_TERMS = (
    FALLING.replace(CONSTANT, f"{TERMS}\n{FALLS}")
    .replace("self.fall * relative_speed", "sum(self.fall[: self.terms]) * relative_speed")
    .replace(
        'f"fall = {self.fall} must not exceed 10 static = 10.0" if self.fall > 10.0 else None',
        'f"terms = {self.terms} must not exceed 2" if self.terms > len(self.fall) else None',
    )
)


def test_whole_numbers_and_tuples_are_constants(install: Install) -> None:
    install(IN_TERMS)
    assert FRICTION_LAWS.refused == {}
    plant = parameters_anew().PlantParameters()
    known = {parameter.name for parameter in plant.known.values()}
    assert "friction.terms" in known
    assert known.isdisjoint({"friction.fall", "friction.reverse.fall", "friction.reverse.terms"})
    given = {"friction.law": "falling", "friction.terms": 1, "friction.reverse.static": 0.3}
    drive = plant.changed(given, "test").as_drive()
    falling = LAWS["falling"]
    assert drive.friction == Directional(falling(0.4, terms=1), falling(0.3, terms=1))
    assert drive.friction.scaled(2.0).forward == falling(0.4, terms=1, fall=(0.4, 0.2))
    moved: list[Any] = []
    for law in (falling(0.4), Linear(0.4, 0.2 + 0.1)):
        motion = Motion(replace(drive, friction=law), 0.3, 0.0)
        motion.advance(20.0)
        moved.append((motion.position, motion.velocity))
    assert moved[0] == pytest.approx(moved[1], rel=1e-9)
    for value, reason in (
        (3, "friction.terms = 3 must not exceed 2"),
        (0, "friction.terms = 0 is invalid: must be a whole number at least 1"),
        (1.5, "friction.terms = 1.5 is invalid: must be a whole number at least 1"),
    ):
        with pytest.raises(InvalidInputError) as refused:
            plant.changed(given | {"friction.terms": value}, "test")
        assert str(refused.value) == f"test: {reason}"


@pytest.mark.parametrize(
    ("first", "second", "default"),
    [
        (IN_TERMS, FALLING, "(0.2, 0.1)"),
        (FALLING, IN_TERMS, "0.2"),
        (IN_TERMS, IN_TERMS.replace("(0.2, 0.1)", "(0.3, 0.1)"), ""),  # defaults may differ
    ],
)
def test_a_name_is_a_number_in_all_laws_or_a_tuple_in_all(
    install: Install, tmp_path: Path, first: str, second: str, default: str
) -> None:
    write_package(tmp_path, "earlier", {"earlier": first}, {"falling": "earlier:Falling"})
    other = second.replace('"falling"', '"falling_too"')
    install(other, falling_too="foreign:Falling")
    refusal = FRICTION_LAWS.refused.get("falling_too", "")
    assert ("has a constant fall unlike that of law falling" in refusal) == bool(default)
    assert f"default ({default})" in refusal or not default


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("FrictionLaw)", "object)", "is no class derived from FrictionLaw"),
        ("import dataclass\n", "import dataclas\n", "cannot be imported: ImportError: cannot"),
        ("from typing", "raise SystemExit(3)\nfrom typing", "cannot be imported: SystemExit: 3"),
        ("def coefficient", "def coeficient", "fails with its defaults: TypeError: Can't instanti"),
        ('"falling"', '"fallen"', "has the name 'fallen' in its class and 'falling' in its entry"),
        (
            CONSTANT,
            '    slope: Any = constant(0.45, "Fall.", "m/s")',
            "has a constant slope unlike that of law linear: must have its unit (s/m), default "
            "(0.45) and bounds, or another name",
        ),
        (
            CONSTANT,
            '    kinetic: Any = constant(0.2, "Level.", positive=True)',
            "has a constant kinetic unlike that of law expon",
        ),
        (CONSTANT, '    law: Any = constant(0.2, "Fall.")', "has a constant law: the name cannot"),
        (CONSTANT, '    flat: Any = constant(0.2, "Fall.")', "has a constant flat: the name"),
        ("constant(0.2", "constant(-0.2", "has a wrong default: fall = -0.2 is invalid: must be a"),
    ],
)
def test_a_law_that_would_be_in_the_way_of_others_is_refused(
    install: Install, old: str, new: str, reason: str
) -> None:
    assert old in FALLING
    laws = dict(LAWS)
    install(FALLING.replace(old, new))
    assert laws == LAWS
    whole = f"foreign:Falling of package foreign-laws {reason}"
    assert FRICTION_LAWS.refused["falling"].startswith(whole)


def test_what_is_refused_is_told_to_who_names_it(install: Install) -> None:
    install(FALLING.replace("FrictionLaw)", "object)"))
    plant = parameters_anew().PlantParameters()  # the others can be used
    assert plant.friction.law == "stribeck"
    with pytest.raises(InvalidInputError) as refused:
        plant.changed({"friction.law": "falling"}, "test")
    whole = "foreign:Falling of package foreign-laws is no class derived from FrictionLaw"
    assert str(refused.value).startswith(f"test: friction.law = 'falling' is invalid: {whole}")


RESULT = "-self.static * sign + self.fall * relative_speed"
STEADY = "def coefficient"


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (RESULT, f"{RESULT} if relative_speed < 0.3 else -sign", "TypeError: '<' not supported"),
        (RESULT, f"{RESULT} * __import__('math').tanh(relative_speed)", "TypeError: "),
        (RESULT, "float('nan') * sign", "its friction is [nan], which must be finite numbers"),
        (RESULT, "None", "TypeError: float() argument must be a string or a real number, not"),
        (RESULT, "exit(3)", "SystemExit: 3"),
        (STEADY, "limits = (None, 0.4)\n\n    def coefficient", "TypeError: float() argument"),
        (STEADY, "__post_init__ = lambda *_: 1 / self.fall\n\n    def coefficient", ""),
    ],
)
def test_a_law_that_fails_where_it_is_used_is_told_with_its_package(
    install: Install, old: str, new: str, reason: str
) -> None:
    assert old in FALLING
    install(FALLING.replace(old, new).replace("lambda *_: 1 / self", "lambda self: 1 / self"))
    assert FRICTION_LAWS.refused == {}
    plant = parameters_anew().PlantParameters()
    for direction in ("", "reverse."):
        chosen = {"friction.law": "falling", f"friction.{direction}fall": 0.0}
        with pytest.raises(InvalidInputError) as refused:
            plant.changed(chosen, "test")
        told = str(refused.value)
        expected = reason or "ZeroDivisionError: float division by zero"
        assert told.startswith(f"test: law falling of package foreign-laws fails: {expected}")
        assert "\n" not in told


def test_friction_that_is_not_finite_on_the_way_ends_the_motion(install: Install) -> None:
    number = "__import__('numpy').sqrt(x) if isinstance(x, float) else x ** 0.5"
    root = f"(lambda x: {number})(1.0 - relative_speed * sign)"
    install(FALLING.replace(RESULT, f"-self.static * sign * {root}"))
    motion = Motion(Drive(2.0, 0.1, 3.0, 5.0, 0.4, LAWS["falling"]()), 3.0, 0.0)
    with pytest.raises(RunError) as failed:
        motion.advance(10.0)
    assert str(failed.value) == (
        "the friction law falling of package foreign-laws fails: its coefficient is nan, which "
        "must be a finite number"
    )


@pytest.mark.parametrize(
    ("name", "place", "reason"),
    [
        ("coulomb", "foreign:Falling", "has the name of another law, stickslip_ros.model."),
        ("dry-run", "foreign:Falling", "has the name 'dry-run': must be of letters, digits and _"),
        ("falling", "absent:Falling", "cannot be imported: ModuleNotFoundError: No module named"),
        ("falling", "foreign", "is no class derived from FrictionLaw"),
        ("falling", "for eign:", "cannot be imported: "),
    ],
)
def test_an_entry_point_that_does_not_fit_is_refused(
    install: Install, name: str, place: str, reason: str
) -> None:
    laws = dict(LAWS)
    install(**{name: place})
    assert laws == LAWS
    assert f"{place} of package foreign-laws {reason}" in FRICTION_LAWS.refused[name]


def test_of_two_packages_with_one_name_the_first_by_place_has_it(
    install: Install, tmp_path: Path
) -> None:
    write_package(tmp_path, "other", {"elsewhere": FALLING}, {"falling": "elsewhere:Falling"})
    install()
    assert LAWS["falling"].__module__ == "elsewhere"
    assert FRICTION_LAWS.refused["falling"] == (
        "foreign:Falling of package foreign-laws has the name of another law, elsewhere.Falling"
    )


def test_the_control_law_of_another_package_has_a_node_with_parameters(install: Install) -> None:
    install(BRAKE, CONTROLLERS)
    assert CONTROLLERS.refused == {}
    assert list(CONTROL_LAWS)[-1] == "brake"
    model = parameters_anew().NODE_PARAMETERS["brake_controller"]
    known = {parameter.name: parameter for parameter in model.known.values()}
    assert list(known)[-3:] == ["strength", "force_limit", "start_after"]
    strength = known["strength"]
    assert (strength.unit, strength.default, strength.bounds) == ("N s/m", 1.0, "at least 0")
    assert known["law"].choices == ("brake",)
    parameters = model.changed({"strength": 3, "force_limit": 0.5}, "test")
    assert parameters.node == "brake_controller"
    brake: Any = CONTROL_LAWS["brake"]
    assert parameters.control_law == brake(strength=3.0, force_limit=0.5)
    with pytest.raises(InvalidInputError, match=r"test: strength = 2000000.0 must not exceed 1e6"):
        model.changed({"strength": 2e6}, "test")


def test_control_laws_share_names_of_constants(install: Install) -> None:
    install(BRAKE.replace("strength", "linear_gain").replace("N s/m", "kg/s"), CONTROLLERS)
    assert CONTROLLERS.refused == {}


@pytest.mark.parametrize("name", ["law", *NodeParameters().known, "control_law", "flat"])
def test_a_constant_of_a_control_law_has_a_name_of_its_own(install: Install, name: str) -> None:
    install(BRAKE.replace("strength", name), CONTROLLERS)
    reason = f"has a constant {name}: "
    assert "brake" not in CONTROL_LAWS
    whole = f"foreign:Brake of package foreign-laws {reason}"
    assert CONTROLLERS.refused["brake"].startswith(whole)
    with pytest.raises(InvalidInputError) as refused:
        load_scenario("paper", controller="brake")
    assert str(refused.value).startswith(f"control law brake is refused: {whole}")
