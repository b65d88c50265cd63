"""Records filtered for regression."""

import numpy as np

from benchmarks import identification as study
from stickslip_ros.identification.filtered import filtered
from stickslip_ros.identification.identify import identify


def test_rows_near_sticking_are_not_those_of_measured_friction() -> None:
    own = study.record("stribeck", "stick", 1, 2.5)
    columns = filtered(own, decimated=False)
    assert 50 < np.count_nonzero(columns.settled) < np.count_nonzero(columns.slipping)
    found = identify([own], "stribeck", {"mass": study.MASS, "normal_force": study.NORMAL_FORCE})
    errors = found.errors()
    law = study.LAWS["stribeck"]
    true = study.NORMAL_FORCE * np.array(
        [float(law.coefficient(each, np.sign(each))) for each in errors.relative_speed.tolist()]
    )
    away = np.abs(-errors.friction - true)
    assert np.quantile(away, 0.9) < 8.0
