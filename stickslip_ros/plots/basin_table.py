"""The table of basins: the attractors, and the share of the starts that each one gets."""

from stickslip_ros.physics.measures.cycle_measures import Regime
from stickslip_ros.plots.units import Units
from stickslip_ros.studies.basin import Attractor, Basins
from stickslip_ros.studies.study import Study
from stickslip_ros.tables import TextTable


def basin_table(study: Study, basins: Basins) -> TextTable:
    """Return the attractors of a study, that with most starts first."""
    units = Units.for_drive(study.scenario.plant.as_drive())
    rows = [
        [
            attractor_name(attractor),
            units.text(attractor.amplitude, "m"),
            units.text(attractor.midpoint, "m"),
            str(attractor.count),
            f"{attractor.share:.4f}",
            f"{attractor.standard_error:.4f}",
        ]
        for attractor in basins.attractors
    ]
    headings = ["motion", "amplitude", "midpoint", "starts", "share", "standard error"]
    return TextTable(f"{study.scenario.name}, {study.plan.size} starts", headings, rows)


def attractor_name(attractor: Attractor) -> str:
    """Return what an attractor is called: its regime, and whether it is steady."""
    name = Regime.label(attractor.regime)
    return name if attractor.steady or attractor.regime is None else f"{name}, not steady"
