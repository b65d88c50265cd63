"""A scenario: the parameters of every node in one run, and their source."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any, Self

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_meter import CycleMeter
from stickslip_ros.measures.noise import resolved
from stickslip_ros.measures.sample_assumptions import CHANGING_KINDS, SampleAssumptions, held_range
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.scenarios.keywords import described, in_own_unit, override, parse_override, plain
from stickslip_ros.scenarios.parameters import (
    CONTROLLER_PARAMETERS,
    NODE_PARAMETERS,
    AnalyzerParameters,
    ControllerParameters,
    known_law,
)
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.tables import TextTable

FILE, BASE, OVERRIDE, DEFAULT = "file", "base", "override", "default"
"""Where the value of a parameter comes from."""


@dataclass(frozen=True, repr=False)
class Scenario:
    """The parameters of every node in one run, and their source.

    Create a scenario with `load_scenario`, and change it with `changed`.
    """

    name: str
    """Name of the scenario file without its ending."""
    overrides: tuple[str, ...]
    """Overrides, as NODE.PARAMETER=VALUE, that the values already contain."""
    plant: PlantParameters
    """Parameters of the plant node."""
    controller: ControllerParameters
    """Parameters of the controller node in use; also an attribute by the name of the node."""
    analyzer: AnalyzerParameters
    """Parameters of the analyzer node."""
    path: Path = field(compare=False)
    """The scenario file."""
    other_sections: tuple[str, ...] = ()
    """Sections of the file that match none of these nodes, such as that of a user's own node."""
    sources: Mapping[str, str] = field(default_factory=dict[str, str], compare=False, repr=False)
    """Source of each value, by NODE.PARAMETER: `FILE`, `BASE` or `OVERRIDE`; defaults are not
    listed."""
    files: Mapping[str, Path] = field(default_factory=dict[str, Path], compare=False, repr=False)
    """The file that a value is from, by NODE.PARAMETER; it is `path` or one of the `bases`."""
    other_controllers: Mapping[str, ControllerParameters] = field(
        default_factory=dict[str, ControllerParameters], compare=False, repr=False
    )
    """Parameters of other controllers that the file has sections for, by control law."""
    fit: Mapping[str, Any] = field(default_factory=dict[str, Any], compare=False, repr=False)
    """What a fit leaves open of the plant: `names`, `standard_errors`, SI units, and `correlations`
    row by row; empty without one."""
    bases: tuple[Path, ...] = field(default=(), compare=False, repr=False)
    """The files that complete the scenario file, the nearest first."""

    def __getattr__(self, name: str) -> Any:
        controller = self.__dict__.get("controller")
        if controller is not None and name == controller.node:
            return controller
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    @property
    def control_law(self) -> ControlLaw | None:
        """Control law with its constants; None without control."""
        return self.controller.control_law if self.plant.expects_control else None

    @property
    def reading(self) -> SampleAssumptions:
        """How the samples of the plant are to be read."""
        plant = self.plant
        reading = self.analyzer.reading_of(plant.flat(), plant.as_drive().fastest_belt)
        return reading._replace(varies=self._varies)

    @property
    def _varies(self) -> bool:
        """Whether belt, load, disturbance or the reference keep changing."""
        plant, controller = self.plant, self.controller
        signals: list[Any] = [plant.belt, plant.load, plant.disturbance]
        if plant.expects_control and controller.control_law.follows_reference:
            signals.append(controller.reference)
        return any(signal.kind in CHANGING_KINDS for signal in signals)

    def cycle_meter(self, cycles: int) -> CycleMeter:
        """Return what measures the motion itself.

        Parameters
        ----------
        cycles : int
            Number of the last cycles.
        """
        meter, plant = CycleMeter(cycles), self.plant
        meter.drift.resolution = step = plant.sensor.position_resolution
        meter.drift.judged = not self._varies
        meter.within = max(resolved(step), held_range(plant.actuator.resolution, plant.stiffness))
        return meter

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes: plant, the controller in use, and analyzer."""
        return "plant", self.controller.node, "analyzer"

    @property
    def given(self) -> frozenset[str]:
        """NODE.PARAMETER of each parameter that the file, its base or an override sets."""
        return frozenset(name for name in self.sources if name.partition(".")[0] in self.nodes)

    @property
    def left_to_defaults(self) -> list[str]:
        """Parameters of drive, rate and controller left at their defaults, as NODE.PARAMETER."""
        return [name for name in self.names_of_drive() if name not in self.sources]

    @property
    def gains(self) -> list[str]:
        """What of the controller belongs to a drive, gains and start, as NODE.PARAMETER."""
        names = (*self.controller.control_law.tuned, "start_after")
        return [f"{self.controller.node}.{name}" for name in names]

    @property
    def gains_of_base(self) -> list[str]:
        """Those of `gains` whose file is a more distant base than the drive's, belt speed aside."""
        order = [self.path, *self.bases]
        place = {name: order.index(path) for name, path in self.files.items()}
        drive = [f"plant.{name}" for name in self.plant.drive_names() if name != "belt_speed"]
        nearest = min((place[name] for name in drive if name in place), default=inf)
        used = self.gains if self.plant.expects_control else []
        return [n for n in used if place.get(n, 0) > nearest and self.sources[n] != OVERRIDE]

    def names_of_drive(self) -> list[str]:
        """Return the parameters of drive, rate and controller, as NODE.PARAMETER.

        Choices of a controller that are at their defaults are none of them.
        """
        names = [f"plant.{name}" for name in (*self.plant.drive_names(), "rate")]
        if self.plant.expects_control:
            controller = self.controller
            law, known = controller.control_law, controller.known
            names += [
                f"{controller.node}.{name}"
                for name in law.constants()
                if not (known[name].choices and known[name].is_default(getattr(law, name)))
            ]
        return names

    def as_dict(self) -> dict[str, dict[str, Any]]:
        """Return the values by node and flat name, such as `["plant"]["friction.static"]`."""
        return {node: getattr(self, node).flat() for node in self.nodes}

    def provenance(self) -> dict[str, Any]:
        """Return what a result was made from, for its JSON: name, parameters and overrides."""
        return {
            "scenario": {"name": self.name, **self.as_dict()},
            "overrides": list(self.overrides),
        }

    def unused(self) -> dict[str, str]:
        """Return why parameters have no effect, by NODE.PARAMETER; defaults are not listed."""
        unused = {
            f"{node}.{name}": f"{node}.{why}"
            for node in self.nodes
            for name, why in getattr(self, node).unused().items()
        }
        if not self.plant.expects_control:
            known = self.controller.known
            for name, value in self.controller.flat().items():
                if [value] != [known[name].default]:
                    name = f"{self.controller.node}.{name}"
                    unused[name] = f"{name} is not used with plant.expects_control = False"
        return unused

    def changed(self, values: Mapping[str, Any]) -> Self:
        """Return the scenario with other values of some parameters.

        Parameters
        ----------
        values : Mapping[str, Any]
            New values by NODE.PARAMETER, such as `{"plant.belt_speed": 0.03}`.

        Raises
        ------
        InvalidInputError
            If a value is out of bounds or not compatible with the others.
        """
        return self._changed(values, {})

    def overridden(self, overrides: Sequence[str], values: Mapping[str, Any] | None = None) -> Self:
        """Return the scenario with further overrides.

        Parameters
        ----------
        overrides : Sequence[str]
            Texts NODE.PARAMETER=VALUE, the value written as in a scenario file.
        values : Mapping[str, Any], optional
            Further values by NODE.PARAMETER, which act after the texts.

        Raises
        ------
        InvalidInputError
            If a name is unknown, a value is not allowed, or a parameter has no effect.
        """
        given: dict[str, Any] = {}
        for text in overrides:
            node, parameter, value = parse_override(text)
            given[f"{node}.{parameter}"] = value
        texts = [*overrides]
        for name, value in (values or {}).items():
            given[name] = in_own_unit(name, plain(value))
            texts.append(override(name, plain(value)))
        sources: dict[str, str] = {}
        for text in texts:
            node = text.partition(".")[0]
            sources[node] = f"{sources.get(node, f'{self.path} with')} {text:.80}"
        changed = self._changed(
            given, {node: f"{source}, {node}" for node, source in sources.items()}
        )
        for reason in (why for name, why in changed.unused().items() if name in given):
            raise InvalidInputError(reason)
        last = {text.partition("=")[0]: text for text in (*self.overrides, *texts)}
        return replace(
            changed,
            overrides=tuple(last.values()),
            sources={**self.sources, **dict.fromkeys(given, OVERRIDE)},
        )

    def with_controller(self, law: str) -> Self:
        """Return the scenario with another controller.

        Parameters
        ----------
        law : str
            Name of the control law. Its parameters are those of the scenario file; the others have
            their defaults, except that a force limit follows.

        Raises
        ------
        InvalidInputError
            If there is no control law of that name.
        """
        if known_law(law) == self.controller.law:
            return self
        others = {**self.other_controllers, self.controller.law: self.controller}
        controller = others.pop(law, None) or CONTROLLER_PARAMETERS[law]
        kept = tuple(o for o in self.overrides if not o.startswith(f"{self.controller.node}."))
        new = replace(self, controller=controller, other_controllers=others, overrides=kept)
        return new.with_force_limit()

    def with_force_limit(self) -> Self:
        """Return the scenario with the force limit of another controller, unless it has its own."""
        ours = f"{self.controller.node}.force_limit"
        for other in self.other_controllers.values():
            name = f"{other.node}.force_limit"
            if name in self.sources and ours not in self.sources:
                sources = {**self.sources, ours: self.sources[name]}
                return replace(self.changed({ours: other.control_law.force_limit}), sources=sources)
        return self

    def _changed(self, values: Mapping[str, Any], sources: Mapping[str, str]) -> Self:
        """Return the scenario with other values; `sources` names their source by node."""
        by_node: dict[str, dict[str, Any]] = {}
        for target, value in values.items():
            node, _, name = target.partition(".")
            by_node.setdefault(node, {})[name] = NODE_PARAMETERS[node].absolute(name, value)
        controller = self.controller.node
        changes: dict[str, Any] = {}
        for node, new in by_node.items():
            if node not in self.nodes:
                raise InvalidInputError(
                    f"{node}: is not the controller in use, which is {self.controller.node}"
                )
            changed = getattr(self, node).changed(new, sources.get(node, node))
            changes["controller" if node == controller else node] = changed
        return replace(self, **changes)

    def __repr__(self) -> str:
        return "\n".join(self._table().lines())

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> TextTable:
        """Return the parameters of the drive and its controller, and others that are given."""
        shown, values = self.names_of_drive(), self.as_dict()
        shown += sorted(self.given.difference(shown))
        dimensionless = self.plant.as_drive().is_dimensionless
        rows: list[list[str]] = []
        for full_name in shown:
            node, _, name = full_name.partition(".")
            value, known = values[node][name], described(full_name)
            text = f"{value:.10g}" if isinstance(value, float) else str(value)
            text = known.unset if text == "nan" else text
            unit = "" if dimensionless else known.unit or ""
            note = "" if full_name in self.given else "default"
            rows.append([full_name, f"{text} {unit}".rstrip(), note])
        title = f"scenario {' '.join([self.name, *self.overrides])}"
        return TextTable(title, ["", "", ""], rows)
