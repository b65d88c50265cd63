"""Keep public names importable from their modules of version 0.1, with a warning, until 0.3.

`MOVED` lists them all: for each old module, each name and its new place. Modules that no longer
exist are provided by the finder in this module; the others use `moved_from` as `__getattr__`.
"""

import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from importlib.abc import Loader
else:  # at run time the base class adds nothing, and its import takes as long as all else here
    Loader = object

_MODEL = "stickslip_ros.physics.model"
_LOOP = "stickslip_ros.physics.loop"
_WASHOUT = {
    "WashoutParameters": f"{_MODEL}.control.Washout",
    "Washout": f"{_LOOP}.controller.Controller",
}
_GAINS = {"WashoutGains": f"{_MODEL}.control.WashoutGains"}

MOVED: dict[str, dict[str, str]] = {
    "stickslip_ros.bags.messages": {
        "JointStateColumns": "stickslip_ros.samples.SampleColumns",
        "WrenchColumns": "stickslip_ros.samples.ForceColumns",
    },
    "stickslip_ros.scenario": {},
    "stickslip_ros.scenario.files": {
        name: f"stickslip_ros.scenarios.files.{name}"
        for name in ("load_scenario", "Scenario", "parameter_file")
    },
    "stickslip_ros.physics.drive": {"Drive": f"{_MODEL}.drive.Drive"},
    "stickslip_ros.physics.friction": {
        name: f"{_MODEL}.friction.{name}"
        for name in ("FrictionLaw", "Stribeck", "Coulomb", "Linear", "Exponential", "LAWS")
    },
    "stickslip_ros.physics.knots": {
        "Knots": "stickslip_ros.physics.measures.breakpoints.Breakpoints",
    },
    "stickslip_ros.physics.washout": _WASHOUT,
    f"{_LOOP}.washout": _WASHOUT,
    "stickslip_ros.physics.equations": _GAINS,
    f"{_MODEL}.equations": _GAINS,
    "stickslip_ros.physics.sampled_loop": {
        "SampledLoop": f"{_LOOP}.sampled_loop.SampledLoop",
        "Sample": "stickslip_ros.samples.Sample",
        "Verdict": f"{_LOOP}.sampled_loop.Verdict",
    },
    "stickslip_ros.physics.disturbance": {"Disturbance": f"{_MODEL}.disturbance.Disturbance"},
    "stickslip_ros.physics.simulation": {
        name: f"{_LOOP}.simulation.{name}" for name in ("simulate_sampled", "simulate_continuous")
    },
    "stickslip_ros.studies.plan": {"Sample": "stickslip_ros.studies.plan.RandomSample"},
    "stickslip_ros.studies.settled": {"Course": "stickslip_ros.studies.settling.SettlingCourse"},
    "stickslip_ros.physics.theory.closed_loop": {
        name: f"stickslip_ros.physics.theory.critical_gains.{name}"
        for name in ("critical_gains", "CriticalGains")
    },
    "stickslip_ros.physics.theory.sampled": {
        name: f"stickslip_ros.physics.theory.linear_sampled_loop.{name}"
        for name in ("LinearSampledLoop", "GainInterval")
    },
}

ADAPTERS = {
    f"{_MODEL}.control.Washout": f"{_LOOP}.washout.OldWashoutParameters",
    f"{_LOOP}.controller.Controller": f"{_LOOP}.washout.OldWashout",
}
"""What an old name stands for, by its new place, where arguments or methods have changed."""


def moved_from(module: str) -> Callable[[str], Any]:
    """Return the `__getattr__` of a module from which names of `MOVED` were moved."""

    def get(name: str) -> Any:
        now = MOVED[module].get(name)
        if now is None:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        _warn(f"{module}.{name}", now)
        home, _, new_name = ADAPTERS.get(now, now).rpartition(".")
        return getattr(import_module(home), new_name)

    return get


class Renamed:
    """The name of a class member in version 0.1; warn and return the new member."""

    def __init__(self, new_name: str) -> None:
        self._new_name = new_name

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: object, owner: type) -> Any:
        _warn(f"{owner.__name__}.{self._name}", f"{owner.__name__}.{self._new_name}")
        return getattr(owner if instance is None else instance, self._new_name)


def _warn(old: str, new: str) -> None:
    warnings.warn(
        f"{old} is now {new}; the old name will be removed in 0.3", DeprecationWarning, stacklevel=3
    )


class _MovedModules(Loader):
    """Find the modules of `MOVED` that no longer exist."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname not in MOVED:
            return None
        is_package = any(name.startswith(f"{fullname}.") for name in MOVED)
        return ModuleSpec(fullname, self, is_package=is_package)

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave the making of the module to the import system."""

    def exec_module(self, module: ModuleType) -> None:
        vars(module)["__getattr__"] = moved_from(module.__name__)
        if module.__name__ == "stickslip_ros.scenario":
            module.__class__ = _CallableScenario
            module.__doc__ = _CallableScenario.__doc__


class _CallableScenario(ModuleType):
    """The package that was `stickslip_ros.scenario`, where a public function of that name is now.

    The import system puts it in the place of that function.
    """

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        package = sys.modules[self.__name__.rpartition(".")[0]]
        return package.__getattr__("scenario")(*arguments, **options)


def find_moved_modules() -> None:
    """Make the modules of `MOVED` that no longer exist importable."""
    sys.meta_path.append(_MovedModules())
