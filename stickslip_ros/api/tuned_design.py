"""Gains of any control law by one rule, with margins, Bode figure and simulated checks."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np
from typing_extensions import override

from stickslip_ros.api.results import (
    Parts,
    Summary,
    Table,
    TabularResult,
    attributes,
)
from stickslip_ros.physics.model.constants import constants_of
from stickslip_ros.physics.model.control import ControlLaw
from stickslip_ros.quantities import Quantity
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.show.parameter_tables import scenario_tables
from stickslip_ros.show.quantities import Units
from stickslip_ros.studies.case_outcome import OUTCOMES
from stickslip_ros.studies.tuned_design import TunedDesign
from stickslip_ros.tables import TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip_ros.show.style import FigureStyle

_SHOWN = ("held", "rms_velocity", "mean_force", "rms_force", "peak_force", "settling_time")
_LINEAR: Mapping[str, Quantity] = {
    "decay_rate": Quantity("smallest decay rate", "1/s"),
    "delay_margin": Quantity("delay margin", "s"),
    "phase_margin": Quantity("phase margin", "rad"),
    "gain_down": Quantity("lower gain margin"),
    "gain_up": Quantity("upper gain margin"),
    "sensitivity_peak": Quantity("peak of the sensitivity"),
    "peak_force": Quantity("peak force by step, mean friction and noise", "N"),
    "noise_force": Quantity("rms force by noise", "N"),
}


@dataclass(frozen=True, eq=False, repr=False)
class TunedProposal(TabularResult):
    """Gains by the rule; it prints as tables, and draws the loop transfer function."""

    design: TunedDesign
    """The gains and their checks."""

    @property
    def controller(self) -> ControlLaw:
        """The law with the proposed gains."""
        return self.design.tuned.law

    @property
    def scenario(self) -> Scenario:
        """The scenario with the proposed gains, ready to be simulated."""
        return self.design.scenario

    @property
    def remark(self) -> str | None:
        """What of the goal is missed, and where the simulation does not hold, or None."""
        return self.design.remark

    @property
    def poles(self) -> Mapping[float, Any]:
        """Poles of the linear part of the loop per sample, by belt speed; complex arrays."""
        return self.design.tuned.poles

    @override
    def draw(self, style: "FigureStyle") -> "Figure":
        from stickslip_ros.show.comparison_figure import bode_figure

        return bode_figure(self.design, style=style)

    @property
    def _checks(self) -> list[dict[str, Any]]:
        return [
            {
                "belt_speed": check.belt_speed,
                "disturbance": str(check.disturbance),
                **{name: getattr(check.outcome, name) for name in _SHOWN},
                "reason": check.outcome.reason,
            }
            for check in self.design.checks
        ]

    @override
    def _table(self) -> Table:
        known = {"belt_speed": Quantity("belt speed", "m/s"), **{n: OUTCOMES[n] for n in _SHOWN}}
        columns = {
            name: np.array([nan if row[name] is None else float(row[name]) for row in self._checks])
            for name in known
        }
        texts = [row["disturbance"] for row in self._checks]
        columns["disturbance"] = np.array(texts, dtype=object)
        quantities = {**known, "disturbance": Quantity("disturbance")}
        units = Units.for_drive(self.scenario.plant.as_drive())
        dimensions = {"check": range(len(texts))}
        return Table(columns, quantities, units, dimensions, attributes(self.scenario))

    @override
    def _entries(self) -> dict[str, Any]:
        found = self.design.tuned
        return {
            "law": found.law.name,
            "belt_speeds": list(self.design.belt_speeds),
            "constants": asdict(found.law),
            "linear": {name: getattr(found, name) for name in _LINEAR},
            "checks": self._checks,
            "parameter_file": self.design.parameter_file,
            "remark": self.remark,
            **self.scenario.provenance(),
        }

    @override
    def parts(self) -> Parts:
        found, units = self.design.tuned, Units.for_drive(self.scenario.plant.as_drive())
        speeds = units.texts(sorted({*self.design.belt_speeds}), "m/s")
        described = constants_of(type(found.law))
        rows = [
            [name, units.text(getattr(found.law, name), described[name].unit or "")]
            for name in found.law.tuned
        ]
        title = f"{self.scenario.name}, {found.law.name}, belt speed {' to '.join(speeds)}"
        yield TextTable(title, ["proposal", ""], rows)
        rows = [[q.label, units.text(getattr(found, n), q.unit)] for n, q in _LINEAR.items()]
        yield TextTable("linear loop, at the worst of these belt speeds", ["", ""], rows)
        headings = ["belt speed", "disturbance", *(OUTCOMES[name].label for name in _SHOWN)]
        rows = [
            [
                units.text(row["belt_speed"], "m/s"),
                row["disturbance"],
                "yes" if row["held"] else "no",
                *(units.text(row[name], OUTCOMES[name].unit) for name in _SHOWN[1:]),
            ]
            for row in self._checks
        ]
        yield TextTable("simulated", headings, rows)
        if self.remark is not None:
            yield self.remark

    @override
    def _summary(self) -> Summary:
        held = sum(bool(check.outcome.held) for check in self.design.checks)
        verdict = f"{held} of {len(self.design.checks)} simulated checks hold"
        parameters = scenario_tables(self.scenario, used=True)
        return Summary("Controller design", self.scenario.name, verdict, parameters)
