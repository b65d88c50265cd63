"""Identification: a model of a drive from recordings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from typing_extensions import override

from stickslip_ros.api.page import Summary
from stickslip_ros.api.recordings import with_forms
from stickslip_ros.api.results import Drawing, Parts, Result
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification import sentences
from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.fit import Estimate
from stickslip_ros.identification.identify import AUTO, AUTO_TIME, constants
from stickslip_ros.identification.identify import identify as identify_records
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.recordings import read_all, read_records
from stickslip_ros.identification.scenario import written_scenario
from stickslip_ros.model.drive import Drive
from stickslip_ros.record.bag_layout import BagLayout
from stickslip_ros.record.table_columns import TableFormat
from stickslip_ros.scenarios.files import Scenario, load_scenario
from stickslip_ros.show.identification_table import identification_tables
from stickslip_ros.show.quantities import SI, Units


@dataclass(frozen=True, eq=False, repr=False)
class Model(Result):
    """A model that was fitted to recordings; it prints as the tables of `stickslip identify`."""

    findings: Findings
    """All that was found: candidates, curves, correlations, errors."""
    predicted: Mapping[str, Record] = field(default_factory=dict[str, Record])
    """Recordings that are not fitted, of which the result says what it predicts, by name."""
    _units: Units = SI
    """Units in which it is shown."""

    @property
    def law(self) -> str:
        """Friction law."""
        return self.findings.law

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Value, standard error and 95 % interval by parameter, such as `plant.mass`; SI units."""
        return {f"plant.{name}": estimate for name, estimate in self.findings.fitted.items()}

    @cached_property
    def unidentified(self) -> dict[str, str]:
        """Why a parameter is not identifiable, and the run that would identify it, by parameter."""
        reasons = sentences.unidentified(self.findings)
        return {f"plant.{name}": why for name, why in reasons.items()}

    @property
    def drive(self) -> Drive:
        """The drive."""
        return self.findings.drive

    def check(
        self, recording: Path | str, columns: Mapping[str, str] | None = None, **options: Any
    ) -> dict[str, float | None]:
        """Return what the model predicts of a recording.

        Parameters
        ----------
        recording : Path or str
            A bag or a table.
        columns : mapping, optional
            Columns of a table, as for `read_table`.
        **options
            How it is read, as for `identify`: `namespace`, `belt_speed`, and the options for bags
            and tables of other machines; `start` and `end` are those of the part to predict.

        Returns
        -------
        dict
            `force_error`, `position_error` and `closed_loop_force_error` as shares of the rms of
            what was recorded, `free_run_error` and `segment_error` in m; None for what cannot be
            predicted, infinite for what is unbounded.

        Raises
        ------
        BagError
            If the recording cannot be read.
        InvalidInputError
            If it has several parts, or lacks what a prediction needs.
        """
        records = read_records(Path(recording), columns, **with_forms(options))
        if len(records) > 1:
            raise InvalidInputError(
                f"{recording} has {len(records)} parts between long gaps: one must be chosen by "
                "start and end"
            )
        return self.findings.check(records[0])

    def save(self, path: Path | str) -> Scenario:
        """Write a complete scenario of the drive, and return it.

        Parameters
        ----------
        path : Path or str
            File that must not exist. Friction curves are written beside it.

        Returns
        -------
        Scenario
            The scenario.
        """
        written_scenario(self.findings, Path(path))
        return load_scenario(str(path))

    @override
    def _drawing(self) -> Drawing:
        from stickslip_ros.show.identification_figure import identification_figure

        return partial(identification_figure, self.findings, units=self._units)

    @cached_property
    def predictions(self) -> dict[str, dict[str, float | None]]:
        """What `check` returns of the first recording that was fitted, and of those to check."""
        records = {"": self.findings.records[0], **self.predicted}
        return {name: self.findings.check(record) for name, record in records.items()}

    @property
    def _checks(self) -> list[dict[str, Any]]:
        return [{"recording": name, **self.predictions[name]} for name in self.predicted]

    @property
    def _notes(self) -> list[str]:
        others = (sentences.notes_on(self.findings, record) for record in self.predicted.values())
        return [*sentences.notes(self.findings), *(note for notes in others for note in notes)]

    @override
    def _entries(self) -> dict[str, Any]:
        findings = self.findings
        return {
            "law": findings.law,
            "parameters": {name: estimate.as_dict() for name, estimate in self.parameters.items()},
            "correlations": [
                {"parameters": [f"plant.{first}", f"plant.{second}"], "correlation": value}
                for first, second, value in findings.correlations
            ],
            "unidentified": self.unidentified,
            **self.predictions[""],
            "candidates": [
                {
                    "law": candidate.law.name,
                    "constants": candidate.size,
                    "held_out_error": candidate.error,
                    "by_direction": candidate.by_direction,
                    "as_good": findings.as_good.get(candidate.label, False),
                    "remark": candidate.remark,
                }
                for candidate in findings.candidates
            ],
            "curves": [vars(curve) for curve in findings.curves],
            "notes": self._notes,
            "servo": None if findings.servo is None else vars(findings.servo),
            "force_delay": findings.chosen.delay,
            "checks": self._checks,
        }

    @override
    def _summary(self) -> Summary:
        findings = self.findings
        names = ", ".join(dict.fromkeys(record.name for record in findings.records))
        verdict = f"friction law {findings.law}, validation error {findings.chosen.error:.3%}"
        return Summary("Identified drive", names, verdict)

    @override
    def parts(self) -> Parts:
        predictions = self.predictions[""], self._checks, self._notes
        return identification_tables(self.findings, *predictions, self._units)


