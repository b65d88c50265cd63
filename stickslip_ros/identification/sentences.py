"""Sentences on what makes a model doubtful, and on what its recordings do not tell."""

from collections.abc import Mapping, Sequence
from math import isfinite, isinf

import numpy as np

from stickslip_ros.identification.findings import Findings
from stickslip_ros.identification.fit import OUT_OF_TIME
from stickslip_ros.identification.record import FEWEST, Record

_POOR_ERROR = 0.1
"""Error, as a share of the motion, from which a model does not describe it."""
_VAGUE_ERROR = 0.5
"""Standard error, as a share of the value, from which a constant counts as not identifiable."""
_FAR_SHARE = 0.3
"""Error of a free run, as a share of the motion, from which the fit says so."""
_USED_SHARE = 0.6
"""Share of the samples below which the fit says that it used some of them only."""
_MISSING_SHARE = 1e-3
"""Share of missing samples up to which nothing is said."""
_SPEEDS_OF_MACHINES = 1e-6, 20.0
"""Fastest speeds that a machine may have, m/s; others are in another unit."""
_ADDED_SHARE = 0.3
"""Share of samples with added forces from which another controller may have acted."""
_STATIC_SHARE = 1.1
"""Ratio of the largest force at rest to the static friction, above which a note is given."""
_BY_DIRECTION = "it merges with friction by direction, and is taken as 0"


def notes(findings: Findings) -> Sequence[str]:
    """Return sentences on what makes the model doubtful."""
    texts: list[str] = []
    if findings.chosen.error >= _POOR_ERROR:
        texts.append(
            f"the model does not describe the recordings: its error is {findings.chosen.error:.0%} "
            "of what it predicts; an input may be missing (a disturbance, the velocity of the "
            "belt), or have another sign or unit"
        )
    axis = not findings.chosen.has_spring
    if axis and not any(record.held_force.any() for record in findings.records):
        texts.append("no force is recorded: none is taken to act beside friction")
    if doubt := findings.chosen.doubt:
        texts.append(
            f"the law {findings.law} does not describe the recordings: {doubt}; the band of its "
            "curve includes the measured friction"
        )
    texts += _far_run(findings, findings.records[0])
    for name in dict.fromkeys(record.name for record in findings.records):
        records = [record for record in findings.records if record.name == name]
        texts += [f"{name}: {note}" for note in records[0].notes]
        missing = float(np.mean(np.concatenate([record.lost for record in records])))
        if missing > _MISSING_SHARE:
            fitted = ", and not fitted" if findings.chosen.has_spring else ""
            texts.append(
                f"{100.0 * missing:.2g} % of the samples of {name} are missing: they are "
                f"interpolated{fitted}"
            )
        if records[0].left_out > 0.0:
            texts.append(
                f"{100.0 * records[0].left_out:.2g} % of the samples of {name} are left out: they "
                f"are in parts of less than {FEWEST} samples between gaps"
            )
    if findings.left:
        texts.append(
            f"the limit of work was reached before {', '.join(findings.left)} were fitted to the "
            "end: raise it by --time-limit, or choose one law by --law"
        )
    if not _SPEEDS_OF_MACHINES[0] <= findings.fastest <= _SPEEDS_OF_MACHINES[1]:
        texts.append(
            f"the slide is as fast as {findings.fastest:.3g} m/s: check the units of time, "
            "position and belt velocity, unless the axis is rotary and this is in rad/s"
        )
    used = findings.chosen.used(findings.records)
    if used < _USED_SHARE:
        texts.append(
            f"{used:.0%} of the samples were used, in parts over the whole length: "
            "the recordings are long; choose a part by --from and --to"
        )
    if findings.chosen.repetition is not None:
        texts.append(
            f"the errors repeat every {findings.chosen.repetition} samples: the motion takes a "
            "whole number of samples, so that rounding does not average out; the intervals may be "
            "too narrow"
        )
    return texts


def _far_run(findings: Findings, record: Record) -> list[str]:
    """Return whether the free run through a record is far from its motion."""
    share = findings.free_run_error(record) / float(np.std(record.position))
    if share < _FAR_SHARE:
        return []
    worse = ", and worse than none" if share > 1.0 else ""
    return [
        f"{record.name}: the free run is off by {share:.0%} of the motion{worse}: a simulation "
        "without feedback does not follow the machine"
    ]


