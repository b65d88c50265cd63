"""The paper's claims: that all are there, and that the verdicts follow from the computation."""

import re
from contextlib import suppress
from dataclasses import replace
from functools import cache
from math import isfinite

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reproduction.claims import CHAPTERS, CLAIMS, COMPUTATIONS, Claim, Evidence, Finding, Verdict
from reproduction.claims.coefficients import Nonlinearity, samples
from reproduction.claims.paper_values import FILTER, OPEN, Loop, at
from reproduction.claims.verdict import Formula, Number, Observation, Result, agrees
from reproduction.figures import (
    NUMBERS,
    PRINTED_SLOPE,
    STRIBECK,
    BifurcationFigure,
    Panel,
    PaperFigure,
    PortraitCase,
    PortraitFigure,
    Portraits,
    portrait_of,
    unit_drive,
)
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.model.friction import Linear

HOLDS, CORRECTED, FAILS = Verdict.HOLDS, Verdict.CORRECTED, Verdict.FAILS

KNOWN_SLIPS = {
    "vb1": CORRECTED,
    "eq-8-constant": CORRECTED,
    "vb0": CORRECTED,
    "vb0-and-vb1": FAILS,
    "names-of-coefficients": CORRECTED,
    "eq-21-c2": FAILS,
    "eq-21-gain": CORRECTED,
    "eq-30-criterion": FAILS,
    "linear-slope": FAILS,
    "fig-9-vibration": CORRECTED,
    "fig-12-subcritical": FAILS,
    "jump-subcritical": FAILS,
}
"""Known slips of the paper, with the verdict that must result."""


class NoFigureError(Exception):
    """A claim asked for a figure, which takes long to compute."""


def no_figure(number: int) -> PaperFigure:
    raise NoFigureError(number)


@cache
def findings_without_figures() -> dict[str, Finding]:
    """Return the findings of those claims that need no figure."""
    found: dict[str, Finding] = {}
    for claim in CLAIMS:
        with suppress(NoFigureError):
            found[claim.identifier] = claim.check(Evidence(no_figure))
    return found


@pytest.fixture(scope="module")
def without_figures() -> dict[str, Finding]:
    return findings_without_figures()


def check_form(claim: Claim, finding: Finding) -> None:
    numbers = [finding.computed, finding.difference]
    assert all(isfinite(number) for number in numbers if isinstance(number, float))
    for text in (claim.statement, finding.remark, str(claim.printed), str(finding.computed)):
        assert "\n" not in text
        assert not re.search(r"\b(nan|inf)\b", text)
        assert "  " not in text
    undecidable = finding.verdict is Verdict.UNDECIDABLE
    assert (finding.computed is None) == undecidable
    if finding.verdict is not HOLDS:
        assert finding.remark
    if isinstance(claim.printed, float):
        assert isinstance(finding.computed, float)
        assert finding.difference == pytest.approx(finding.computed - claim.printed, abs=1e-9)
        assert (finding.verdict is HOLDS) == agrees(claim.printed, finding.computed)


