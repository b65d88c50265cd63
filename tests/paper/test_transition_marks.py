"""What theory adds to the paper's bifurcation diagrams."""

import numpy as np
import pytest

from stickslip_ros.paper.figures import compute_figure
from stickslip_ros.paper.transition_marks import transition_marks, unstable_equilibria


def test_equilibria_are_unstable_up_to_the_hopf_speed() -> None:
    figure = compute_figure(2, points=11)
    found = unstable_equilibria(figure)
    # Eq. 9: v_b1 = 0.4888. On a belt at rest there is no equilibrium of slip.
    assert np.isfinite(found).tolist() == [False, *[True] * 4, *[False] * 6]
    # Eq. 6: X0 = mu_s - a v0 + b v0^3.
    values = figure.values[1:5]
    assert found[1:5] == pytest.approx(0.4 - 0.45 * values + 0.6 * values**3, rel=1e-12)


def test_the_last_of_each_transition_is_marked() -> None:
    marks = transition_marks(compute_figure(2, points=11))
    assert marks["Hopf point"] == pytest.approx(0.48876, abs=1e-5)
    assert marks["limit of sticking"] == pytest.approx(0.4395, abs=1e-3)
