"""Arguments that several commands have."""

import argparse
import sys
from collections.abc import Collection, Generator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from stickslip_ros.app.optional_dependencies import interrupts_kept
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.namespace import DEFAULT_NAMESPACE, LONGEST_NAMESPACE
from stickslip_ros.text import printable, shown
from stickslip_ros.versions import versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip_ros.scenarios.files import Scenario

_PICTURES = (".png", ".svg", ".pdf")


def add_scenario(parser: argparse.ArgumentParser) -> Any:
    """Add SCENARIO and what modifies it; return the (exclusive) group of who controls."""
    parser.add_argument(
        "scenario",
        metavar="SCENARIO",
        help="name of a scenario that ships (paper, feed_drive), or path of a ROS parameter file",
    )
    parser.add_argument(
        "-p",
        dest="overrides",
        action="append",
        default=[],
        metavar="NODE.PARAMETER=VALUE",
        help="override a parameter, as in -p plant.belt_speed=0.2 (SI units; repeatable)",
    )
    parser.add_argument(
        "--base",
        metavar="SCENARIO",
        help="scenario to take from what a parameter file leaves out (default: the one that its "
        "section /**/scenario names)",
    )
    control = parser.add_mutually_exclusive_group()
    control.add_argument("--no-control", action="store_true", help="leave the controller out")
    return control


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add --json."""
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object and nothing else"
    )


def add_namespace(parser: argparse.ArgumentParser) -> None:
    """Add --namespace, of nodes that run."""
    parser.add_argument(
        "--namespace",
        default=DEFAULT_NAMESPACE,
        metavar="NS",
        help="ROS namespace of the nodes (default: %(default)s)",
    )


def add_network(parser: argparse.ArgumentParser, meaning: str) -> None:
    """Add --network."""
    parser.add_argument("--network", action="store_true", help=meaning)


def add_plot(parser: argparse.ArgumentParser, shown: str) -> None:
    """Add --plot, which draws what is `shown`."""
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="FILE",
        help=f"draw {shown} ({', '.join(_PICTURES)}); an existing file is replaced",
    )


def check_picture(path: Path | None) -> None:
    """Refuse what no picture can be written to, before anything is computed."""
    if path is not None:
        if path.suffix.lower() not in _PICTURES:
            raise InvalidInputError(f"--plot {path}: must end in one of {', '.join(_PICTURES)}")
        _check_writable("--plot", path)


def write_picture(path: Path, figure: "Figure") -> None:
    """Write a figure to the `path` that --plot names."""
    from stickslip_ros.plots.style import save  # half as long again to import as everything else

    with writing("--plot", path):
        save(figure, path)


def check_new(option: str, path: Path) -> None:
    """Refuse `path`, given with `option`, where there is a file, or none can be written."""
    if path.exists():
        raise InvalidInputError(f"{option} {path}: exists already, and is left as it is")
    _check_writable(option, path)


def _check_writable(option: str, path: Path) -> None:
    """Refuse `path`, given with `option`, where no file can be written, and leave it as it is."""
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"{option} {path}: there is no directory {path.parent}")
    with writing(option, path):
        if path.exists():
            path.open("ab").close()
        else:
            TemporaryFile(dir=path.absolute().parent).close()


@contextmanager
def naming(option: str) -> Generator[None]:
    """Name in a refusal the option that it is about."""
    try:
        yield
    except InvalidInputError as error:
        raise InvalidInputError(f"{option} {error}") from None


@contextmanager
def writing(option: str, path: Path) -> Generator[None]:
    """Refuse `path`, given with `option`, if the system does not let it be written."""
    try:
        yield
    except OSError as error:
        raise InvalidInputError(f"{option} {path}: cannot be written: {error.strerror}") from None


def scenario_of(
    arguments: argparse.Namespace,
    *overrides: str,
    namespace: str = DEFAULT_NAMESPACE,
    other_nodes: bool = False,
    unused: Collection[str] = (),
) -> "Scenario":
    """Return the scenario that was asked for, `overrides` applied after those given.

    Of what is left to defaults a person is told, but for what is `unused` (NODE.PARAMETER).
    """
    with interrupts_kept():
        from stickslip_ros.scenarios.files import load_scenario
        from stickslip_ros.scenarios.parameter_field import known_parameters
        from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
    control = ["plant.expects_control=false"] if arguments.no_control else []
    asked = [*arguments.overrides, *control, *overrides]
    scenario = load_scenario(
        arguments.scenario, asked, namespace, base=arguments.base, other_nodes=other_nodes
    )
    values = scenario.as_dict()
    defaults: list[str] = []
    for full_name in scenario.left_to_defaults:
        if full_name not in unused:
            node, _, name = full_name.partition(".")
            unit = known_parameters(NODE_PARAMETERS[node])[name].unit or ""
            defaults.append(f"{full_name} = {values[node][name]} {unit}".rstrip())
    if defaults:
        sentence = (
            f"{scenario.path} does not give {', '.join(defaults)}: these are the defaults; "
            "--base SCENARIO takes what is left out from another scenario"
        )
        print(printable(sentence), file=sys.stderr)
    return scenario


def made_of(scenario: "Scenario") -> dict[str, Any]:
    """Return what a result was made from, for its JSON."""
    return {
        "scenario": {"name": scenario.name, **scenario.as_dict()},
        "overrides": list(scenario.overrides),
        "versions": versions(),
    }


def namespace_of(text: str) -> str:
    """Return a ROS namespace that was given; InvalidInputError if it is none."""
    namespace = "/" + text.strip("/")
    tokens = namespace.split("/")[1:]
    if not all(token.isidentifier() and token.isascii() for token in tokens):
        raise InvalidInputError(
            f"--namespace {text!r}: must be names of letters, digits and _ joined by /"
        )
    if len(namespace) > LONGEST_NAMESPACE:
        raise InvalidInputError(
            f"--namespace {shown(text)}: has {len(namespace)} characters, and must have at most "
            f"{LONGEST_NAMESPACE}"
        )
    return namespace


def seconds(text: str) -> float:
    """Parse a time in seconds: finite, zero or more."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not (isfinite(value) and value >= 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a time in seconds, 0 or more")
    return value
