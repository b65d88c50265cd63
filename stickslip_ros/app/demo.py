"""`make demo`: a controller suppresses the vibration of a feed drive, over ROS topics."""

import sys

from stickslip_ros.app.optional_dependencies import load_matplotlib, loading_ros
from stickslip_ros.app.output import print_parts
from stickslip_ros.app.run import default_bag, record
from stickslip_ros.errors import StickslipError
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.scenarios.files import load_scenario
from stickslip_ros.show.measure_table import measure_table

_SCENARIO = "feed_drive"
_DURATION = 10.0
_VALUES = (
    "amplitude",
    "midpoint",
    "stick_fraction",
    "frequency",
    "regime",
    "trend",
    "peak_force",
    "resting_force",
)


def main() -> None:
    """Run the demonstration and exit with its status."""
    try:
        _demonstrate()
    except (OSError, StickslipError) as error:
        sys.exit(f"demo: {error}")
    except KeyboardInterrupt:
        sys.exit(130)


def _demonstrate() -> None:
    scenario = load_scenario(_SCENARIO, ["plant.pace=lockstep", f"plant.duration={_DURATION}"])
    switched_on = scenario.controller.control_law.start_after
    controller = scenario.controller.node.replace("_", " ")
    bag = default_bag(_SCENARIO)
    load_matplotlib()
    from stickslip_ros.api.recordings import recorded_run
    from stickslip_ros.show.style import SCREEN, save

    with loading_ros():
        from stickslip_ros.nodes.base.network import keep_on_this_machine

        reach = keep_on_this_machine(network=False)
    print(
        f"{_DURATION:g} s of {_SCENARIO} in lockstep: plant, {controller} and analyzer as "
        f"ROS 2 nodes, {reach}; the controller acts from {switched_on:g} s on"
    )
    results, interrupted = record(scenario, bag, composed=True)
    if interrupted:
        raise KeyboardInterrupt
    parts = {
        f"before ({switched_on:g} s)": report_of_recording(bag, end=switched_on),
        f"after ({_DURATION - switched_on:g} s)": report_of_recording(bag, start=switched_on),
    }
    title = (
        f"{results['samples']} samples, {results['lost_samples']} lost, "
        f"{results['steps_per_second']:.0f} steps per second"
    )
    chosen = {when: {name: part[name] for name in _VALUES} for when, part in parts.items()}
    print_parts(measure_table(title, chosen))
    figure = bag.with_suffix(".png")
    save(recorded_run(bag, kept=False).draw(SCREEN), figure)
    print(f"bag:    {bag}\nfigure: {figure}")


if __name__ == "__main__":
    main()
