"""Compute the paper's figures, judge its claims, and write the report on them.

DIR gets reproduction.md, reproduction.json, and the figures in reproduction/.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from reproduction.computation import draw_figures, judge
from reproduction.figures import NUMBERS
from reproduction.report import as_markdown, report, verdict_counts
from stickslip_ros.app.output import print_parts
from stickslip_ros.files import written
from stickslip_ros.tables import TextTable

REPORT = "reproduction"
PICTURES = {number: f"{REPORT}/figure_{number:02}.png" for number in NUMBERS}
STYLES = ("screen", "paper", "paper-double")


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the report into the directory that is asked for, and print the number of verdicts."""
    parser = argparse.ArgumentParser(prog="python -m reproduction", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("docs"), metavar="DIR")
    parser.add_argument("--style", choices=STYLES, default="screen", help="style of the figures")
    chosen = parser.parse_args(arguments)
    out: Path = chosen.out
    try:
        (out / REPORT).mkdir(parents=True, exist_ok=True)
        write_report(out, chosen.style)
    except OSError as error:
        parser.error(f"--out {out}: cannot be written: {error.strerror}")


def write_report(out: Path, style: str) -> None:
    """Compute the report, write it with its figures, and print the number of verdicts."""
    figures = draw_figures({number: out / path for number, path in PICTURES.items()}, style)
    found = report(judge(figures), {path: figures[number] for number, path in PICTURES.items()})
    text = json.dumps(found, indent=1, ensure_ascii=False, allow_nan=False)
    for name, content in ((f"{REPORT}.json", f"{text}\n"), (f"{REPORT}.md", as_markdown(found))):
        with written(out / name, replace=True) as stream:
            stream.write(content)
    rows = [[verdict, str(count)] for verdict, count in verdict_counts(found).items()]
    print_parts(TextTable(f"{len(found['claims'])} claims", ["verdict", "claims"], rows))


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
