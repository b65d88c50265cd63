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
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.control import CONTROL_LAWS
from stickslip_ros.physics.model.friction import LAWS, Directional, Linear
from stickslip_ros.physics.motion import Motion
from stickslip_ros.scenarios import friction_parameters, parameters
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.scenarios.foreign_laws import (
    CONTROLLERS,
    FRICTION_LAWS,
    LawFamily,
    add_laws_of_other_packages,
)
from stickslip_ros.scenarios.parameter_field import parameters_of
from stickslip_ros.scenarios.parameters import NodeParameters
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
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    present = sys.modules.pop(friction_parameters.__name__)
    try:
        spec.loader.exec_module(module)
    finally:
        sys.modules[present.__name__] = scenarios.friction_parameters = present
    return module


def test_a_law_of_another_package_is_found(install: Install) -> None:
    install()
    assert LAWS["falling"].constants() == ("static", "fall")
    assert list(LAWS)[-1] == "falling"
    assert FRICTION_LAWS.refused == {}
    add_laws_of_other_packages()  # the same law again is no other law
    assert FRICTION_LAWS.refused == {}


def test_its_constants_are_parameters(install: Install) -> None:
    install()
    plant = parameters_anew().PlantParameters
    known = {parameter.name: parameter for parameter in parameters_of(plant)}
    assert known["friction.law"].choices == tuple(LAWS)
    fall = known["friction.fall"]
    assert (fall.unit, fall.default, fall.bounds) == ("s/m", 0.2, "at least 0")
    assert fall.meaning == "Decrease with speed (falling)."
    assert known["friction.static"].meaning == "Static (break-away) coefficient mu_s."
    law = plant.validated({"friction.law": "falling", "friction.fall": 0.7}, "test").as_drive()
    assert law.friction == LAWS["falling"](static=0.4, fall=0.7)
    assert law.friction.coefficient(0.3, 1.0) == Linear(0.4, 0.7).coefficient(0.3, 1.0)


def test_a_law_refuses_constants_under_the_names_of_the_parameters(install: Install) -> None:
    install()
    plant = parameters_anew().PlantParameters
    with pytest.raises(InvalidInputError) as refused:
        plant.validated({"friction.law": "falling", "friction.fall": 11}, "test")
    assert str(refused.value) == (
        "test: friction.fall = 11.0 must not exceed 10 friction.static = 10.0"
    )


def test_a_constant_of_several_laws_names_them_all(install: Install) -> None:
    shared = 'kinetic: Any = constant(0.25, "Level.", at_least=0.0)\n    viscous: Any = constant('
    install(
        FALLING.replace("fall: Any = constant(", shared)
        .replace("0.2,", "0.0,", 1)
        .replace(', "s/m", at_least=0.0)', ', "s/m")')
        .replace("self.fall", "self.viscous")
    )
    assert FRICTION_LAWS.refused == {}
    known = {each.name: each for each in parameters_of(parameters_anew().PlantParameters)}
    assert known["friction.kinetic"].meaning == (
        "Kinetic coefficient mu_k (exponential, rate_state, falling)."
    )


def test_its_constants_may_differ_between_the_directions(install: Install) -> None:
    install()
    plant = parameters_anew().PlantParameters
    falling = LAWS["falling"]
    given = {"friction.law": "falling", "friction.fall": 0.3, "friction.reverse.fall": 0.7}
    law = plant.validated(given, "test").as_drive().friction
    assert law == Directional(falling(0.4, fall=0.3), falling(0.4, fall=0.7))
    with pytest.raises(InvalidInputError) as refused:
        plant.validated(given | {"friction.reverse.fall": 11}, "test")
    assert str(refused.value) == (
        "test: friction.reverse.fall = 11.0 must not exceed 10 friction.static = 10.0"
    )
    with pytest.raises(InvalidInputError, match=r"friction.reverse.fall = -1.0 is refused: must"):
        plant.validated(given | {"friction.reverse.fall": -1.0}, "test")


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
    plant = parameters_anew().PlantParameters
    known = {parameter.name for parameter in parameters_of(plant)}
    assert "friction.terms" in known
    assert known.isdisjoint({"friction.fall", "friction.reverse.fall", "friction.reverse.terms"})
    given = {"friction.law": "falling", "friction.terms": 1, "friction.reverse.static": 0.3}
    drive = plant.validated(given, "test").as_drive()
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
        (0, "friction.terms = 0 is refused: must be a whole number at least 1"),
        (1.5, "friction.terms = 1.5 is refused: must be a whole number at least 1"),
    ):
        with pytest.raises(InvalidInputError) as refused:
            plant.validated(given | {"friction.terms": value}, "test")
        assert str(refused.value) == f"test: {reason}"


