"""Segments of a run whose constants are known, as a search predicts them."""

from benchmarks import identification as study
from stickslip_ros.identification.identified_law import DELAY, LAG
from stickslip_ros.identification.laws import KNOWN_LAWS
from stickslip_ros.identification.predictor import Predictor
from stickslip_ros.identification.time_limit import TimeLimit
from stickslip_ros.identification.trajectories import Trajectories, segments_of

TRUE = {
    "mass": study.MASS,
    "stiffness": study.STIFFNESS,
    "damping": 0.0,
    "bias_force": 0.0,
    "static": study.NORMAL_FORCE * study.truth("coulomb", "taps")["friction.static"],
    "viscous": study.NORMAL_FORCE * study.truth("coulomb", "taps")["friction.viscous"],
    DELAY: 0.0,
    LAG: 0.0,
}
"""Coordinates of the run, SI units."""
FREE = ("mass", "stiffness", "static", "viscous")


def segments(seconds: float = float("inf")) -> Trajectories:
    """Return ten segments of a run with Coulomb friction, and the time that a search may take."""
    own = study.record("coulomb", "taps", seed=1, duration=0.8)
    parts = segments_of([Predictor(own)], 0.08)
    law, limit = KNOWN_LAWS["coulomb"], TimeLimit(seconds)
    return Trajectories(law, [-1.0], parts, study.NORMAL_FORCE, limit)
