"""Every number, formula and statement of the paper, and the computation that judges it."""

from stickslip_ros.paper.claims import (
    conclusions,
    control,
    model,
    simulations,
    stability,
)
from stickslip_ros.paper.claims.claim import Chapter, Claim, Evidence, Finding, Verdict

CHAPTERS: tuple[Chapter, ...] = (
    model.CHAPTER,
    stability.CHAPTER,
    simulations.CHAPTER,
    control.CHAPTER,
    conclusions.CHAPTER,
)
"""The parts of the paper in its order, the abstract with the conclusions."""

CLAIMS: tuple[Claim, ...] = tuple(claim for chapter in CHAPTERS for claim in chapter.claims)
"""The claims of all chapters."""

__all__ = ["CHAPTERS", "CLAIMS", "Chapter", "Claim", "Evidence", "Finding", "Verdict"]
