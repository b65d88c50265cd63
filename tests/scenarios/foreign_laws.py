"""Packages with friction laws of their own, written into a directory of the path."""

from collections.abc import Mapping
from pathlib import Path

FALLING = '''
"""A law of another package: the linear law, with a constant of its own name."""

from dataclasses import dataclass
from typing import Any, ClassVar

from stickslip_ros.physics.model.constants import constant
from stickslip_ros.physics.model.friction import FrictionLaw


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


def write_package(
    directory: Path, package: str, modules: Mapping[str, str], laws: Mapping[str, str]
) -> None:
    """Write what an installation leaves: modules, and the entry points of the laws."""
    for name, text in modules.items():
        (directory / f"{name}.py").write_text(text, encoding="utf-8")
    described = directory / f"{package}-1.0.dist-info"
    described.mkdir()
    (described / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    lines = [f"{name} = {place}" for name, place in laws.items()]
    (described / "entry_points.txt").write_text(
        "\n".join(["[stickslip_ros.friction_laws]", *lines, "", "[other]", "x = no:Thing", ""])
    )
