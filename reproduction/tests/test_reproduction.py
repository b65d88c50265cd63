"""The report in docs/ is what the code computes."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from reproduction.__main__ import main
from reproduction.claims import CLAIMS, Claim, Finding, Verdict
from reproduction.figures import NUMBERS
from reproduction.report import as_markdown, report, verdict_counts
from reproduction.tests.test_claims import KNOWN_SLIPS, check_form, findings_without_figures
from reproduction.tests.test_figures import over_belt_speed

DOCS = Path(__file__).parents[2] / "docs"
KEPT: Mapping[str, Any] = json.loads((DOCS / "reproduction.json").read_text(encoding="utf-8"))
BY_IDENTIFIER = {claim["identifier"]: claim for claim in KEPT["claims"]}

NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def same_text(now: str, kept: str) -> bool:
    """Whether texts are the same but for numbers that differ in their last digits."""
    if NUMBER.sub("#", now) != NUMBER.sub("#", kept):
        return False
    numbers = zip(NUMBER.findall(now), NUMBER.findall(kept), strict=True)
    return all(float(a) == pytest.approx(float(b), rel=2e-3, abs=2e-4) for a, b in numbers)


def check(claim: Claim, finding: Finding) -> None:
    kept = BY_IDENTIFIER[claim.identifier]
    assert (claim.place, claim.statement, claim.printed) == (
        kept["place"],
        kept["statement"],
        kept["printed"],
    )
    assert finding.verdict == kept["verdict"]
    for now, then in ((finding.computed, kept["computed"]), (finding.remark, kept["remark"])):
        if isinstance(now, str):
            assert same_text(now, then), f"{claim.identifier}: {now!r} was {then!r}"
        elif now is None:
            assert then is None
        else:
            assert now == pytest.approx(then, rel=1e-6, abs=1e-9)
    if finding.difference is not None:
        assert finding.difference == pytest.approx(kept["difference"], rel=1e-5, abs=1e-8)


def test_it_holds_every_claim_once() -> None:
    assert [claim["identifier"] for claim in KEPT["claims"]] == [c.identifier for c in CLAIMS]


def test_the_page_is_made_of_the_findings() -> None:
    assert (DOCS / "reproduction.md").read_text(encoding="utf-8") == as_markdown(KEPT)


def test_the_figures_are_there() -> None:
    assert tuple(figure["number"] for figure in KEPT["figures"]) == NUMBERS
    for figure in KEPT["figures"]:
        assert (DOCS / figure["picture"]).read_bytes().startswith(b"\x89PNG")


def test_a_report_has_what_is_kept() -> None:
    finding = Finding(None, None, Verdict.UNDECIDABLE, "not printed")
    findings = {claim.identifier: finding for claim in CLAIMS}
    found = report(findings, {"figure_02.png": over_belt_speed()})
    for part in ("claims", "figures"):
        assert {*found[part][0]} == {*KEPT[part][0]}
    (figure,) = found["figures"]
    assert figure["caption"].endswith("for 11 values of the belt speed v0 from 0 to 1.")
    assert verdict_counts(found)[Verdict.UNDECIDABLE] == len(CLAIMS)


@pytest.mark.long
def test_claims_that_need_no_figure_are_found_as_kept() -> None:
    found = findings_without_figures()
    assert len(found) > len(CLAIMS) / 2
    for claim in CLAIMS:
        if claim.identifier in found:
            check(claim, found[claim.identifier])


@pytest.mark.long
def test_the_whole_paper(tmp_path: Path) -> None:
    """One computation, which takes most of a minute, for all that is asked of its result."""
    out = tmp_path / "again"
    main(["--out", str(out)])
    written = json.loads((out / "reproduction.json").read_text(encoding="utf-8"))
    found = {
        claim["identifier"]: Finding(
            claim["computed"], claim["difference"], Verdict(claim["verdict"]), claim["remark"]
        )
        for claim in written["claims"]
    }
    for claim in CLAIMS:
        check(claim, found[claim.identifier])
        check_form(claim, found[claim.identifier])
    assert {name: found[name].verdict for name in KNOWN_SLIPS} == KNOWN_SLIPS
    verdicts = [finding.verdict for finding in found.values()]
    assert set(verdicts) == set(Verdict)
    # "More than twenty" places where the paper disagrees with itself are known.
    assert verdicts.count(Verdict.FAILS) + verdicts.count(Verdict.CORRECTED) > 20
    assert verdicts.count(Verdict.UNDECIDABLE) < 10
    page = (out / "reproduction.md").read_text(encoding="utf-8")
    pictures = sorted(out.glob("reproduction/*.png"))
    assert [picture.name for picture in pictures] == [f"figure_{n:02}.png" for n in range(2, 14)]
    for picture in pictures:
        assert f"(reproduction/{picture.name})" in page


def test_a_directory_that_cannot_be_written_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["--out", "/proc/none"])
    assert "--out /proc/none: cannot be written: No such file" in capsys.readouterr().err
