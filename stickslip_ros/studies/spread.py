"""Drives that a drive may be: constants off by a share, or as a fit leaves them open."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.scenarios.files import Scenario

Spread = float | str
"""Largest deviation of constants, as a share, or `FIT`."""
FIT = "fit"
"""Spread of the constants that `stickslip identify --out` keeps in a scenario."""
_TRIES = 100
"""Draws of constants until a drive has them: a mass is not below zero."""


def check_spread(spread: Spread) -> None:
    """Raise InvalidInputError unless the spread is from 0 to 0.9, or `FIT`."""
    if spread != FIT and not (isinstance(spread, int | float) and 0.0 <= spread <= 0.9):
        raise InvalidInputError(f"spread {spread}: must be from 0 to 0.9, or {FIT}")


def spread_text(spread: Spread) -> str:
    """Return how far constants are off, in words."""
    return "as its fit leaves them open" if spread == FIT else f"off by up to {spread:.0%}"


def held_interval(held: int, cases: int) -> tuple[float, float]:
    """Return the 95 % interval of a share of independent cases.

    Source: Clopper and Pearson, Biometrika 26, 1934.
    """
    from scipy.special import betaincinv  # takes long to import

    ends = betaincinv([held, held + 1], [cases - held + 1, cases - held], [0.025, 0.975])
    low, high = np.where(np.isnan(ends), [0.0, 1.0], ends).tolist()  # of all cases, or none
    return low, high


def drawn(scenario: Scenario, seed: int, spread: Spread) -> dict[str, float]:
    """Return constants of the drive that are off, by NODE.PARAMETER.

    With a share, each constant with a unit but the belt speed and the bias force is multiplied by a
    factor of its own, uniformly distributed; coefficients of friction change with the normal force.
    With `FIT` all that were fitted are normally distributed around the values of the scenario.
    Raises InvalidInputError without such a fit.
    """
    plant, rng = scenario.plant, np.random.default_rng((seed, 1))
    values, known = plant.flat(), plant.known
    if isinstance(spread, str):
        return _fitted(scenario, values, rng)
    changes: dict[str, float] = {}
    for name in plant.drive_names():
        if known[name].unit and name not in ("belt_speed", "bias_force") and values[name]:
            factor = 1.0 + spread * float(rng.uniform(-1.0, 1.0))
            changes[f"plant.{name}"] = values[name] * factor
    return changes


def _fitted(
    scenario: Scenario, values: dict[str, Any], rng: "np.random.Generator"
) -> dict[str, float]:
    where = f"spread {FIT}: {scenario.path}"
    names: Sequence[str] = scenario.fit.get("names", ())
    if not any(name.startswith("plant.friction.") for name in names):
        raise InvalidInputError(
            f"{where} has no intervals of friction constants: must be a scenario that `stickslip "
            "identify --out` has written, with a law of friction"
        )
    errors = np.array(scenario.fit["standard_errors"], float)
    for name, error in zip(names, errors.tolist(), strict=True):
        if not np.isfinite(error):
            raise InvalidInputError(f"{where}: {name} is not identifiable: its error is unbounded")
    shares = np.reshape(np.array(scenario.fit["correlations"], float), 2 * (len(names),))
    covariance = shares * np.outer(errors, errors)
    middle = [values[name.removeprefix("plant.")] for name in names]
    for _ in range(_TRIES):
        sample = rng.multivariate_normal(middle, covariance, method="eigh")
        changes = dict(zip(names, sample.tolist(), strict=True))
        try:
            scenario.changed(changes)
        except InvalidInputError:
            continue
        return changes
    raise InvalidInputError(f"{where}: hardly any constants within its errors are those of a drive")
