"""The friction laws of other packages: found by entry point, or refused with the reason."""

import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.physics.model.friction import LAWS, Linear
from stickslip_ros.scenarios import parameters
from stickslip_ros.scenarios.friction_laws import REFUSED_LAWS, add_laws_of_other_packages
from stickslip_ros.scenarios.parameter_field import parameters_of
from tests.scenarios.foreign_laws import FALLING, write_package

Install = Callable[..., None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Write the module `foreign` and its entry points, and look for laws."""
    laws, refused, modules = dict(LAWS), dict(REFUSED_LAWS), set(sys.modules)
    monkeypatch.syspath_prepend(tmp_path)

    def write_and_find(text: str = FALLING, **entry_points: str) -> None:
        entries = entry_points or {"falling": "foreign:Falling"}
        write_package(tmp_path, "foreign-laws", {"foreign": text}, entries)
        importlib.invalidate_caches()
        add_laws_of_other_packages()

    yield write_and_find
    for known, before in ((LAWS, laws), (REFUSED_LAWS, refused)):
        known.clear()
        known.update(before)  # type: ignore[arg-type]
    for name in set(sys.modules) - modules:
        del sys.modules[name]


def parameters_anew() -> ModuleType:
    """The module of the parameters as a process has it that starts now."""
    spec = importlib.util.spec_from_file_location("parameters_anew", parameters.__file__)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_a_law_of_another_package_is_found(install: Install) -> None:
    install()
    assert LAWS["falling"].constants() == ("static", "fall")
    assert list(LAWS)[-1] == "falling"
    assert REFUSED_LAWS == {}
    add_laws_of_other_packages()  # the same law again is no other law
    assert REFUSED_LAWS == {}


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
    assert REFUSED_LAWS == {}
    known = {each.name: each for each in parameters_of(parameters_anew().PlantParameters)}
    assert known["friction.kinetic"].meaning == "Kinetic coefficient mu_k (exponential, falling)."


CONSTANT = '    fall: Any = constant(0.2, "Decrease with speed", "s/m", at_least=0.0)'


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
    assert REFUSED_LAWS["falling"].startswith(whole)
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
    assert f"{place} of package foreign-laws {reason}" in REFUSED_LAWS[name]


def test_of_two_packages_with_one_name_the_first_by_place_has_it(
    install: Install, tmp_path: Path
) -> None:
    write_package(tmp_path, "other", {"elsewhere": FALLING}, {"falling": "elsewhere:Falling"})
    install()
    assert LAWS["falling"].__module__ == "elsewhere"
    assert REFUSED_LAWS["falling"] == (
        "foreign:Falling of package foreign-laws has the name of another law, elsewhere.Falling"
    )