@pytest.mark.parametrize(
    ("first", "second", "reason"),
    [
        (IN_TERMS, FALLING, "bounds at least 0 and default 0.2: must be none, (0.2, 0.1)"),
        (FALLING, IN_TERMS, "bounds none and default (0.2, 0.1): must be at least 0, 0.2"),
    ],
)
def test_a_name_is_a_number_in_all_laws_or_a_tuple_in_all(
    install: Install, tmp_path: Path, first: str, second: str, reason: str
) -> None:
    write_package(tmp_path, "earlier", {"earlier": first}, {"falling": "earlier:Falling"})
    other = second.replace('"falling"', '"falling_too"')
    install(other, falling_too="foreign:Falling")
    assert FRICTION_LAWS.refused == {
        "falling_too": f"foreign:Falling of package foreign-laws has a constant fall with {reason} "
        "as in law falling, or have another name"
    }


def test_tuples_of_one_name_may_have_different_defaults(install: Install, tmp_path: Path) -> None:
    write_package(tmp_path, "earlier", {"earlier": IN_TERMS}, {"falling": "earlier:Falling"})
    other = IN_TERMS.replace('"falling"', '"falling_too"').replace("(0.2, 0.1)", "(0.3, 0.1)")
    install(other, falling_too="foreign:Falling")
    assert FRICTION_LAWS.refused == {}


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("FrictionLaw)", "object)", "is no class derived from FrictionLaw"),
        ("import dataclass\n", "import dataclas\n", "cannot be imported: ImportError: cannot"),
        ("from typing", "raise SystemExit(3)\nfrom typing", "cannot be imported: SystemExit: 3"),
        ("class Falling(", "class Rising(", "cannot be imported: AttributeError: module 'foreign'"),
        ("(frozen=True)", "()", "cannot be imported: TypeError: cannot inherit non-frozen"),
        ("@dataclass(frozen=True)", "", "is no dataclass: must have @dataclass(frozen=True)"),
        ("def coefficient", "def coeficient", "does not define coefficient"),
        (
            CONSTANT,
            "    fall: Any = 0.2",
            "does not describe its constant fall by `constant`",
        ),
        (
            '"falling"',
            '"fallen"',
            "has the name 'fallen' in its class and 'falling' in its entry point",
        ),
        (
            CONSTANT,
            '    slope: Any = constant(0.45, "Fall.", "m/s")',
            "has a constant slope with unit m/s: must be s/m as in law linear, or have another",
        ),
        (
            CONSTANT,
            '    static: Any = constant(0.3, "Static.", at_least=0.0)',
            "has a constant static with default 0.3: must be 0.4 as in law stribeck",
        ),
        (
            CONSTANT,
            '    kinetic: Any = constant(0.2, "Level.", positive=True)',
            "has a constant kinetic with bounds above 0 and default 0.2: must be at least 0, 0.25 "
            "as in law exponential",
        ),
        (
            CONSTANT,
            '    law: Any = constant(0.2, "Fall.")',
            "has a constant law: the name cannot be that of a parameter",
        ),
        (CONSTANT, '    copy: Any = constant(0.2, "Fall.")', "has a constant copy: the name"),
        (CONSTANT, '    _fall: Any = constant(0.2, "Fall.")', "has a constant _fall: the name"),
        (
            "constant(0.2",
            "constant(-0.2",
            "has the default -0.2 for its constant fall: must be a number within its bounds",
        ),
        (
            CONSTANT,
            TERMS.replace("(2,", "(1.5,"),
            "has the default 1.5 for its constant terms: must be a whole number within its bounds",
        ),
        (
            CONSTANT,
            TERMS.replace("(2,", "(float('inf'),"),
            "has the default inf for its constant terms: must be a whole number within its bounds",
        ),
        ("constant(0.2", 'constant("0.2"', "has the default '0.2' for its constant fall"),
        ("constant(0.2", 'constant(float("nan")', "has the default nan for its constant fall"),
        ('"s/m"', '"mm"', "cannot be imported: ValueError: unit 'mm': 'mm' is none of"),
        (
            "if self.fall",
            "if self.fell",
            "cannot be made from its defaults: AttributeError: 'Falling' object has no",
        ),
    ],
)
def test_a_law_that_does_not_fit_is_refused(
    install: Install, old: str, new: str, reason: str
) -> None:
    assert old in FALLING
    laws = dict(LAWS)
    install(FALLING.replace(old, new))
    assert laws == LAWS
    whole = f"foreign:Falling of package foreign-laws {reason}"
    assert FRICTION_LAWS.refused["falling"].startswith(whole)
    plant = parameters_anew().PlantParameters  # the others can be used
    assert plant().friction.law == "stribeck"
    with pytest.raises(InvalidInputError) as refused:
        plant.validated({"friction.law": "falling"}, "test")
    assert str(refused.value).startswith(f"test: friction.law = 'falling' is refused: {whole}")


