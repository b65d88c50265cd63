"""From recordings to a model: which law, which constants, how sure."""

from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite

from stickslip_ros.errors import InvalidInputError
from stickslip_ros.identification.axes import AXIS_LAWS, AxisTask
from stickslip_ros.identification.choice import AUTO, choose
from stickslip_ros.identification.drives import DriveTask
from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.foreign_laws import foreign_adapter, foreign_names
from stickslip_ros.identification.identified_law import DELAY, IdentifiedLaw
from stickslip_ros.identification.laws import COMPETING, KNOWN_LAWS, TableAdapter
from stickslip_ros.identification.record import Record
from stickslip_ros.identification.regression import Regression
from stickslip_ros.identification.regression_rows import LINEAR
from stickslip_ros.identification.table_adjustment import adjusted
from stickslip_ros.identification.time_limit import TimeLimit
from stickslip_ros.model.constants import constants_of
from stickslip_ros.model.friction import LAWS
from stickslip_ros.quantities import number_of
from stickslip_ros.scenarios.keywords import described
from stickslip_ros.text import must_be_one_of

FIXABLE = (
    *LINEAR,
    "normal_force",
    DELAY,
    *dict.fromkeys(f"friction.{name}" for law in KNOWN_LAWS.values() for name in law.fixable),
)
"""Constants that can be given, by parameter of the plant, of the laws of this package."""
_CONSTANTS = {name for law in LAWS.values() for name in constants_of(law)}
"""Constants of friction laws, those of other packages among them."""
AUTO_TIME = 60.0
"""Work that the choice of a law may take by default, in s of a usual processor."""
_FITTING_SHARE = 0.8
"""Share of the time for fits: a step that has begun ends, and predictions follow."""
_DELAYS = -1.0, 20.0
"""Delays that can be given, sample periods."""
_SAME_PERIOD = 0.01
"""Share by which sample periods of recordings that are fitted together may differ."""


def constants(fixed: Mapping[str, float | str]) -> dict[str, float]:
    """Return known constants by parameter of the plant, SI units, from those by NODE.PARAMETER.

    Raises InvalidInputError for one that cannot be given, or has no such value.
    """
    return {target.removeprefix("plant."): _constant(target, fixed[target]) for target in fixed}


def fixed_of(texts: Sequence[str]) -> dict[str, float]:
    """Return constants from texts `plant.PARAMETER=VALUE`, by NODE.PARAMETER.

    Raises InvalidInputError for a text that is none.
    """
    fixed: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        target = name.strip()
        if not equals or target in fixed:
            raise InvalidInputError(
                f"--fix {text}: must be plant.PARAMETER=VALUE, each parameter once, as in "
                "plant.mass=95"
            )
        fixed[target] = _constant(target, value)
    return fixed


def _constant(target: str, value: float | str) -> float:
    """Return a constant by NODE.PARAMETER in SI units; refuse one that cannot be given."""
    name = target.removeprefix("plant.")
    of_friction = name.removeprefix("friction.") in _CONSTANTS and name.startswith("friction.")
    if target == name or not (name in FIXABLE or of_friction):
        raise InvalidInputError(f"{target} is invalid: {_allowed(target)}")
    return number_of(target, value, described(target).unit)