def notes_on(findings: Findings, record: Record) -> Sequence[str]:
    """Return sentences on what cannot be predicted of a record, and why."""
    known = [*record.notes, *_far_run(findings, record)]
    if findings.servo is None or record.reference is None or record.force is None:
        return known
    led = record.led
    if led is None:
        why = f"has no {FEWEST} samples in a row: the closed loop is not predicted"
        return [*known, f"the reference of {record.name} {why}"]
    share = float(np.mean(findings.servo.added(led) != 0.0))
    if share < _ADDED_SHARE:
        return known
    return [
        *known,
        f"the controller that was found does not explain {share:.0%} of the forces of "
        f"{record.name}: they are taken as forces added to its command; if another controller "
        "acted, its closed loop is not predicted",
    ]


def _static_friction(findings: Findings) -> str:
    """Return what rests tell of the static friction, where it may be another one than the law's."""
    texts: list[str] = []
    for sign, way in zip((1.0, -1.0), ("forward", "backward"), strict=True):
        if sign not in findings.chosen.directions:
            continue
        static, low, high = findings.static_forces(sign)
        known = isfinite(low) and isfinite(high)
        if known and not low <= static <= high <= _STATIC_SHARE * static:
            texts.append(
                f"{way} the slide rests under {low:.3g} N and moves at {high:.3g} N at the latest, "
                f"where the law has {static:.3g} N"
            )
    return ", ".join(texts)


def unidentified(findings: Findings) -> Mapping[str, str]:
    """Return why parameters of the plant are not identifiable, and the run that would help.

    Parameters are named as in `Findings.fitted`.
    """
    why = {
        "normal_force": "only friction forces are identifiable: it is taken as 1 N, so that "
        "coefficients are in N and viscous ones in N s/m; give it by --fix plant.normal_force=...",
        **(_with_spring if findings.chosen.has_spring else _without_spring)(findings),
    }
    known = {*findings.fixed, *findings.fitted} - {"friction.static"}
    why = {name: reason for name, reason in why.items() if name not in known}
    if findings.rivals:
        names = ", ".join([findings.chosen.label, *findings.rivals[:-1]])
        why["friction.law"] = (
            f"{names} and {findings.rivals[-1]} predict held-out parts alike, but differ in "
            "friction at speeds that were hardly recorded: the simplest is taken; run with "
            f"relative speeds from rest to {1e3 * findings.fastest:.3g} mm/s"
        )
    for name, estimate in findings.fitted.items():
        if estimate.standard_error < _VAGUE_ERROR * abs(estimate.value) or name in why:
            continue
        if findings.chosen.remark == OUT_OF_TIME:
            why[name] = f"{estimate.value:.4g} is from a fit that the limit of work ended"
            continue
        sure = f"{estimate.value:.4g} has a standard error of {estimate.standard_error:.2g}"
        if isinf(estimate.standard_error):
            sure = f"{estimate.value:.4g} is one of many values that fit alike"
        why[name] = f"{sure}; a run with other speeds and forces may identify it"
    return why


def _without_spring(findings: Findings) -> dict[str, str]:
    """Return why parameters of an axis are not identifiable."""
    one_direction = len(findings.chosen.directions) == 1
    why = {
        "damping": "viscous damping and the viscous part of friction are one where the belt is at "
        "rest: it is in the friction, and taken as 0",
        "stiffness": "no spring is looked for on a belt at rest: it is taken as 0; give it by "
        "--fix plant.stiffness=...",
        "bias_force": "it merges with the static friction of a single direction, and is taken as "
        "0; run in both directions"
        if one_direction
        else _BY_DIRECTION,
    }
    if findings.law != "coulomb":  # its static coefficient is that of slip
        why["friction.static"] = (
            "no row at rest is fitted: it is the curve at its slowest steady speed extended "
            f"to rest; {_slower(findings)}"
        )
    if at_rest := _static_friction(findings):
        why["friction.static"] = (
            f"it is that of slip; {at_rest}: the law stiction has static friction of its own, "
            "and a force that rises slowly from rest tells it"
        )
    return why


def _with_spring(findings: Findings) -> dict[str, str]:
    """Return why parameters of a drive on a spring are not identifiable."""
    why: dict[str, str] = {}
    if findings.one_belt_speed:
        why["damping"] = (
            "at one belt speed it merges with a linear part of friction, and is taken as 0; "
            "run at several belt speeds"
        )
    if len(findings.chosen.directions) == 1:
        why["bias_force"] = (
            "in one direction it merges with the static friction, and is taken as 0; run in "
            "both directions"
        )
    elif findings.chosen.by_direction:
        why["bias_force"] = _BY_DIRECTION
    if not findings.stuck and findings.law not in ("coulomb", "stiction", "dahl"):
        why["friction.static"] = (
            f"no record shows sticking: it is the curve extended to rest; {_slower(findings)}"
        )
    return why


def _slower(findings: Findings) -> str:
    return f"run below {1e3 * findings.slowest:.3g} mm/s"
