"""`stickslip paper`: the report and the figures, from the command line."""

import json
from pathlib import Path

import pytest

from stickslip_ros.paper.claims import CLAIMS, Finding, Verdict
from tests.app.conftest import Run
from tests.paper.test_claims import KNOWN_SLIPS, check_form
from tests.paper.test_reproduction import check


@pytest.mark.long
def test_the_whole_paper(stickslip: Run, tmp_path: Path) -> None:
    """One computation, which takes most of a minute, for all that is asked of its result."""
    done = stickslip("paper", "--out", "again", "--json")
    assert done.returncode == 0, done.stderr
    found = {
        claim["identifier"]: Finding(
            claim["computed"], claim["difference"], Verdict(claim["verdict"]), claim["remark"]
        )
        for claim in json.loads(done.stdout)["claims"]
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
    out = tmp_path / "again"
    assert {"claims", "figures"} <= json.loads((out / "reproduction.json").read_text()).keys()
    page = (out / "reproduction.md").read_text(encoding="utf-8")
    pictures = sorted(out.glob("reproduction/*.png"))
    assert [picture.name for picture in pictures] == [f"figure_{n:02}.png" for n in range(2, 14)]
    for picture in pictures:
        assert f"(reproduction/{picture.name})" in page
