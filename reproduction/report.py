"""The report on the paper: every claim with its verdict, and the figures, as JSON and Markdown."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import groupby
from typing import Any

from reproduction.claims import CHAPTERS, Finding, Verdict
from reproduction.figures import SETTLING, BifurcationFigure, PaperFigure

Report = Mapping[str, Any]
"""The report as in JSON: `claims` and `figures`, each a list of objects."""

_HEAD = """\
# The paper, reproduced

"Dynamics of mass-spring-belt friction self-excited vibration system" models a mass on a moving belt
with Stribeck friction, finds the feed speed below which self-excited vibration occurs, and
suppresses the vibration with a washout filter. This page compares every number, formula and
statement of that paper with the results of its own equations. In a checkout, `make reproduction`
computes and writes this page, the figures, and `reproduction.json`, which has the findings in full
precision, the differences, and all of the evidence.

Nothing in the column *computed* comes from the paper. The values are for a drive with mass,
stiffness and normal force of one, mu_s = 0.4, mu_m = 0.25, v_m = 0.5 and beta = 0.01 in eq. 5 (a
damping coefficient 2 beta of 0.02), unless a line gives others. A number holds if the computed
value, rounded to the last printed digit, is equal to it. A correction is a stated change of the
calculation that gives the printed number or makes a formula correct.
"""

_FIGURES = """\
## The figures

These are the paper's figures 2 to 13, computed from the equations. Parameter values that the paper
does not print are chosen to show the behaviour that its text describes. Everything is dimensionless
and starts from rest at X = 0. Figure 1 is a drawing of the model.
"""

_FORMULA_RESULTS = ("the same", "something else")
"""Results for a formula."""

_COLUMNS = ("", "claim", "printed", "computed", "verdict")


def report(findings: Mapping[str, Finding], figures: Mapping[str, PaperFigure]) -> Report:
    """Return the report, ready for JSON.

    `findings` are given by the identifier of the claim, `figures` by the path of the image relative
    to the report.
    """
    return {
        "claims": [
            {
                "chapter": chapter.title,
                "identifier": claim.identifier,
                "place": claim.place,
                "statement": claim.statement,
                "printed": claim.printed,
                **asdict(findings[claim.identifier]),
            }
            for chapter in CHAPTERS
            for claim in chapter.claims
        ],
        "figures": [
            {"number": figure.number, "caption": _caption(figure), "picture": path}
            for path, figure in figures.items()
        ],
    }


def verdict_counts(report: Report) -> dict[str, int]:
    """Return the number of claims of a report by verdict."""
    counts = Counter(claim["verdict"] for claim in report["claims"])
    return {str(verdict): counts[verdict] for verdict in Verdict}


def as_markdown(report: Report) -> str:
    """Return the report as a page."""
    counts = [(verdict, str(count)) for verdict, count in verdict_counts(report).items()]
    parts = [_HEAD, _table([("verdict", "claims"), ("---", "---:"), *counts])]
    for title, claims in groupby(report["claims"], key=lambda claim: claim["chapter"]):
        rows = [_COLUMNS, ["---"] * len(_COLUMNS), *map(_cells, claims)]
        parts.append(f"## {title}\n\n{_table(rows)}")
    parts.append(_FIGURES)
    for figure in report["figures"]:
        number, caption = figure["number"], figure["caption"]
        parts.append(f"![Figure {number}: {caption}]({figure['picture']})\n")
    return "\n".join(parts)


def _cells(claim: Mapping[str, Any]) -> list[str]:
    verdict = f"**{claim['verdict']}**"
    return [
        claim["place"].replace("section ", "§"),
        claim["statement"],
        _shown(claim["printed"]),
        "" if claim["computed"] in _FORMULA_RESULTS else _shown(claim["computed"]),
        verdict if claim["verdict"] == Verdict.HOLDS else f"{verdict}: {_first_sentence(claim)}",
    ]


def _first_sentence(claim: Mapping[str, Any]) -> str:
    return re.split(r"(?<!eq)(?<!Fig)\. (?=[A-Z\d])", claim["remark"])[0].rstrip(".") + "."


def _table(rows: Sequence[Sequence[str]]) -> str:
    cells = ([cell.replace("|", r"\|") for cell in row] for row in rows)
    return "".join(f"| {' | '.join(row)} |\n" for row in cells)


def _shown(value: float | str | None) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else f"{value:.6g}"


def _caption(figure: PaperFigure) -> str:
    if isinstance(figure, BifurcationFigure):
        start, end = figure.values[[0, -1]]
        return (
            f"{figure.title}. Turning points of the motion from rest after "
            f"{SETTLING.transient:g} natural periods, for {len(figure.values)} values of "
            f"the {figure.plan.label} from {start:g} to {end:g}."
        )
    return f"{figure.title}."
