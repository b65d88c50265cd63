"""Recorded runs: the samples in a bag or a table, and their measures."""

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.api.page import Summary
from stickslip_ros.api.results import Drawing, Parts, Result, Table, TabularResult
from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.measures.cycle_measures import Measures, measures_of
from stickslip_ros.measures.slips import SlipThreshold
from stickslip_ros.model.control import ControlLaw
from stickslip_ros.model.drive import Drive
from stickslip_ros.motion.trajectory import MotorTrajectory
from stickslip_ros.quantities import Quantity, quantities_of
from stickslip_ros.record.bag_files import runs_of
from stickslip_ros.record.bag_layout import BagLayout
from stickslip_ros.record.reader import Recording
from stickslip_ros.record.report import report_of_recording
from stickslip_ros.record.table_columns import TableFormat
from stickslip_ros.record.table_file import is_table
from stickslip_ros.samples import NO_FORCES, NO_SAMPLES, ForceColumns, SampleColumns
from stickslip_ros.scenarios.curve_file import CURVES, as_pairs
from stickslip_ros.scenarios.parameters import NODE_PARAMETERS
from stickslip_ros.scenarios.plant_parameters import PlantParameters
from stickslip_ros.show.measure_table import (
    doubt,
    measure_table,
    measures_text,
    report_sentences,
    slip_table,
)
from stickslip_ros.show.parameter_tables import recorded_tables
from stickslip_ros.show.quantities import Units
from stickslip_ros.show.run_history import DrawnRun, RunHistory
from stickslip_ros.stamps import NANOSECONDS
from stickslip_ros.tables import TextTable

_COLUMNS = quantities_of(MotorTrajectory) | {"stamp": Quantity("stamp", "ns")}


