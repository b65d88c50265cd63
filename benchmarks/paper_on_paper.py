"""Does a friction law fitted to two records of paper on paper predict two others?

J. Colas et al., Physical Review E, 2019: a slider of 30.7 g on paper, pulled by springs of three
stiffnesses at three speeds (`STICKSLIP_DATA`, or ../shared/data, has the records). Their cycles are
not alike, so that no trajectory can be fitted. Each law is fitted to the median period and drop of
two records, slip by slip, and then simulated for the others. Laws without a memory: stribeck,
exponential; with one: lugre. The smallest kinetic coefficient is the median of the
measured ones: a drop says nothing of it.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stickslip_ros.arrays import FloatArray
from stickslip_ros.errors import RunError
from stickslip_ros.installed_packages import versions
from stickslip_ros.measures.cycle_measures import Regime
from stickslip_ros.measures.slips import SlipThreshold, slip_report, slips_in
from stickslip_ros.model.drive import Drive
from stickslip_ros.model.friction import Exponential, FrictionLaw, LuGre, Stribeck
from stickslip_ros.motion import Motion
from stickslip_ros.record.table_file import table_of
from stickslip_ros.record.table_quantities import quantities_of

DATA = Path(
    os.environ.get("STICKSLIP_DATA", Path(__file__).parents[2] / "shared" / "data"),
    "paper_on_paper",
)
RECORDS = ((168, 42), (1002, 1100), (168, 4300), (2254, 1100))
"""Stiffness, N/m, and speed, um/s; the first two are fitted."""
FITTED = RECORDS[:2]
MASS, NORMAL_FORCE = 0.0307, 0.0307 * 9.81
LEAST_DROP = 6e-3
"""Drop of the spring's force that counts as a slip, N: above the noise of all records."""
RATE = 2000.0
_SETTLED, _SAMPLED = 15.0, 8.0
"""Time before, and of, the samples of a simulated motion, in periods that were measured."""
_MISSED = 3.0
"""Error, in factors of e, of a motion without slips."""
_SMALL, _SEED = 12, 1
_ROUNDS = 25


@dataclass(frozen=True)
class Law:
    """A friction law with the logarithmic ranges of its constants that are fitted."""

    make: Callable[..., FrictionLaw]
    ranges: Mapping[str, tuple[float, float]]


KINETIC = 0.33


def _exponential(rise: float, decay_speed: float, viscous: float) -> Exponential:
    return Exponential(
        static=KINETIC + rise, kinetic=KINETIC, decay_speed=decay_speed, viscous=viscous
    )


LAWS: dict[str, Law] = {
    "stribeck": Law(
        lambda rise, speed: Stribeck(KINETIC + rise, KINETIC, speed),
        {"rise": (3e-3, 0.1), "speed": (1e-4, 0.1)},
    ),
    "exponential": Law(
        _exponential, {"rise": (3e-3, 0.1), "speed": (1e-4, 0.03), "viscous": (1e-3, 30.0)}
    ),
    "lugre": Law(
        lambda rise, speed, viscous, stiffness, damping: LuGre(
            _exponential(rise, speed, viscous), stiffness, damping
        ),
        {
            "rise": (3e-3, 0.1),
            "speed": (1e-4, 0.03),
            "viscous": (1e-3, 30.0),
            "stiffness": (3e3, 1e5),
            "damping": (0.1, 100.0),
        },
    ),
}
"""Laws with the constants that are searched, dimensionless and in m/s, s/m, 1/m and m."""


@dataclass(frozen=True)
class Features:
    """The compared measures: of a motion that slides steadily, the regime alone."""

    regime: str
    period: float | None = None
    """Median time from slip to slip, s."""
    drop: float | None = None
    """Median drop of the spring's force, N."""


def features(time: FloatArray, position: FloatArray, stiffness: float) -> Features:
    """Return the features of a motion by its slips."""
    threshold = SlipThreshold(LEAST_DROP / stiffness)
    report = slip_report(slips_in(time, position, threshold), threshold, 0.0)
    if report["regime"] is None or report["count"] < 3:
        return Features(Regime.EQUILIBRIUM.value)
    period = float(np.median(np.diff(report["each"]["time"])))
    return Features(report["regime"].value, period, stiffness * report["drop"]["median"])