def identify(
    records: Sequence[Record],
    law: str = AUTO,
    fixed: Mapping[str, float] | None = None,
    progress: Callable[[str], None] = lambda _: None,
    time_limit: float = AUTO_TIME,
) -> Findings:
    """Identify a drive from records of one machine, with a law or with `AUTO`.

    A belt that is at rest in all records means an axis that no spring holds, unless a stiffness is
    given: then, and on a belt that moves, the slide is on a spring. `fixed` has the known
    constants, of `FIXABLE`, beside the delay that a record may have. `progress` receives the name
    of each law before it is fitted. `AUTO` ends after the work that a processor usually does in
    `time_limit`, s, with the best law so far; a single law takes its time. Raises
    InvalidInputError if a name or a value is not allowed, or no model is identifiable.
    """
    if not records:
        raise InvalidInputError("no recording is given: must be at least one")
    delays = [record.delay for record in records if record.delay is not None]
    fixed = ({DELAY: delays[-1]} if delays else {}) | dict(fixed or {})
    laws = _laws(law)
    fixable = {*FIXABLE, *(f"friction.{name}" for kind in laws for name in kind.fixable)}
    for name, value in fixed.items():
        if name not in fixable:
            raise InvalidInputError(f"plant.{name} is invalid: {_allowed(f'plant.{name}')}")
        _check_value(name, value, records[0].period)
    _check_records(records)
    moving = any(record.belt_velocity.any() for record in records)
    spring = fixed["stiffness"] > 0.0 if "stiffness" in fixed else moving
    if (
        not spring
        and law not in (AUTO, *AXIS_LAWS)
        and any(kind.memory or not kind.identifiable_in_slip for kind in laws)
    ):
        raise InvalidInputError(
            f"law {law} is refused for a drive without a spring: must be one of {AUTO}, "
            f"{', '.join(AXIS_LAWS)}"
        )
    _check_friction(fixed, law, laws, spring=spring)
    if not time_limit > 0.0:
        raise InvalidInputError(f"time limit {time_limit:g} s is invalid: must be above 0 s")
    limit = TimeLimit(_FITTING_SHARE * time_limit if law == AUTO else inf)
    task = (DriveTask if spring else AxisTask)(records, fixed, limit)
    candidates = task.candidates(law, laws, progress)
    in_choice = [candidate for candidate in candidates if law != AUTO or not candidate.remark]
    chosen, as_good = choose(in_choice or candidates)
    if isinstance(chosen, Regression):
        chosen.require("mass")
        # What bristles do near reversals is none of the curve's: a free run has it.
        if chosen.law.name == TableAdapter.name and chosen.rows.parts[0].path is None:
            chosen = adjusted(chosen, records)
    return Findings(records, candidates, chosen, as_good, fixed, task.left)


def _laws(law: str) -> Sequence[IdentifiedLaw]:
    """Return the laws with constants that are fitted: those that compete, or the one named."""
    if law in (AUTO, TableAdapter.name):
        return COMPETING if law == AUTO else ()
    named = KNOWN_LAWS.get(law) or foreign_adapter(law)
    if named is None:
        known = (AUTO, TableAdapter.name, *KNOWN_LAWS, *foreign_names())
        raise InvalidInputError(f"law {law} is invalid: {must_be_one_of(law, known)}")
    return (named,)


def _allowed(name: str) -> str:
    """Return the end of a message that refuses a constant."""
    return must_be_one_of(name, [f"plant.{constant}" for constant in FIXABLE])


def _check_value(name: str, value: float, period: float) -> None:
    """Refuse a constant that no drive has."""
    if name == DELAY:
        low, high = (periods * period for periods in _DELAYS)
        allowed = f"from {low:.4g} s to {high:.4g} s, {_DELAYS[0]:g} to {_DELAYS[1]:g} periods"
        right = low <= value <= high
    elif name == "bias_force":
        right, allowed = isfinite(value), "a finite number"
    elif name in ("mass", "normal_force"):
        right, allowed = 0.0 < value < inf, "a number above 0"
    else:
        right, allowed = 0.0 <= value < inf, "a number of 0 or more"
    if not right:
        raise InvalidInputError(f"plant.{name} = {value} is invalid: must be {allowed}")


def _check_records(records: Sequence[Record]) -> None:
    """Refuse records that identify nothing, or have different sample periods."""
    first = records[0]
    for record in records:
        record.require_motion()
        if abs(record.period - first.period) > _SAME_PERIOD * first.period:
            raise InvalidInputError(
                f"{first.name} has a sample period of {first.period:.4g} s and {record.name} one "
                f"of {record.period:.4g} s: recordings that are fitted together must have the same"
            )


def _check_friction(
    fixed: Mapping[str, float], law: str, laws: Sequence[IdentifiedLaw], *, spring: bool
) -> None:
    """Refuse constants of friction that the law in question does not search by themselves."""
    searched = laws if spring and law != AUTO else ()
    known = [f"friction.{name}" for searched_law in searched for name in searched_law.fixable]
    for name in fixed:
        if name.startswith("friction.") and name not in known:
            allowed = ", ".join(f"plant.{constant}" for constant in known)
            raise InvalidInputError(
                f"plant.{name} cannot be fixed with the law {law} "
                f"{'on' if spring else 'without'} a spring: of friction "
                f"{f'only {allowed}' if allowed else 'no constant'} can be fixed there"
            )