@dataclass(frozen=True, eq=False, repr=False)
class RecordedRun(TabularResult):
    """A recorded run, or a part of it; it prints as a table of its measures."""

    path: Path
    """The bag, or the table."""
    samples: SampleColumns
    """Joint states: stamps and the motion, as numpy arrays."""
    forces: ForceColumns
    """Control forces, each with the stamp of the sample that it answers."""
    report: Mapping[str, Any]
    """Measures, counts and completeness, as `stickslip report --json` has them."""
    drive: Drive | None
    """The drive whose parameters were recorded; None if the bag does not hold them."""
    _history: RunHistory
    """The data of the figure."""
    _is_table: bool
    """Whether it is a table, which has no parameters."""
    _namespace: str | None
    """ROS namespace of the drive, where a bag holds several."""
    _rotary: bool = False
    """Whether the displacement is an angle."""

    @property
    def units(self) -> Units:
        """Units in which the run is shown."""
        return Units.for_drive(self.drive, rotary=self._rotary)

    @property
    def measures(self) -> Measures:
        """Amplitude, regime and the other measures of the last cycles."""
        return measures_of(self.report)

    @property
    def missing(self) -> list[str]:
        """Sentences on the parts that are missing in the bag."""
        return self.report["missing"]

    def as_drawn(self) -> DrawnRun:
        """Return what figures draw of the run."""
        notes, title = [*self.missing, *self.report["notes"]], f"Recorded run, {self.path}"
        parts = self._history, self.measures, self.drive, notes, title
        return DrawnRun(str(self.path), *parts, rotary=self._rotary)

    @property
    def verdict(self) -> str:
        """Regime, amplitude, frequency and stick fraction as a line of text."""
        return measures_text(self.measures, self.units) + doubt(self.report)

    @cached_property
    def _recorded(self) -> dict[str, Mapping[str, str]]:
        """The parameters and versions that were recorded, by node and name."""
        if self._is_table:
            return {}
        with Recording(self.path, self._namespace) as recording:
            names = [*NODE_PARAMETERS, "versions"]
            settings = {name: recording.metadata(f"stickslip_ros/{name}") for name in names}
        return {name: texts for name, texts in settings.items() if texts}

    def settings(self) -> Iterator[TextTable]:
        """Yield the tables of the parameters and versions that were recorded."""
        yield from recorded_tables(self._recorded, self.units)

    def _facts(self) -> dict[str, str]:
        """Return what a page says first, as far as the drive and its law were recorded."""
        from stickslip_ros.api.runs import loop_facts

        forces = self.report["peak_force"], self.report["resting_force"]
        plant = None if self._is_table else recorded_plant(self.path, self._namespace)
        law: ControlLaw | None = None
        for node in [name for name in self._recorded if name.endswith("_controller")]:
            with suppress(ValueError, RecursionError, InvalidInputError):
                values = {name: json.loads(text) for name, text in self._recorded[node].items()}
                controller = NODE_PARAMETERS[node].changed(values, node)
                law = getattr(controller, "control_law", None)
        if plant is not None and (law is not None or not plant.expects_control):
            return loop_facts(plant, law if plant.expects_control else None, *forces)
        peak, last = self.units.texts(forces, "N")
        return {} if forces[0] is None else {"control force": f"at most {peak}, {last} at the end"}

    @override
    def _summary(self) -> Summary:
        from stickslip_ros.api.runs import sentence

        verdict, facts = sentence(self.verdict), self._facts()
        return Summary("Recorded run", str(self.path), verdict, self.settings(), facts)

    @override
    def _drawing(self) -> Drawing:
        return Comparison((self,)).draw

    def _table(self) -> Table:
        samples = self.samples
        first = int(samples.stamp[0]) if len(samples) else 0
        time = (samples.stamp - first) / NANOSECONDS
        columns = {**vars(samples), "time": time, "control_force": _answers(samples, self.forces)}
        if not samples.has_motor:
            columns = {name: column for name, column in columns.items() if "motor" not in name}
        units, source = self.units, {"bag": str(self.path)}
        return Table(columns, _COLUMNS, units, {"time": time}, source, "time")

    @override
    def _entries(self) -> dict[str, Any]:
        return {**self.report, "bag": str(self.path)}

    @override
    def parts(self) -> Parts:
        return Comparison((self,)).parts()


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result):
    """Recorded runs side by side."""

    runs: tuple[RecordedRun, ...]
    """The runs."""

    @override
    def _drawing(self) -> Drawing:
        from stickslip_ros.show.run_figure import run_figure

        return partial(run_figure, *(run.as_drawn() for run in self.runs))

    @override
    def _entries(self) -> dict[str, Any]:
        reports = [run.to_dict() for run in self.runs]
        for report in reports:
            del report["versions"]
        return {"reports": reports}

    @override
    def _summary(self) -> Summary:
        verdicts = {str(run.path): run.verdict for run in self.runs}
        verdict = "; ".join(f"{path}: {text}" for path, text in verdicts.items())
        parameters = [
            table._replace(title=str(run.path)) for run in self.runs for table in run.settings()
        ]
        return Summary("Recorded runs compared", ", ".join(verdicts), verdict, parameters)

    @override
    def parts(self) -> Parts:
        several = len(self.runs) > 1
        runs = {str(run.path) if several else "": run for run in self.runs}
        title = "" if several else str(self.runs[0].path)
        reports = {name: run.report for name, run in runs.items()}
        yield measure_table(title, reports, {name: run.units for name, run in runs.items()})
        for name, run in runs.items():
            if run.report["slips"] is not None:
                yield slip_table(run.report["slips"], run.units)
            for text in report_sentences(run.report, run.drive):
                yield f"{name}: {text}" if several else text


