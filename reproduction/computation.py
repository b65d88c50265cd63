"""All figures, computed and drawn, and what is found of all claims."""

from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from reproduction.claims import CLAIMS, Evidence, Finding
from reproduction.figures import PaperFigure, compute_figure
from stickslip_ros.app.optional_dependencies import load_matplotlib
from stickslip_ros.app.output import progress_bar


def draw_figures(paths: dict[int, Path], style: str) -> dict[int, PaperFigure]:
    """Compute figures and draw them into files, several at a time; return them by number."""
    figures: dict[int, PaperFigure] = {}
    # Not forked: heyoka's compiler has threads, which a fork would lose.
    with (
        progress_bar("figures", len(paths)) as progress,
        ProcessPoolExecutor(mp_context=get_context("spawn")) as pool,
    ):
        jobs = {pool.submit(_draw, number, path, style): number for number, path in paths.items()}
        try:
            for job in as_completed(jobs):
                figures[jobs[job]] = job.result()
                progress(len(figures))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return figures


def _draw(number: int, path: Path, style: str) -> PaperFigure:
    load_matplotlib()
    from reproduction.drawing import paper_figure, save_paper_figure
    from stickslip_ros.show.style import STYLES

    figure = compute_figure(number)
    save_paper_figure(paper_figure(figure, style=STYLES[style]), path, STYLES[style])
    return figure


def judge(figures: dict[int, PaperFigure]) -> dict[str, Finding]:
    """Return what is found of each claim, by its identifier."""
    evidence = Evidence(figures.__getitem__)
    findings: dict[str, Finding] = {}
    with progress_bar("claims", len(CLAIMS)) as progress:
        for claim in CLAIMS:
            findings[claim.identifier] = claim.check(evidence)
            progress(len(findings))
    return findings
