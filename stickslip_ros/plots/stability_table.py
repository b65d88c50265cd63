"""The tables of what theory says of a scenario."""

from collections.abc import Iterator
from typing import Any, cast

from stickslip_ros.plots.measure_table import measure_table
from stickslip_ros.plots.units import Units
from stickslip_ros.scenarios.files import Scenario
from stickslip_ros.studies.stability import Notes, Section
from stickslip_ros.tables import TextTable

_LABELS: dict[str, dict[str, tuple[str, str]]] = {
    "": {"equilibrium_position": ("equilibrium position", "m")},
    "open_loop": {
        "eigenvalues": ("eigenvalues", "1/s"),
        "stable": ("stable", ""),
        "hopf_speeds": ("Hopf speeds", "m/s"),
        "hopf_angular_frequencies": ("angular frequency there", "rad/s"),
        "crossing_speeds": ("crossing speed of the eigenvalues", "1/m"),
        "first_lyapunov_coefficients": ("first Lyapunov coefficient", ""),
    },
    "sticking": {
        "onset_speed_approximate": ("onset of sticking, by averaging", "m/s"),
        "onset_speed": ("onset of sticking, exactly", "m/s"),
        "speed_ranges": ("belt speeds that stick", "m/s"),
    },
    "closed_loop": {
        "eigenvalues": ("eigenvalues", "1/s"),
        "stable": ("stable", ""),
        "hopf_speeds": ("Hopf speeds", "m/s"),
        "crossing_speeds": ("crossing speed of the eigenvalues", "1/m"),
        "first_lyapunov_coefficients": ("first Lyapunov coefficient", ""),
        "critical_linear_gain": ("critical linear gain", "N s/m"),
        "first_lyapunov_coefficient": ("first Lyapunov coefficient there", ""),
        "critical_cubic_gain": ("critical cubic gain", "N s^3/m^3"),
    },
    "sampled_loop": {
        "spectral_radius": ("spectral radius", ""),
        "stable": ("stable", ""),
        "decay_rate": ("decay rate", "1/s"),
        "settling_time": ("1 % settling time", "s"),
        "critical_linear_gain": ("critical linear gain", "N s/m"),
        "stable_linear_gains": ("stable linear gains", "N s/m"),
    },
}
"""What the figures of each section are called in the table, and their unit."""


def stability_tables(scenario: Scenario, found: Section, notes: Notes) -> Iterator[TextTable | str]:
    """Yield the tables of what `stability` has found, and its notes."""
    units = Units.for_drive(scenario.plant.as_drive())
    rows: list[list[str]] = []
    for section, labels in _LABELS.items():
        figures = found[section] if section else found
        if section:
            rows.append([section.replace("_", " "), ""])
        for name, (label, unit) in labels.items():
            shown = _shown(name, figures[name], unit, units)
            rows.append([f"  {label}" if section else label, shown])
    yield TextTable(f"{scenario.name}, by theory", ["", ""], rows)
    for loop in ("open_loop", "closed_loop"):
        cycles: list[Section] = found[loop]["limit_cycles"]
        if cycles:
            columns = {
                f"{number}, {'stable' if cycle['stable'] else 'unstable'}": {
                    **cycle, "multipliers": _complex(cycle["multipliers"], ""),
                }
                for number, cycle in enumerate(cycles, 1)
            }  # fmt: skip
            title = f"limit cycles, {loop.replace('_', ' ')}"
            yield measure_table(title, columns, dict.fromkeys(columns, units))
    for place, reason in notes.items():
        yield f"{place.replace('_', ' ').replace('.', ', ')}: {reason}"


def _shown(name: str, value: Any, unit: str, units: Units) -> str:
    if value is None or not isinstance(value, list):
        return units.texts([value], unit, digits=8 if name == "spectral_radius" else 4)[0]
    items = cast(list[Any], value)
    if name == "eigenvalues":
        return _complex(items, units.of_unit(unit))
    if name in ("stable_linear_gains", "speed_ranges"):
        return "; ".join(" to ".join(units.texts(ends, unit)) for ends in items) or "-"
    return ", ".join(units.texts(items, unit)) or "-"


def _complex(pairs: list[list[float]], unit: str) -> str:
    """Return complex numbers given as [real, imaginary], of a conjugate pair once."""
    texts = [
        f"{real:.4g} ± {imaginary:.4g}j" if imaginary else f"{real:.4g}"
        for real, imaginary in pairs
        if imaginary >= 0.0
    ]
    return f"{', '.join(texts)} {unit}".rstrip()
