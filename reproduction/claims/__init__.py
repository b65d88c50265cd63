"""Every number, formula and statement of the paper, and the computation that judges it.

A claim is a row of `claims.toml`, with all of its words, and a function that computes.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from string import Formatter
from typing import Any, NamedTuple

import numpy as np

from reproduction.claims import (
    bifurcation_diagrams,
    coefficients,
    control_effect,
    model,
    paper_values,
    phase_portraits,
    stability,
    washout,
)
from reproduction.claims.verdict import Evidence, Finding, Verdict

_PARTS = (
    model,
    stability,
    coefficients,
    bifurcation_diagrams,
    phase_portraits,
    washout,
    control_effect,
)
COMPUTATIONS = {claim: compute for part in _PARTS for claim, compute in part.computes.items()}
"""The computation of each decidable claim, by its identifier."""


@dataclass(frozen=True)
class Claim:
    """A number, a formula or a statement of the paper."""

    identifier: str
    """Unique, and the same in all versions."""
    place: str
    """Place in the paper: equation, figure or section."""
    statement: str
    """The claim, in our words."""
    printed: float | str | None = None
    """The number or the formula as printed; None for a statement in words."""
    computed: str = ""
    """The result for a statement in words, with the names of values in braces."""
    remark: str = ""
    """Further results, likewise."""
    undecidable: str | None = None
    """Why no computation can decide it."""

    def check(self, evidence: Evidence) -> Finding:
        """Compute the subject of the claim, and judge it."""
        if self.undecidable is not None:
            return Finding(None, None, Verdict.UNDECIDABLE, self.undecidable)
        result = COMPUTATIONS[self.identifier](evidence)
        finding = result.judge(self.printed)
        words, values = _Words(), {**vars(paper_values), **result.values}
        computed = finding.computed
        if computed is None:
            computed = words.vformat(self.computed, (), values)
        remark = f"{finding.remark} {words.vformat(self.remark, (), values)}".strip()
        return replace(finding, computed=computed, remark=remark)


class Chapter(NamedTuple):
    """The claims of a part of the paper, in order."""

    title: str
    claims: tuple[Claim, ...]


class _Words(Formatter):
    """Fills in words: lists one by one, and numbers to four digits where no format is given."""

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, np.ndarray | Sequence) and not isinstance(value, str):
            return ", ".join(self.format_field(one, format_spec) for one in value)
        if isinstance(value, complex):
            sign = "-" if value.imag < 0.0 else "+"
            return f"{value.real:.4f} {sign} {abs(value.imag):.4f} i"
        default = ".4g" if isinstance(value, float) else ""
        return format(value, format_spec or default)


def _chapters() -> tuple[Chapter, ...]:
    text = files(__name__).joinpath("claims.toml").read_text(encoding="utf-8")
    chapters = tomllib.loads(text)
    rows = {name: row for claims in chapters.values() for name, row in claims.items()}
    for row in rows.values():
        if like := row.pop("words_of", None):
            row |= {key: rows[like].get(key, "") for key in ("computed", "remark")}
    return tuple(
        Chapter(title, tuple(Claim(name, **row) for name, row in claims.items()))
        for title, claims in chapters.items()
    )


CHAPTERS = _chapters()
"""The parts of the paper in order; the abstract is with the conclusions."""

CLAIMS = tuple(claim for chapter in CHAPTERS for claim in chapter.claims)
"""The claims of all chapters."""

__all__ = ["CHAPTERS", "CLAIMS", "Chapter", "Claim", "Evidence", "Finding", "Verdict"]
