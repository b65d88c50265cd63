"""Identification: a model of a drive from recordings."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip_ros.api.results import Parts, Result
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.fit import Estimate
from stickslip_ros.identification.identify import AUTO, identify_recordings
from stickslip_ros.identification.record import read_all, read_records
from stickslip_ros.identification.scenario import written_scenario
from stickslip_ros.physics.model.drive import Drive
from stickslip_ros.plots.identification_table import identification_tables
from stickslip_ros.scenarios.files import Scenario, load_scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip_ros.plots.style import FigureStyle


@dataclass(frozen=True, eq=False, repr=False)
class Model(Result):
    """A model that was fitted to recordings; it prints as the tables of `stickslip identify`."""

    findings: Findings
    """All that was found: candidates, curves, correlations, errors."""

    @property
    def law(self) -> str:
        """Friction law."""
        return self.findings.law

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Value, standard error and 95 % interval by parameter, such as `plant.mass`; SI units."""
        return {f"plant.{name}": each for name, each in self.findings.fitted.items()}

    @property
    def unidentified(self) -> dict[str, str]:
        """Reasons why a parameter is not told, and the run that would tell it, by parameter."""
        return {f"plant.{name}": why for name, why in self.findings.unidentified.items()}

    @property
    def drive(self) -> Drive:
        """The drive."""
        return self.findings.drive

    def check(
        self,
        recording: Path | str,
        columns: Mapping[str, str] | None = None,
        *,
        start: float = 0.0,
        end: float = float("inf"),
    ) -> dict[str, float | None]:
        """Return what the model predicts of a recording.

        Parameters
        ----------
        recording : Path or str
            A bag or a table.
        columns : mapping, optional
            Columns of a table, as for `read_table`.
        start, end : float, optional
            Part to predict, s from the first sample.

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
        records = read_records(Path(recording), columns, start=start, end=end).records
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

    def _figure(self, style: "FigureStyle") -> "Figure":
        from stickslip_ros.plots.identification_figure import identification_figure

        return identification_figure(self.findings, style=style)

    def _parts(self) -> Parts:
        found = self.findings
        return identification_tables(found, found.check(found.records[0]), [], found.notes)


def identify(
    *recordings: Path | str,
    columns: Mapping[str, str] | None = None,
    law: str = AUTO,
    fixed: Mapping[str, float | str] | None = None,
    start: float = 0.0,
    end: float = float("inf"),
    namespace: str | None = None,
    belt_speed: float | None = None,
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

    Returns
    -------
    Model
        Constants with intervals, the drive, and its predictions.

    Raises
    ------
    BagError
        If a recording cannot be read.
    InvalidInputError
        If an argument is not allowed, or the recordings cannot tell a model.

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
    read = read_all(
        [Path(each) for each in recordings],
        columns,
        start=start,
        end=end,
        namespace=namespace,
        belt_speed=belt_speed,
    )
    return Model(identify_recordings([*read.values()], law, {} if fixed is None else fixed))
