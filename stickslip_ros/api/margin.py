"""Margins: how far a machine is from chatter, from recordings of safe runs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import override

from stickslip_ros.api.page import Summary
from stickslip_ros.api.recordings import with_forms
from stickslip_ros.api.results import Drawing, Parts, Result
from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.recordings import read_all
from stickslip_ros.measures.onset import FeedDecay, Onset, onset_of
from stickslip_ros.measures.ring_down import RingDown, ring_downs, why_no_ring_down
from stickslip_ros.quantities import quantities_of
from stickslip_ros.show.quantities import SI, Units
from stickslip_ros.tables import TextTable


@dataclass(frozen=True, eq=False, repr=False)
class Margin(Result):
    """The belt speed at which vibration starts; it prints as the tables of `stickslip margin`."""

    recordings: Sequence[Path]
    """The recordings."""
    margin: float
    """Share of the belt speed by which it is to exceed the onset."""
    onset: Onset
    """Onset with its interval, decay at each feed, and families of friction."""
    notes: Sequence[str]
    """Sentences on recordings without a decay, what cannot be told, and which run would tell it."""
    units: Units = SI
    """Units of its tables and its figure."""

    @property
    def least_feed(self) -> float | None:
        """Least belt speed that keeps the margin, m/s; None where it cannot be told."""
        upper = self.onset.upper
        return None if upper is None else upper / (1.0 - self.margin)

    @override
    def parts(self) -> Parts:
        texts, shown = self.units.texts, quantities_of(FeedDecay)
        yield self._verdict
        if self.onset.feeds:
            cells = zip(*(vars(feed).values() for feed in self.onset.feeds), strict=True)
            columns = [texts(row, q.unit) for row, q in zip(cells, shown.values(), strict=True)]
            rows = [[*row] for row in zip(*columns, strict=True)]
            yield TextTable("decay", [quantity.label for quantity in shown.values()], rows)
        if self.onset.families:
            rows = [
                [name, texts([fit[0]], "m/s")[0] if fit[0] < inf else "none", *texts(fit[2:4], "")]
                for name, fit in self.onset.families.items()
            ]
            yield TextTable("friction", ["law", "onset", "probability", "rejected"], rows)
        yield from self.notes

    @property
    def _verdict(self) -> str:
        fit = self.onset
        if fit.upper is None:
            return "the onset of vibration cannot be told"
        speeds = [fit.speed, fit.lower, fit.upper, self.least_feed]
        onset, lower, upper, least = (self.units.text(speed, "m/s") for speed in speeds)
        text = f"at {onset} (95 % interval {lower} to {upper})"
        text = text if fit.lower else f"below {upper}, if at all"
        return (
            f"vibration starts {text}; the least feed with a margin of {self.margin:g} is {least}"
        )

    @override
    def _drawing(self) -> Drawing:
        from stickslip_ros.show.identification_figure import margin_figure

        if not self.onset.feeds:
            raise InvalidInputError("there is no decay to draw: " + "; ".join(self.notes))
        return partial(margin_figure, self._names, self.onset, units=self.units)

    @property
    def _names(self) -> str:
        return ", ".join(recording.name for recording in self.recordings)

    @override
    def _entries(self) -> dict[str, Any]:
        families = [{"law": law} | f._asdict() for law, f in self.onset.families.items()]
        for family in families:
            del family["decay_rate"]
        return {
            "onset_speed": self.onset.speed,
            "interval": [self.onset.lower, self.onset.upper],
            "margin": self.margin,
            "least_feed": self.least_feed,
            "feeds": [vars(feed) for feed in self.onset.feeds],
            "families": families,
            "notes": [*self.notes],
            "recordings": [str(recording) for recording in self.recordings],
        }

    @override
    def _summary(self) -> Summary:
        return Summary("Onset of vibration", self._names, self._verdict)


def margin(
    *recordings: Path | str,
    columns: Mapping[str, str] | None = None,
    margin: float = 0.1,
    rotary: bool = False,
    **options: Any,
) -> Margin:
    """Tell the belt speed at which vibration starts, from runs that do not vibrate.

    Parameters
    ----------
    *recordings : Path or str
        Bags, and CSV or MAT files, of one machine that is tapped, at several feeds.
    columns : mapping of str to str, optional
        As for `read_table`.
    margin : float, optional
        Share of the belt speed by which it is to exceed the onset, for `least_feed`.
    rotary, **options : optional
        As for `read_bag` and `read_table`, whose errors it raises, too.

    Returns
    -------
    Margin
        Onset with its interval, or sentences that say why there is none.

    Raises
    ------
    InvalidInputError
        If the margin is not allowed, the belt moves in both directions, or no recording has a
        ring-down.
    """
    if not 0.0 <= margin < 1.0:
        raise InvalidInputError(f"margin = {margin} is invalid: must be at least 0 and below 1")
    paths, units = [*dict.fromkeys(map(Path, recordings))], Units(rotary=rotary)
    read = read_all(paths, columns, **with_forms({**options, "rotary": rotary}))
    records = [record for path in paths for record in read[path]]
    if {-1.0, 1.0} <= {float(np.sign(record.belt_velocity.mean())) for record in records}:
        raise InvalidInputError("the belt moves in both directions: friction may differ in them")
    decays: list[RingDown] = []
    notes = [f"{path}: {note}" for path in paths for note in read[path][0].notes]
    for record in records:
        motion = record.position, record.belt_velocity, record.period
        taps = [*ring_downs(*motion)]
        if not taps:
            notes.append(f"{record.name}: {why_no_ring_down(*motion, units.of_unit('m'))}")
        growing = [units.text(tap.belt_speed, "m/s") for tap in taps if tap.decay_rate <= 0.0]
        notes += [f"{record.name}: a vibration does not decay at {feed}" for feed in growing]
        decays += taps
    if not decays:
        raise InvalidInputError("; ".join(notes))
    onset = onset_of(decays, units.of_unit("m"))
    return Margin(paths, margin, onset, [*filter(None, [*notes, onset.advice])], units)