def read_bag(
    path: Path | str,
    *continued: Path | str,
    start: float = 0.0,
    end: float = float("inf"),
    namespace: str | None = None,
    belt_speed: float | None = None,
    joint: str | None = None,
    belt_joint: str | None = None,
    states_topic: str | None = None,
    force_topic: str | None = None,
    time: str = "header",
    force: str = "topic",
    rotary: bool = False,
    slips: SlipThreshold | None = None,
) -> RecordedRun:
    """Read a recorded run, and measure it.

    Parameters
    ----------
    path : Path or str
        Bag directory or one MCAP file, also one that is being recorded, cut off or damaged.
    *continued : Path or str
        Bags that continue the run, `path` with _2 and so on behind it, as an analyzer writes them
        that was restarted with `bag_exists: next`.
    start, end : float
        Part to read, s from the first sample.
    namespace : str, optional
        ROS namespace of the drive, such as `/feed_drive`, where a bag holds several.
    belt_speed : float, optional
        Belt speed, m/s, of a bag whose joint states have no belt.
    joint, belt_joint : str, optional
        Joints of the joint states that are the slide and the belt. By default these are `slide` and
        `belt`, or the only joint is the slide.
    states_topic, force_topic : str, optional
        Topics of joint states and of forces: wrenches, numbers, arrays or joint commands.
        `/commands[2]` is the second number of an array, `/joint_states[2]` the second of two
        sources that take turns.
    time : str, optional
        `"header"`, the stamps in the messages, or `"log"`, the times of the recorder.
    force : str, optional
        `"topic"`, or `"effort"`: the force is the effort of the joint.
    rotary : bool, optional
        Whether displacements are angles, rad, and forces torques, N m: they are shown as such.
    slips : SlipThreshold, optional
        What counts as a slip; by default slips are not looked for.

    Returns
    -------
    RecordedRun
        Samples, forces and measures.

    Raises
    ------
    BagError
        If `path` is not a bag, or holds neither joint states nor control forces.
    InvalidInputError
        If the part is empty, or a bag does not continue the run.

    Examples
    --------
    >>> import stickslip_ros as ss
    >>> recorded = ss.read_bag("bags/reference")
    >>> recorded.measures.regime.value, f"{recorded.measures.amplitude:.2e}"
    ('stick_slip', '3.26e-04')
    """
    runs = runs_of(map(Path, (path, *continued)))
    if len(runs) > 1:
        raise InvalidInputError(f"{[*runs][1]} does not continue the run in {path}")
    return recorded_run(
        Path(path),
        table=False,
        continued=runs[Path(path)],
        start=start,
        end=end,
        namespace=namespace,
        belt_speed=belt_speed,
        layout=BagLayout(joint, belt_joint, states_topic, force_topic, time, force),
        rotary=rotary,
        slips=slips,
    )


def read_table(
    path: Path | str,
    columns: Mapping[str, str] | None = None,
    *,
    start: float = 0.0,
    end: float = float("inf"),
    stick_speed: float | None = None,
    belt_speed: float | None = None,
    rotary: bool = False,
    slips: SlipThreshold | None = None,
    decimal: str | None = None,
    skip: int | None = None,
    encoding: str | None = None,
    period: float | None = None,
    where: str | None = None,
    session: int | None = None,
    second: Path | str | None = None,
    shift: float = 0.0,
    force_constant: str | None = None,
    pitch: float | None = None,
) -> RecordedRun:
    """Read a run from a table as text, such as a CSV file, or a MAT file, and measure it.

    Parameters
    ----------
    path : Path or str
        The file. MAT files of version 7.3 need h5py.
    columns : mapping, optional
        Where the file has `time`, `position`, `velocity`, `force`, `belt_velocity` and
        `friction_force`: columns and numbers with + - * /, brackets and `unwrap(column, turn)`,
        in SI units. What has no number in it is converted, if the table has its unit. By default it
        is a file of `stickslip simulate --out`.
    start, end : float
        Part to read, s from the first sample.
    stick_speed : float, optional
        Largest relative speed of a slide that sticks, m/s, for samples without noise. By default
        the noise is found from the samples.
    belt_speed : float, optional
        Belt velocity, m/s, in place of a column.
    rotary : bool, optional
        Whether displacements are angles, rad, and forces torques, N m: they are shown as such.
    slips : SlipThreshold, optional
        What counts as a slip; by default slips are not looked for.
    decimal, skip, encoding : optional
        Decimal mark, number of lines on top, and encoding of a text; found by default.
    period, where, session : optional
        Time from row to row of a table without times, s, found by default in a line above them;
        rows that are read, as in `"joint_name=elbow"`; which session, from 1, if time starts again.
    second, shift : optional
        Another table of the same run, whose columns are `2:NAME`; what is added to the times of
        columns that have times of their own, s.
    force_constant, pitch : optional
        The force is a current: force constant of a linear motor, as `"50N/A"`, or torque constant,
        as `"0.35Nm/A"`, of a motor that turns a screw with this pitch, m, or a rotary axis.

    Returns
    -------
    RecordedRun
        Samples, forces and measures.

    Raises
    ------
    BagError
        If the file cannot be read.
    InvalidInputError
        If a column is not there, or the part is empty.

    Examples
    --------
    >>> import tempfile
    >>> import stickslip_ros as ss
    >>> log = ss.simulate("feed_drive", duration=1.0).to_pandas().reset_index()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log.to_csv(f"{folder}/log.csv", index=False)
    ...     run = ss.read_table(f"{folder}/log.csv", {"time": "time", "position": "position",
    ...         "velocity": "velocity", "belt_velocity": "0.04"})
    >>> run.measures.regime.value, round(1e6 * run.measures.amplitude)
    ('stick_slip', 434)
    """
    return recorded_run(
        Path(path),
        table=True,
        columns=columns,
        start=start,
        end=end,
        stick_speed=stick_speed,
        belt_speed=belt_speed,
        rotary=rotary,
        slips=slips,
        decimal=decimal,
        skip=skip,
        encoding=encoding,
        period=period,
        where=where,
        session=session,
        second=None if second is None else Path(second),
        shift=shift,
        force_constant=force_constant,
        pitch=pitch,
    )


