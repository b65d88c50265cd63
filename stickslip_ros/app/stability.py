"""`stickslip stability`: the theory of a scenario, without a simulation."""

import argparse
from typing import TYPE_CHECKING, Any, cast

from stickslip_ros.app.arguments import (
    add_json,
    add_plot,
    add_scenario,
    check_figure,
    made_of,
    scenario_of,
    write_figure,
)
from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.app.output import print_figures, print_json, print_table, progress_bar
from stickslip_ros.errors import InvalidInputError

if TYPE_CHECKING:
    from stickslip_ros.plots.units import Units
    from stickslip_ros.scenarios.files import Scenario
    from stickslip_ros.studies.stability import Notes, Section

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
"""Label and unit of each value in the table, by section."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    add_scenario(parser)
    add_plot(
        parser,
        "where the sampled loop is stable and how fast it settles, over cutoff frequency and "
        "linear gain, and the critical gain over the delay of the force",
    )
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command; return the exit status."""
    with interrupts_kept():
        from stickslip_ros.studies.stability import stability, stability_map, why_no_stability_map
    scenario = scenario_of(arguments)
    check_figure(arguments)
    if arguments.plot is not None:
        reason = why_no_stability_map(scenario)
        if reason is not None:
            raise InvalidInputError(f"--plot {arguments.plot}: there is nothing to draw: {reason}")
    with progress_bar(f"theory of {scenario.name}", None):
        found, notes = stability(scenario)
    if arguments.plot is not None:
        with progress_bar("drawing", None):
            from stickslip_ros.plots.stability_map import stability_figure

            write_figure(arguments, stability_figure(*stability_map(scenario)))
    if arguments.json:
        print_json({**found, "notes": notes, **made_of(scenario)})
    else:
        _print(scenario, found, notes)
    return 0


def _print(scenario: "Scenario", found: "Section", notes: "Notes") -> None:
    from stickslip_ros.plots.units import Units

    units = Units.for_drive(scenario.plant.as_drive())
    rows: list[list[str]] = []
    for section, labels in _LABELS.items():
        values = found[section] if section else found
        if section:
            rows.append([section.replace("_", " "), ""])
        for name, (label, unit) in labels.items():
            shown = _shown(name, values[name], unit, units)
            rows.append([f"  {label}" if section else label, shown])
    print_table(f"{scenario.name}, by theory", ["", ""], rows)
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
            print_figures(title, columns, dict.fromkeys(columns, units))
    for place, reason in notes.items():
        print(f"{place.replace('_', ' ').replace('.', ', ')}: {reason}")


def _shown(name: str, value: Any, unit: str, units: "Units") -> str:
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
