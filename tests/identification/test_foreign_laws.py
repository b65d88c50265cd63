"""Friction laws of other packages are identified by their adapters, or refused with the reason."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from benchmarks import identification as study
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.foreign_laws import foreign_adapter
from stickslip_ros.identification.identify import identify
from stickslip_ros.model.friction import LAWS
from stickslip_ros.scenarios.foreign_laws import ADAPTERS, add_laws_of_other_packages
from tests.scenarios.foreign_laws import write_example, write_package

_ADAPTER = """
import numpy as np
from stickslip_ros.identification.identified_law import IdentifiedLaw

class Straight(IdentifiedLaw):
    name = "linear"
    least = 0.0, 0.0
    coordinates = "static", "slope"
    smallest = "static"

    def terms(self, speed, shape):
        return np.column_stack([np.ones_like(speed), -speed])

    def coordinates_of(self, forces, shape):
        return dict(zip(self.coordinates, forces))
"""


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return a directory of the path whose packages are found."""
    laws = dict(LAWS)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    LAWS.clear()
    LAWS.update(laws)
    for name in ("bad", "hess_soom"):
        sys.modules.pop(name, None)


def test_the_law_of_the_example_is_identified(
    packages: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_example(packages, "own_friction_law")
    add_laws_of_other_packages()
    kind: Any = LAWS["hess_soom"]
    law = kind(static=0.3037, kinetic=0.1519, decay_speed=0.0203, viscous=0.407)
    monkeypatch.setitem(study.LAWS, law.name, law)
    log = study.record(law.name, "ramp", seed=7, duration=2.5)
    found = identify([log], law.name, {"normal_force": study.NORMAL_FORCE})
    true = study.truth(law.name, "ramp")
    fitted = {name for name in found.fitted if name.startswith("friction.")}
    assert {f"friction.{name}" for name in law.constants()} == fitted
    for name, each in found.fitted.items():
        assert abs(each.value - true[name]) < 4.0 * each.standard_error, name
        assert each.standard_error < 0.01 * true[name], name
    fixed = {"normal_force": study.NORMAL_FORCE, "friction.decay_speed": 0.0203}
    assert "friction.decay_speed" not in identify([log], law.name, fixed).fitted


@pytest.mark.parametrize(
    ("entry", "old", "new", "reason"),
    [
        ("linear = bad:Missing", "", "", "cannot be imported: AttributeError: "),
        ("linear = bad:np", "", "", "is no class derived from IdentifiedLaw"),
        ("linear = bad:IdentifiedLaw", "", "", "has the name None in its class and 'linear' in"),
        ("other = bad:Straight", "", "", "has the name 'linear' in its class and 'other' in its"),
        ("other = bad:Straight", "linear", "other", "has no friction law other: no package"),
        ("linear = bad:Straight", "least = 0.0, 0.0", "__init__ = 1", "fails with its defaults"),
    ],
)
def test_what_is_refused(packages: Path, entry: str, old: str, new: str, reason: str) -> None:
    name, _, place = entry.partition(" = ")
    write_package(
        packages,
        "bad",
        {"bad": _ADAPTER.replace(old, new) if old else _ADAPTER},
        {name: place},
        ADAPTERS,
    )
    importlib.invalidate_caches()
    with pytest.raises(InvalidInputError) as refusal:
        foreign_adapter(name)
    text = str(refusal.value)
    assert text.startswith(f"law {name} is refused: {place} of package bad ")
    assert reason in text
    assert "\n" not in text
