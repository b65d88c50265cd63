"""`stickslip paper`: the figures and claims of the paper, computed from the equations."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from stickslip_ros.app.arguments import add_json, check_writable, writing
from stickslip_ros.app.optional_dependencies import load_matplotlib
from stickslip_ros.app.output import print_json, print_parts, progress_bar
from stickslip_ros.app.result import add_style
from stickslip_ros.files import written
from stickslip_ros.tables import TextTable

if TYPE_CHECKING:
    from stickslip_ros.paper.claims import Finding
    from stickslip_ros.paper.figures import PaperFigure

_REPORT = "reproduction"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "--out",
        required=True,
        type=Path,
        metavar="DIR",
        help=f"directory for {_REPORT}.md, {_REPORT}.json and the figures in {_REPORT}/; files of "
        "an earlier call are replaced",
    )
    add_style(parser)
    add_json(parser)


def run(arguments: argparse.Namespace) -> None:
    """Run the command."""
    from stickslip_ros.paper.figures import NUMBERS
    from stickslip_ros.paper.report import as_markdown, report, verdict_counts

    out: Path = arguments.out
    folder = out / _REPORT
    with writing("--out", out):
        folder.mkdir(parents=True, exist_ok=True)
    check_writable("--out", folder / _name(NUMBERS[0]))
    figures = _draw_figures(folder, arguments.style)
    findings = _judge(figures)
    found = report(findings, {f"{_REPORT}/{_name(n)}": figures[n] for n in NUMBERS})
    text = json.dumps(found, indent=1, ensure_ascii=False, allow_nan=False)
    for name, content in ((f"{_REPORT}.json", f"{text}\n"), (f"{_REPORT}.md", as_markdown(found))):
        with writing("--out", out / name), written(out / name, replace=True) as stream:
            stream.write(content)
    if arguments.json:
        print_json(found)
    else:
        rows = [[verdict, str(count)] for verdict, count in verdict_counts(found).items()]
        title = f"{len(findings)} claims of the paper"
        print_parts(TextTable(title, ["verdict", "claims"], rows))
        print(f"report:   {out / _REPORT}.md, {out / _REPORT}.json\nfigures:  {folder}")


def _name(number: int) -> str:
    return f"figure_{number:02}.png"


def _draw_figures(folder: Path, style: str | None) -> "dict[int, PaperFigure]":
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from multiprocessing import get_context

    from stickslip_ros.paper.figures import NUMBERS

    figures: dict[int, PaperFigure] = {}
    # Not forked: heyoka's compiler has threads, which a fork would lose.
    with (
        progress_bar("figures", len(NUMBERS)) as progress,
        ProcessPoolExecutor(mp_context=get_context("spawn")) as pool,
    ):
        jobs = {
            pool.submit(_draw, number, folder / _name(number), style): number for number in NUMBERS
        }
        try:
            for job in as_completed(jobs):
                figures[jobs[job]] = job.result()
                progress(len(figures))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return figures


def _draw(number: int, path: Path, style: str | None) -> "PaperFigure":
    load_matplotlib()
    from stickslip_ros.paper.drawing import paper_figure, save_paper_figure
    from stickslip_ros.paper.figures import compute_figure
    from stickslip_ros.show.style import STYLES

    figure = compute_figure(number)
    look = STYLES[style or "screen"]
    drawn = paper_figure(figure, style=look)
    with writing("--out", path):
        save_paper_figure(drawn, path, look)
    return figure


def _judge(figures: "dict[int, PaperFigure]") -> "dict[str, Finding]":
    from stickslip_ros.paper.claims import CLAIMS, Evidence

    evidence = Evidence(figures.__getitem__)
    findings: dict[str, Finding] = {}
    with progress_bar("claims", len(CLAIMS)) as progress:
        for claim in CLAIMS:
            findings[claim.identifier] = claim.check(evidence)
            progress(len(findings))
    return findings