def measured(stiffness: int, speed: int) -> Features:
    """Return the features of a record."""
    columns = {"time": "t", "position": f"Fnorm*{NORMAL_FORCE / stiffness!r}"}
    path = DATA / f"k{stiffness}Nm_v{speed}.mat"
    found = quantities_of(table_of(path), columns).values
    known = np.isfinite(found["position"])  # spikes are left out
    return features(found["time"][known], found["position"][known], stiffness)


def simulated(friction: FrictionLaw, stiffness: int, speed: int, period: float) -> Features:
    """Return the features of a simulated motion; `period` is about that of the record, s."""
    drive = Drive(MASS, 0.0, float(stiffness), NORMAL_FORCE, 1e-6 * speed, friction)
    motion = Motion(drive, 0.9 * KINETIC * NORMAL_FORCE / stiffness, 0.0)
    try:
        motion.advance(_SETTLED * period)
        positions = np.empty(int(_SAMPLED * period * RATE))
        for number in range(len(positions)):
            motion.advance(1.0 / RATE)
            positions[number] = motion.position
    except RunError:
        return Features(Regime.UNBOUNDED.value)
    return features(np.arange(len(positions)) / RATE, positions, stiffness)


def misses(law: Law, logarithms: Sequence[float], truths: Mapping[Any, Features]) -> FloatArray:
    """Return the errors of the logarithms of period and drop for the fitted records."""
    friction = law.make(*np.exp(logarithms).tolist())
    if friction.refusal() is not None:
        return np.full(2 * len(FITTED), _MISSED)
    errors: list[float] = []
    for each in FITTED:
        true = truths[each]
        assert true.period is not None
        assert true.drop is not None
        found = simulated(friction, *each, true.period)
        if found.period is None or found.drop is None:
            errors += [_MISSED, _MISSED]
            continue
        errors += [np.log(found.period / true.period), np.log(found.drop / true.drop)]
    return np.array(errors)


def fitted(law: Law, truths: Mapping[Any, Features]) -> dict[str, float]:
    """Return the constants of a law that fit the records best."""
    from scipy.optimize import differential_evolution, minimize

    bounds = [np.log(each).tolist() for each in law.ranges.values()]

    def loss(logarithms: Sequence[float]) -> float:
        return float(np.sum(misses(law, logarithms, truths) ** 2))

    found = differential_evolution(
        loss, bounds, popsize=_SMALL, maxiter=_ROUNDS, seed=_SEED, polish=False, init="sobol"
    )
    found = minimize(loss, found.x, method="Nelder-Mead", bounds=bounds, options={"maxfev": 150})
    return dict(zip(law.ranges, np.exp(found.x).tolist(), strict=True))


def study(names: Sequence[str]) -> dict[str, Any]:
    """Return what each law predicts of each record."""
    truths = {each: measured(*each) for each in RECORDS}
    rows: list[dict[str, Any]] = [
        {"law": "measured", "stiffness": k, "speed": v, **vars(truths[k, v])} for k, v in RECORDS
    ]
    constants: dict[str, dict[str, float]] = {}
    for name in names:
        law = LAWS[name]
        constants[name] = fitted(law, truths)
        print(name, constants[name], file=sys.stderr, flush=True)
        for k, v in RECORDS:
            period = truths[k, v].period
            assert period is not None
            found = simulated(law.make(*constants[name].values()), k, v, period)
            rows.append({"law": name, "stiffness": k, "speed": v, **vars(found)})
            print(rows[-1], file=sys.stderr, flush=True)
    return {
        "rows": rows,
        "constants": constants,
        "kinetic": KINETIC,
        "fitted": [list(each) for each in FITTED],
        "versions": versions(),
    }


def main() -> None:
    """Write the study as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--laws", nargs="*", choices=LAWS, default=[*LAWS])
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    text = json.dumps(study(arguments.laws), indent=1) + "\n"
    if arguments.out is None:
        print(text, end="")
    else:
        arguments.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