@pytest.mark.parametrize(
    ("name", "place", "reason"),
    [
        ("coulomb", "foreign:Falling", "has the name of another law, stickslip_ros.physics.model."),
        ("dry-run", "foreign:Falling", "has the name 'dry-run': must be of letters, digits and _"),
        ("falling", "absent:Falling", "cannot be imported: ModuleNotFoundError: No module named"),
        ("falling", "foreign:FALLING", "cannot be imported: AttributeError"),
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
    known = {parameter.name: parameter for parameter in parameters_of(model)}
    assert list(known)[-3:] == ["strength", "force_limit", "start_after"]
    strength = known["strength"]
    assert (strength.unit, strength.default, strength.bounds) == ("N s/m", 1.0, "at least 0")
    assert known["law"].choices == ("brake",)
    parameters = model.validated({"strength": 3, "force_limit": 0.5}, "test")
    assert parameters.node == "brake_controller"
    brake: Any = CONTROL_LAWS["brake"]
    assert parameters.as_law() == brake(strength=3.0, force_limit=0.5)
    with pytest.raises(InvalidInputError, match=r"test: strength = 2000000.0 must not exceed 1e6"):
        model.validated({"strength": 2e6}, "test")


def test_control_laws_share_names_of_constants(install: Install) -> None:
    install(BRAKE.replace("strength", "linear_gain").replace("N s/m", "kg/s"), CONTROLLERS)
    assert CONTROLLERS.refused == {}


STRENGTH = '    strength: Any = constant(1.0, "Force per velocity", "N s/m", at_least=0.0)'


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("(ControlLaw)", "(object)", "is no class derived from ControlLaw"),
        ("def respond", "def reply", "does not define respond"),
        ("constant(1.0", "constant(-1.0", "has the default -1.0 for its constant strength: must"),
        *(
            (
                STRENGTH,
                f'{STRENGTH}\n    {name}: Any = constant(1.0, "Gain.")',
                f"has a constant {name}: the name cannot be that of a parameter",
            )
            for name in (
                *("law", "reference", *NodeParameters.model_fields),
                *("node", "as_law", "as_reference", "as_controller", "law_names", "copy"),
            )
        ),
    ],
)
def test_a_control_law_that_does_not_fit_is_refused(
    install: Install, old: str, new: str, reason: str
) -> None:
    assert old in BRAKE
    install(BRAKE.replace(old, new), CONTROLLERS)
    assert "brake" not in CONTROL_LAWS
    whole = f"foreign:Brake of package foreign-laws {reason}"
    assert CONTROLLERS.refused["brake"].startswith(whole)
    with pytest.raises(InvalidInputError) as refused:
        load_scenario("paper", controller="brake")
    assert str(refused.value).startswith(f"control law brake is refused: {whole}")
