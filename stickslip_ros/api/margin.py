"""Margins: how far a machine is from chatter, from recordings of safe runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from typing_extensions import override

from stickslip_ros.api.results import Parts, Summary, Table, TabularResult
from stickslip_ros.bags.motion_reader import BagLayout
from stickslip_ros.bags.text_table import TableFormat
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.recordings import read_all
from stickslip_ros.physics.measures.onset import Onset, onset_of
from stickslip_ros.physics.measures.ring_down import RingDown, ring_downs, why_no_ring_down
from stickslip_ros.show.quantities import ONSET, SI, Units
from stickslip_ros.tables import TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from stickslip_ros.show.style import FigureStyle

DEFAULT_MARGIN = 0.1
"""Share of the belt speed by which it is to exceed the onset."""


@dataclass(frozen=True, eq=False, repr=False)
class Margin(TabularResult):
    """The belt speed at which vibration starts; it prints as the tables of `stickslip margin`."""

    recordings: Sequence[Path]
    """The recordings."""
    margin: float
    """Share of the belt speed by which it is to exceed the onset."""
    onset: Onset
    """Onset with its interval, decay at each feed, and families of friction."""
    notes: Sequence[str]
    """Sentences on recordings without a decay, what cannot be told, and which run would tell it."""
    _units: Units = SI
    """Units in which it is shown."""

    @property
    def onset_speed(self) -> float | None:
        """Belt speed at which vibration starts, m/s; None where it cannot be told."""
        return self.onset.onset_speed

    @property
    def interval(self) -> tuple[float | None, float | None]:
        """Ends of its 95 % interval, m/s; None for an end that cannot be told."""
        return self.onset.lower, self.onset.upper

    @property
    def least_feed(self) -> float | None:
        """Least belt speed that keeps the margin, m/s; None where it cannot be told."""
        return self.onset.least_feed(self.margin)

    @override
    def parts(self) -> Parts:
        units, feeds = self._units, self.onset.feeds
        yield self._verdict
        if feeds:
            columns = [
                units.texts([getattr(each, name) for each in feeds], quantity.unit)
                for name, quantity in ONSET.items()
            ]
            labels = [quantity.label for quantity in ONSET.values()]
            yield TextTable("decay", labels, [list(row) for row in zip(*columns, strict=True)])
        if self.onset.families:
            rows = [
                [
                    name,
                    units.text(each.onset_speed, "m/s"),
                    "rejected" if each.rejected else f"{each.probability:.2g}",
                ]
                for name, each in self.onset.families.items()
            ]
            yield TextTable("friction", ["law", "onset", "probability"], rows)
        yield from self.notes

    @property
    def _verdict(self) -> str:
        found, units = self.onset, self._units
        if found.upper is None:
            return "the onset of vibration cannot be told"
        upper = units.text(found.upper, "m/s")
        if found.onset_speed is None or found.lower is None:
            text = f"vibration starts below {upper}"
        else:
            onset, lower = (units.text(each, "m/s") for each in (found.onset_speed, found.lower))
            text = f"vibration starts at {onset} (95 % interval {lower} to {upper})"
        least = units.text(self.least_feed, "m/s")
        return f"{text}; the least feed with a margin of {self.margin:.3g} is {least}"

    @override
    def draw(self, style: "FigureStyle") -> "Figure":
        from stickslip_ros.show.margin_figure import margin_figure

        if not self.onset.feeds:
            raise InvalidInputError("there is no decay to draw: " + "; ".join(self.notes))
        title = f"Onset of vibration, {self._names}"
        return margin_figure(title, self.onset, style=style, units=self._units)

    @property
    def _names(self) -> str:
        return ", ".join(each.name for each in self.recordings)

    @override
    def _table(self) -> Table:
        columns = {
            name: np.array([getattr(each, name) for each in self.onset.feeds]) for name in ONSET
        }
        speed = {"belt_speed": columns["belt_speed"]}
        return Table(columns, ONSET, self._units, speed, {"recordings": self._names})

    @override
    def _entries(self) -> dict[str, Any]:
        return {
            "onset_speed": self.onset_speed,
            "interval": [*self.interval],
            "margin": self.margin,
            "least_feed": self.least_feed,
            "feeds": [vars(each) for each in self.onset.feeds],
            "families": [
                {
                    "law": name,
                    "onset_speed": each.onset_speed,
                    "chi_square": each.chi_square,
                    "probability": each.probability,
                    "rejected": each.rejected,
                }
                for name, each in self.onset.families.items()
            ],
            "notes": [*self.notes],
            "recordings": [str(each) for each in self.recordings],
        }

    @override
    def _summary(self) -> Summary:
        return Summary("Onset of vibration", self._names, self._verdict)


def margin(
    *recordings: Path | str,
    columns: Mapping[str, str] | None = None,
    margin: float = DEFAULT_MARGIN,
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
    rotary: bool = False,
) -> Margin:
    """Tell the belt speed at which vibration starts, from runs that do not vibrate.

    The slide is excited by taps, of known or unknown impulse, or by steps of the feed. The decay of
    what follows is measured at each feed, and extrapolated to zero by all families of friction
    laws that fit.

    Parameters
    ----------
    *recordings : Path or str
        Bags, and CSV or MAT files, of one machine, at several feeds above the onset.
    columns : mapping, optional
        Columns of the tables, as for `read_table`.
    margin : float, optional
        Share of the belt speed by which it is to exceed the onset, for `least_feed`.
    start, end : float, optional
        Part to use, s from the first sample of each recording.
    namespace : str, optional
        ROS namespace of the drive, where a bag holds several.
    belt_speed : float, optional
        Belt speed, m/s, in place of what the recordings have.
    joint, belt_joint, states_topic, force_topic, time, force : optional
        Where bags of another machine have motion and force, as for `read_bag`.
    decimal, skip, encoding : optional
        Form of the tables, as for `read_table`.
    rotary : bool, optional
        Whether displacements are angles, rad: they are shown as such.

    Returns
    -------
    Margin
        Onset with its interval, or sentences that say why there is none.

    Raises
    ------
    BagError
        If a recording cannot be read.
    InvalidInputError
        If an argument is not allowed, or the belt moves in both directions.

    Examples
    --------
    A tap at three feeds:

    >>> import tempfile
    >>> import stickslip_ros as ss
    >>> def log(feed, folder):
    ...     drive = ss.scenario("feed_drive", belt_speed=feed, expects_control=False,
    ...         disturbance_kind="impulse", disturbance_amplitude=300.0, disturbance_start=3.0)
    ...     path = f"{folder}/{feed}.csv"
    ...     ss.simulate(drive, duration=5.0).to_pandas().to_csv(path)
    ...     return path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     found = ss.margin(*[log(feed, folder) for feed in (0.052, 0.054, 0.056)])
    >>> 0.048 < found.onset_speed < 0.05  # 0.0489 m/s
    True
    """
    if not 0.0 <= margin < 1.0:
        raise InvalidInputError(f"margin = {margin} is invalid: must be at least 0 and below 1")
    paths = [*dict.fromkeys(map(Path, recordings))]
    read = read_all(
        paths,
        columns,
        start=start,
        end=end,
        namespace=namespace,
        belt_speed=belt_speed,
        form=TableFormat(decimal, skip, encoding),
        layout=BagLayout(joint, belt_joint, states_topic, force_topic, time, force),
    )
    units = Units(rotary=rotary)
    length = units.of_unit("m")
    found: list[RingDown] = []
    notes: list[str] = []
    directions = set[float]()
    for record in (each for path in paths for each in read[path].records):
        motion = record.position, record.belt_velocity, record.period
        own = [*ring_downs(*motion)]
        growing = [each for each in own if each.decay_rate <= 0.0]
        notes += record.notes
        if not own:
            notes.append(f"{record.name}: {why_no_ring_down(*motion, length)}")
        if growing:
            feed = units.text(growing[0].belt_speed, "m/s")
            notes.append(f"{record.name}: a vibration does not decay at {feed}: it is left out")
        found += own
        directions.add(float(np.sign(record.belt_velocity.mean())))
    if {-1.0, 1.0} <= directions:
        raise InvalidInputError(
            "the belt moves in both directions in these recordings, and friction may differ: those "
            "of one direction are needed"
        )
    onset = onset_of(found, length)
    return Margin(paths, margin, onset, [*notes, *onset.advice], units)