def test_claims_have_an_identifier_of_their_own() -> None:
    identifiers = [claim.identifier for claim in CLAIMS]
    assert len(set(identifiers)) == len(identifiers)
    assert all(re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", identifier) for identifier in identifiers)
    assert sum(len(chapter.claims) for chapter in CHAPTERS) == len(CLAIMS)


@pytest.mark.long
def test_what_is_computed_are_the_decidable_claims(without_figures: dict[str, Finding]) -> None:
    undecidable = [
        n for n, found in without_figures.items() if found.verdict is Verdict.UNDECIDABLE
    ]
    assert sorted([*COMPUTATIONS, *undecidable]) == sorted(claim.identifier for claim in CLAIMS)


def test_every_equation_and_every_figure_has_a_claim() -> None:
    places = "\n".join(claim.place for claim in CLAIMS)
    for number in range(1, 31):
        assert re.search(rf"eq\. {number}\b", places), number
    for number in NUMBERS:
        assert re.search(rf"Fig\. ({number}|8 and {number})\b", places), number


@pytest.mark.long
def test_claims_about_equations_need_no_figure(without_figures: dict[str, Finding]) -> None:
    assert len(without_figures) > 100
    for claim in CLAIMS:
        if claim.identifier in without_figures:
            check_form(claim, without_figures[claim.identifier])


@pytest.mark.long
def test_another_printed_number_gets_another_verdict(without_figures: dict[str, Finding]) -> None:
    tried = 0
    for claim in CLAIMS:
        if isinstance(claim.printed, float) and claim.identifier in without_figures:
            finding = without_figures[claim.identifier]
            confirmed = replace(claim, printed=round(finding.computed, 6))
            assert confirmed.check(Evidence(no_figure)).verdict is HOLDS
            wrong = replace(claim, printed=round(claim.printed + 0.0371, 4))
            assert wrong.check(Evidence(no_figure)).verdict is FAILS
            tried += 1
    assert tried > 20


@given(
    st.integers(-(10**6), 10**6).filter(lambda n: n % 10 != 0),
    st.integers(1, 8),
    st.floats(-0.49, 0.49),
)
def test_a_number_agrees_with_what_it_rounds_to(units: int, digits: int, rest: float) -> None:
    unit = 10.0**-digits
    printed = round(units * unit, digits)
    assert agrees(printed, printed + rest * unit)
    assert not agrees(printed, printed + (rest + 1.0) * unit)


def judged(result: Result, printed: float | str | None = None, words: str = "") -> Finding:
    """Return the finding for a claim with this result, whose row has these words."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(COMPUTATIONS, "some", lambda _: result)
        claim = Claim("some", "eq. 1", "It is so", printed, words, words)
        return claim.check(Evidence(no_figure))


def test_verdict_on_a_number() -> None:
    for value, corrected, verdict in (
        (0.4944, 0.1, HOLDS),
        (0.48876, 0.49441, CORRECTED),
        (0.48876, 0.4943, FAILS),
    ):
        finding = judged(Number(value, {"With x": corrected}), 0.4944, "So it is.")
        assert (finding.verdict, finding.computed) == (verdict, value)
        assert finding.remark.startswith("With x: 0.49441.") == (verdict is CORRECTED)
        assert finding.remark.endswith("So it is.")


def test_verdict_on_a_formula() -> None:
    for printed, corrected, *expected in (
        ([1.0, 2.0 + 1e-12], [0.0, 0.0], HOLDS, 0.0),
        ([1.0, 2.5], [1.0, 2.0], CORRECTED, 0.5),
        (None, [1.0, 2.0], CORRECTED, None),
        ([1.0, 2.5], [1.0, 2.1], FAILS, 0.5),
        (None, [1.0, 2.1], FAILS, None),
    ):
        finding = judged(Formula(printed, [1.0, 2.0], {"With x": corrected}), "a = b")
        assert [finding.verdict, finding.difference] == expected


def test_verdict_on_a_statement() -> None:
    for holds, corrected, verdict in (
        (True, False, HOLDS),
        (True, True, HOLDS),
        (False, True, CORRECTED),
        (False, False, FAILS),
    ):
        assert judged(Observation(holds, corrected)).verdict is verdict


def test_words_of_a_row_contain_the_values_of_its_function() -> None:
    result = Observation(True, some=[0.123456, 2.0], z=1.0 - 2.0j, n=3)
    words = "{some} or {some:.1f}, {z}, {OPEN.hopf.angular_frequency:.2f}, {n}, {STUDIED_SPEED:g}"
    finding = judged(result, None, words)
    assert finding.computed == "0.1235, 2 or 0.1, 2.0, 1.0000 - 2.0000 i, 1.00, 3, 0.49"
    assert finding.remark == finding.computed


def sigma_of_coefficients(q: Nonlinearity) -> float:
    """Hassard, Kazarinoff and Wan, ch. 2: Re c1(0)."""
    sigma = 1j * q.g20 * q.g11 / (2.0 * q.frequency) + q.cubic / 2.0
    if len(q.second) == 3:
        sigma += (2.0 * q.g110 * q.w11 + q.g101 * q.w20) / 2.0
    return sigma.real


def test_the_coefficients_make_up_the_first_lyapunov_coefficient() -> None:
    for q in [*samples(2), *samples(3)]:
        assert sigma_of_coefficients(q) == pytest.approx(q.sigma, rel=1e-9)


def test_the_nonlinearity_of_the_open_loop() -> None:
    speed = OPEN.hopf.belt_speed
    q = Nonlinearity.at(at(speed).expansion)
    assert q.g20 == pytest.approx(-0.9j * speed, rel=1e-9)
    assert q.g11 == pytest.approx(0.9j * speed, rel=1e-9)
    assert q.cubic == pytest.approx(-0.45, rel=1e-9)


@pytest.mark.parametrize("cubic", [0.0, -3.0])
def test_the_nonlinearity_of_the_closed_loop(cubic: float) -> None:
    d, p = 2.0, 0.43 - 1.8 * 0.4**2
    gains = replace(FILTER, linear_gain=d - p - d / (1.0 - p * d), cubic_gain=cubic)
    at_critical_gain = at(0.4, gains=gains).expansion
    q = Nonlinearity.at(at_critical_gain)
    assert q.frequency == pytest.approx(np.sqrt(1.0 - p * d), rel=1e-9)
    assert sigma_of_coefficients(q) == pytest.approx(
        at_critical_gain.first_lyapunov_coefficient, rel=1e-9
    )


def verdict(identifier: str, figure: PaperFigure | None = None) -> Finding:
    (claim,) = (claim for claim in CLAIMS if claim.identifier == identifier)
    return claim.check(Evidence(lambda number: figure or no_figure(number)))


def test_enough_stiffness_ends_the_sticking() -> None:
    finding = verdict("fig-10-end")
    assert finding.verdict is HOLDS
    overruns, never = 43.12, 839.0
    assert f"Above stiffness {overruns:g} " in finding.remark
    assert finding.computed == f"from stiffness {never:g} on"
    # From rest, without shooting: what the slide does on either side of these stiffnesses.
    stiffnesses = (overruns - 0.1, overruns + 0.1, never - 1.0, never + 1.0)
    ends = [portrait_of(PortraitCase("", unit_drive(0.2, stiffness=k))) for k in stiffnesses]
    fastest = [float(end.last_cycles.velocity.max()) for end in ends]
    assert fastest[0] == pytest.approx(0.2, rel=1e-12)
    assert all(speed > 0.2 * (1.0 + 1e-9) for speed in fastest[1:])
    assert [end.measures.regime for end in ends] == [Regime.STICK_SLIP] * 3 + [Regime.PURE_SLIP]


def test_under_the_printed_slope_the_stick_fraction_rises_with_the_damping_and_falls() -> None:
    law = Linear(STRIBECK.static, PRINTED_SLOPE)
    betas = (0.12, 0.15, 0.17, 0.18, 0.2, 0.3)
    drives = [unit_drive(0.2, damping=2.0 * beta, friction=law) for beta in betas]
    ends = [portrait_of(PortraitCase("", d)).measures.stick_fraction for d in drives]
    assert ends == sorted(ends[:4]) + sorted(ends[4:], reverse=True)
    assert [len(Loop(drive).arrivals) for drive in drives] == [2, 2, 2, 1, 1, 1]


def test_verdicts_survive_ten_times_the_range() -> None:
    speeds = BifurcationFigure(2, np.array([0.02, 0.05, 0.2, 0.34, 0.6, 1.0, 3.0, 10.0]))
    assert verdict("rest-at-high-speed", speeds).verdict is HOLDS
    assert verdict("eq-3-range", speeds).verdict is CORRECTED
    stiffnesses = BifurcationFigure(4, np.array([0.02, 0.2, 1.0, 5.0, 50.0]))
    assert verdict("fig-4-influence", stiffnesses).verdict is CORRECTED
    minima = (0.001, 0.01, 0.1, 0.25, 0.37, 0.39, 0.399)
    drives = [unit_drive(0.4, friction=replace(STRIBECK, minimum=m)) for m in minima]
    gaps = Portraits(portrait_of(PortraitCase("", drive)) for drive in drives)
    figure = PortraitFigure(11, "", (Panel("", gaps),))
    assert verdict("fig-11-amplitude", figure).verdict is HOLDS
    wide = {
        2: speeds,
        3: BifurcationFigure(3, np.array([0.0, 0.01, 0.05, 0.5])),
        5: BifurcationFigure(5, np.array([1.0, 1.1, 2.0, 11.0])),
    }
    (claim,) = (claim for claim in CLAIMS if claim.identifier == "what-inhibits")
    assert claim.check(Evidence(wide.__getitem__)).verdict is HOLDS