def identify(
    *recordings: Path | str,
    columns: Mapping[str, str] | None = None,
    law: str = AUTO,
    fixed: Mapping[str, float | str] | None = None,
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
    rotary: bool = False,
    check: Sequence[Path | str] = (),
    progress: Callable[[str], None] = lambda _: None,
    time_limit: float = AUTO_TIME,
) -> Model:
    """Fit a model to recordings of a drive.

    Parameters
    ----------
    *recordings : Path or str
        Bags, and CSV or MAT files, of one machine.
    columns : mapping, optional
        Columns of the tables, as for `read_table`.
    law : str, optional
        Friction law, or `"auto"`: the one that predicts held-out parts best.
    fixed : mapping, optional
        Constants that are known, such as `{"plant.mass": 95.0}` or `"95kg"`, SI units.
    start, end : float, optional
        Part to use, s from the first sample of each recording.
    namespace : str, optional
        ROS namespace of the drive, where a bag holds several.
    belt_speed : float, optional
        Belt speed, m/s, in place of what the recordings have.
    joint, belt_joint, states_topic, force_topic, time, force : optional
        Where bags of another machine have motion and force, as for `read_bag`.
    decimal, skip, encoding, period, where, session, second, shift, force_constant, pitch : optional
        Form of the tables, as for `read_table`.
    rotary : bool, optional
        Whether displacements are angles, rad, and forces torques, N m: they are shown as such.
    check : sequence of Path or str, optional
        Recordings that are not fitted, of which the result says what the model predicts.
    progress : callable, optional
        Receives the name of the friction law that is tried.
    time_limit : float, optional
        Work for `"auto"`, in s of a usual processor, after which the best law so far is taken.

    Returns
    -------
    Model
        Constants with intervals, the drive, and its predictions.

    Raises
    ------
    BagError
        If a recording cannot be read.
    InvalidInputError
        If an argument is not allowed, or no model is identifiable from the recordings.

    Examples
    --------
    >>> import tempfile
    >>> import stickslip_ros as ss
    >>> drive = ss.scenario("feed_drive", expects_control=False, belt_speed=0.02)
    >>> log = ss.simulate(drive, duration=2.0).to_pandas().reset_index()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log.to_csv(f"{folder}/log.csv", index=False)
    ...     model = ss.identify(f"{folder}/log.csv", law="stribeck",
    ...         fixed={"plant.mass": 100.0, "plant.damping": 200.0})
    >>> f"{model.drive.stiffness:.4g} N/m"
    '1e+06 N/m'
    """
    fitted, others = ([*dict.fromkeys(map(Path, paths))] for paths in (recordings, check))
    read = read_all(
        [*fitted, *others],
        columns,
        start=start,
        end=end,
        namespace=namespace,
        belt_speed=belt_speed,
        form=TableFormat(
            *(decimal, skip, encoding, rotary, period, where, session),
            second=None if second is None else Path(second),
            shift=shift,
            force_constant=force_constant,
            pitch=pitch,
        ),
        layout=BagLayout(joint, belt_joint, states_topic, force_topic, time, force),
    )
    records = [record for path in fitted for record in read[path]]
    findings = identify_records(records, law, constants(fixed or {}), progress, time_limit)
    predicted = {
        str(path) if len(read[path]) == 1 else f"{path}, part {number}": record
        for path in others
        for number, record in enumerate(read[path], start=1)
    }
    return Model(findings, predicted, Units(rotary=rotary))