def recorded_run(
    path: Path,
    *,
    table: bool | None = None,
    namespace: str | None = None,
    kept: bool = True,
    drawn: bool = True,
    rotary: bool = False,
    **options: Any,
) -> RecordedRun:
    """Return the run that `report_of_recording` measures with these options, or `with_forms`.

    Its samples need not be `kept`; a run that is not to be `drawn` is measured faster.
    """
    given = with_forms({**options, "rotary": rotary})
    history, taken = RunHistory(), list[SampleColumns | ForceColumns]()
    if kept:
        given["take"] = taken.append
    table = is_table(path) if table is None else table
    drive = None if table else recorded_drive(path, namespace)
    unit = "" if Units.for_drive(drive).dimensionless else "m"
    report = report_of_recording(
        path,
        table=table,
        namespace=namespace,
        length="rad" if rotary else unit,
        observer=history if drawn else None,
        **given,
    )
    samples = NO_SAMPLES.followed_by(*(t for t in taken if isinstance(t, SampleColumns)))
    forces = NO_FORCES.followed_by(*(t for t in taken if isinstance(t, ForceColumns)))
    return RecordedRun(path, samples, forces, report, drive, history, table, namespace, rotary)


def with_forms(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return options in which those of a `TableFormat` and a `BagLayout` are `form` and `layout`.

    Raises InvalidInputError if one of them is not allowed.
    """
    others = dict(options)
    if others.get("second") is not None:
        others["second"] = Path(others["second"])
    for name, kind in (("form", TableFormat), ("layout", BagLayout)):
        given = {part.name: others.pop(part.name) for part in fields(kind) if part.name in others}
        others |= {name: kind(**given)} if given else {}
    return others


def recorded_drive(bag: Path, namespace: str | None = None) -> Drive | None:
    """Return the drive of `recorded_plant`."""
    plant = recorded_plant(bag, namespace)
    return None if plant is None else plant.as_drive()


def recorded_plant(bag: Path, namespace: str | None = None) -> PlantParameters | None:
    """Return the parameters of a plant that were recorded, None where they are not or not all.

    A table has none.
    """
    if is_table(bag):
        return None
    with Recording(bag, namespace) as recording:
        texts = recording.metadata("stickslip_ros/plant") or {}
        curves = recording.metadata(CURVES) or {}
    try:
        values = {
            name: json.loads(text)
            for name, text in texts.items()
            if name in PlantParameters().known
        }
        known = {path: as_pairs(json.loads(text)) for path, text in curves.items()}
        named = {value for name, value in values.items() if name.endswith(".file") and value}
        if not named <= known.keys():
            return None  # a bag must not have other files of its reader read
        plant = PlantParameters().changed(values, str(bag), known)
    except (ValueError, RecursionError, InvalidInputError):
        return None
    return plant if values.keys() >= set(plant.drive_names()) else None


def _answers(samples: SampleColumns, forces: ForceColumns) -> FloatArray:
    """Return the last force that answers each sample, NaN where none does."""
    answers = np.full(len(samples), np.nan)
    if len(forces):
        order = np.argsort(forces.stamp, kind="stable")
        stamps = forces.stamp[order]
        last = np.searchsorted(stamps, samples.stamp, "right") - 1
        answered = (last >= 0) & (stamps[last] == samples.stamp)
        answers[answered] = forces.force[order][last[answered]]
    return answers
