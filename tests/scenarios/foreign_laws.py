"""Packages with laws of their own, written into a directory of the path."""

import tomllib
from collections.abc import Mapping
from pathlib import Path

import pytest

from stickslip_ros.model.control import CONTROL_LAWS, ControlLaw
from stickslip_ros.scenarios.foreign_laws import FRICTION_LAWS
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    NODE_PARAMETERS,
    ControllerParameters,
)
from tests.docs.page import CHECKOUT

FALLING = '''
"""A law of another package: the linear law, with a constant of its own name."""

from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip_ros.model.constants import constant
from stickslip_ros.model.friction import FrictionLaw


@dataclass(frozen=True)
class Falling(FrictionLaw):
    """Friction that falls with speed."""

    name: ClassVar[str] = "falling"
    fall: Any = constant(0.2, "Decrease with speed", "s/m", at_least=0.0)

    def coefficient(self, relative_speed: Any, sign: Any) -> Any:
        """Return mu(v_r)."""
        return -self.static * sign + self.fall * relative_speed

    def refusal(self) -> str | None:
        """Refuse a fall above 10."""
        return f"fall = {self.fall} must not exceed 10 static = 10.0" if self.fall > 10.0 else None
'''

BRAKE = '''
"""A control law of another package: a damper with an offset."""

from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip_ros.model.constants import constant
from stickslip_ros.model.control import ControlLaw


@dataclass(frozen=True)
class Brake(ControlLaw):
    """Force against the velocity."""

    name: ClassVar[str] = "brake"
    strength: Any = constant(1.0, "Force per velocity", "N s/m", at_least=0.0)

    def respond(self, state: Any, elapsed: Any, sample: Any, reference: Any) -> Any:
        """Return the force."""
        return -self.strength * sample.velocity, state

    def refusal(self) -> str | None:
        """Refuse a strength above 1e6."""
        return None if self.strength <= 1e6 else f"strength = {self.strength} must not exceed 1e6"
'''


def make_known(
    patch: pytest.MonkeyPatch, law: type[ControlLaw], parameters: ControllerParameters
) -> None:
    """Let a law and the parameters of its node be known, as if a package had brought them."""
    patch.setitem(CONTROL_LAWS, law.name, law)
    patch.setitem(CONTROLLER_PARAMETERS, law.name, parameters)
    patch.setitem(NODE_PARAMETERS, f"{law.name}_controller", parameters)


def write_package(
    directory: Path,
    package: str,
    modules: Mapping[str, str],
    laws: Mapping[str, str],
    group: str = FRICTION_LAWS.group,
) -> None:
    """Write what an installation leaves: modules, and the entry points of the laws."""
    _install(directory, package, modules, {group: laws})


def write_example(directory: Path, name: str) -> None:
    """Write what an installation of a package of examples/ leaves."""
    folder = CHECKOUT / "examples" / name
    described = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))
    modules = described["tool"]["setuptools"]["py-modules"]
    texts = {each: (folder / f"{each}.py").read_text(encoding="utf-8") for each in modules}
    _install(directory, name, texts, described["project"]["entry-points"])


def _install(
    directory: Path,
    package: str,
    modules: Mapping[str, str],
    groups: Mapping[str, Mapping[str, str]],
) -> None:
    for name, text in modules.items():
        (directory / f"{name}.py").write_text(text, encoding="utf-8")
    described = directory / f"{package}-1.0.dist-info"
    described.mkdir()
    (described / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    lines = ["[other]", "x = no:Thing"]
    for group, laws in groups.items():
        lines += [f"[{group}]", *(f"{name} = {place}" for name, place in laws.items())]
    (described / "entry_points.txt").write_text("\n".join([*lines, ""]))
