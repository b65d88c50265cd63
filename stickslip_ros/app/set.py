"""`stickslip set`: parameters of nodes that run."""

import argparse
from typing import Any

from stickslip_ros.app.arguments import add_namespace, add_network, namespace_of
from stickslip_ros.app.optional_dependencies import loading_ros
from stickslip_ros.app.output import tell
from stickslip_ros.errors import InvalidInputError, RunError
from stickslip_ros.text import printable, shown


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        "Set parameters of the plant, the controller or the analyzer while they run. All "
        "values for one node are set together, or none. A node refuses what is out of bounds, and "
        "what cannot be changed in its present state."
    )
    parser.add_argument(
        "assignments",
        nargs="+",
        metavar="NODE.PARAMETER=VALUE",
        help="parameter and value, as in plant.belt_speed=0.03 (SI units, or 30mm/s)",
    )
    add_namespace(parser)
    add_network(parser, "reach nodes on other machines, too (default: loopback only)")


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.scenarios.keywords import parse_override
    from stickslip_ros.scenarios.parameters import NODE_PARAMETERS

    namespace = namespace_of(arguments.namespace)
    given: dict[str, dict[str, Any]] = {}
    for assignment in arguments.assignments:
        node, name, value = parse_override(assignment)
        try:
            NODE_PARAMETERS[node].check_bounds(name, value)
        except InvalidInputError as error:
            raise InvalidInputError(f"{node}.{error}") from None
        given.setdefault(node, {})[name] = value
    with loading_ros():
        from stickslip_ros.nodes.base.clients import NodeNotFoundError, set_parameters
        from stickslip_ros.nodes.base.network import keep_on_this_machine

        keep_on_this_machine(arguments.network)
    try:
        answers = set_parameters(namespace, given)
    except NodeNotFoundError as error:
        raise RunError(
            f"{error}: `stickslip run` starts the nodes, --namespace names another namespace"
        ) from None
    refusals: list[str] = []
    for node, answer in answers.items():
        if not answer.successful:
            refusals.append(answer.reason or "refused without a reason")
            continue
        known = NODE_PARAMETERS[node].known
        for name, value in given[node].items():
            set_to = f"{namespace}/{node}: {name} = {shown(value)} {known[name].unit or ''}"
            print(printable(set_to.rstrip()))
        if answer.reason:
            tell(answer.reason)
    if refusals:
        raise InvalidInputError("; ".join(refusals))
