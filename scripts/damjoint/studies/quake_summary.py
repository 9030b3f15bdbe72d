"""What an earthquake amounts to, of either engine: peaks, rest, residual values, verdict, notes."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from .. import ROUND_OFF
from ..arrays import Array, Table, Value
from ..dynamics import ground_motion
from ..dynamics.record import Record
from ..dynamics.stepper import Earthquake
from ..input.case import Case
from ..model.results import column_of
from ..statics.hints import turbulence

#: Time over which the residual values are a mean [s]: the last half of the rest, at most this.
MEAN_OVER = 1.0

#: A joint is at rest if in this time its plastic slip changes at most by this share of its largest
#: slip; otherwise the verdict is `not at rest`.
REST_OF_SLIP = 0.01
#: The same of its openings, which still vibrate after the slip has ended.
REST_OF_OPENING = 0.1
#: Changes below this part of the dam's size count as none [-]: 0.01 mm of 45 m.
LEAST_MOTION = 2.2e-7

#: Slip in the time of the mean over that in the same time before it, from which on it does not
#: slow down.
STEADY = 0.8

#: Time steps in the first period that resolve a joint which opens and slips.
STEPS_OF_PERIOD = 30

#: Time steps in the period of a contact that resolve an impact.
STEPS_OF_IMPACT = 10

#: Broken part of a joint without friction beyond which nothing holds what is above it.
BROKEN = 0.99

#: Table of which the largest size is reported.
PEAKS = ("ground_ax", "crest_ux", "crest_ax")
PEAKS_OF_JOINTS = ("heel_opening", "toe_opening", "slip_mean", "open_length", "broken_length")
#: The same with quake_uplift = transient.
PEAKS_OF_WATER = "p_max", "void", "Re"

#: Those of the joint with the largest slip by their names in the summary of an earthquake: residual
#: slip [m] and tilt, slip of the rigid block [m]; empty if the dam is not at rest.
RESIDUAL = {"slip": "residual_slip", "tilt": "residual_tilt", "rigid_block": "rigid_block_slip"}
#: Intensities of the ground motion along x: largest acceleration and velocity, Arias' intensity,
#: pseudo-acceleration of an oscillator with the dam's first period, and their units.
INTENSITIES = {
    "peak_ground_ax": "m/s2",
    "peak_ground_vx": "m/s",
    "arias_x": "m/s",
    "spectral_ax": "m/s2",
}
#: Periods of the spectrum in a summary [s].
PERIODS = (0.1, 0.2, 0.5, 1.0, 2.0)

#: Columns of an earthquake in a table of several, with their units; the slip at the end, also of a
#: dam that is not at rest, and the largest opening are those of the same joint.
QUAKE_UNITS = {
    **dict(zip(("peak_ground_ax", *RESIDUAL.values()), ("m/s2", "m", "-", "m"), strict=True)),
    "end_slip": "m",
    "peak_opening": "m",
    **INTENSITIES,
}
QUAKE_COLUMNS = tuple(QUAKE_UNITS)

#: Normal force over its largest value up to which a joint that is open throughout carries none.
UNLOADED = 1e-3
#: Open part of a joint from which on it is open throughout.
OPEN = 0.999

#: Slip over the length of a joint beyond which displacements are not small.
LARGE_SLIP = 0.01

#: Verdicts besides those of a static state.
STANDS, NO_EQUILIBRIUM, NOT_AT_REST = "stands", "no equilibrium", "not at rest"
NO_FRICTION = "broken without friction"


def row_of_peak(name: str, values: Array) -> int:
    """The row in which a column of quake.csv is largest; an overlap of a joint is no opening."""
    return int(np.argmax(values if "opening" in name else np.abs(values)))


def summary(
    quake: Earthquake, rows: Table, halvings: int, resolves_impacts: bool = True
) -> dict[str, Any]:
    """Peaks with times, values at the end and at rest, modes, damping, notes; rows: quake.csv;
    resolves_impacts: whether the steps were halved where they do not, see dynamics/impact.py.
    """
    number = len(rows["time"])
    result: dict[str, Any] = {
        "record": str(quake.case.record),
        "duration": quake.record.duration,
        "time": float(rows["time"][-1]) if number else 0.0,
        "steps": number,
        "dt": quake.dt,
        "halvings": halvings,
        "iterations": float(rows["iterations"].sum()),
        "frequencies": quake.frequencies.tolist(),
        "modes": [asdict(mode) for mode in quake.modes],
        "damping": asdict(quake.damping),
        "quake_uplift": quake.case["quake_uplift"],
        "ground": intensities(quake.record, 1 / quake.frequencies[0]),
        "notes": notes(quake),
    }
    if not number:
        return result
    joints = range(len(quake.case.joints))
    peaks = {}
    of_water = [name for name in PEAKS_OF_WATER if name in rows]
    of_joints = [column_of(n, k) for k in joints for n in (*PEAKS_OF_JOINTS, *of_water)]
    for name in (*PEAKS, *of_joints):
        row = row_of_peak(name, rows[name])
        peaks[name] = {"value": float(rows[name][row]), "time": float(rows["time"][row])}
    for k, joint in enumerate(quake.case.joints):
        slip = abs(peaks[column_of("slip_mean", k)]["value"])
        if slip > LARGE_SLIP * joint.joint_length:
            result["notes"].append(
                f"the slip reaches {slip:.3g} m{of(quake.case, k)}: equilibrium is that of the "
                "undeformed dam, and the drains through the joint are taken as intact"
            )
    result["notes"] += lift_offs(quake, rows, resolves_impacts)
    if "Re" in rows:
        flows = ({n: rows[column_of(n, k)] for n in ("U", "Re")} for k in joints)
        words = map(turbulence, quake.case.joints, flows)
        result["notes"] += [f"{text}{of(quake.case, k)}" for k, text in enumerate(words) if text]
    return result | {"peaks": peaks} | values_at_end(quake.case, rows, 1 / quake.frequencies[0])


def intensities(record: Record, period: float) -> dict[str, Any]:
    """INTENSITIES of a record, its spectrum at PERIODS; period: the first one of the dam [s]."""
    times, along = record.times, record.acceleration[:, 0]
    first, *others = ground_motion.spectrum(times, along, np.array([period, *PERIODS])).tolist()
    return {
        "peak_ground_ax": float(np.abs(along).max()),
        "peak_ground_vx": float(np.abs(record.velocity(times)[:, 0]).max()),
        "arias_x": float(ground_motion.arias_growth(times, along)[-1]),
        "spectral_ax": first,
        "spectrum": [list(pair) for pair in zip(PERIODS, others, strict=True)],
    }


def lift_offs(quake: Earthquake, rows: Table, resolves_impacts: bool) -> list[str]:
    """Parts of the joints that open throughout and land again, with their numbers, in a line."""
    case, parts, shortest = quake.case, list[str](), math.inf
    for number, joint_case in enumerate(case.joints):
        normal = np.abs(rows[column_of("N", number)])
        opened = rows[column_of("open_length", number)] > OPEN * joint_case.joint_along
        lifted = opened & (normal < UNLOADED * normal.max())
        landings = np.count_nonzero(lifted[:-1] & ~lifted[1:])
        if not landings:
            continue
        if number in quake.contacts:
            shortest = min(shortest, quake.contacts[number].period)
        first, share = rows["time"][lifted][0], rows["dt"][lifted].sum() / rows["dt"].sum()
        where = case.named((number,)) or "the joint"
        start = f"; {where}: " if parts else f"what is above {where} lifts off and lands again, "
        parts.append(
            f"{start}{landings} time{'s' if landings > 1 else ''} from t = {first:.3f} s on, "
            f"{share:.0%} of the time"
        )
    if not parts:
        return []
    text = (
        f"{''.join(parts)}: the contact is elastic, without damping of an impact but by "
        "joint_damping_n"
    )
    if not resolves_impacts and shortest < STEPS_OF_IMPACT * quake.dt:
        text += (
            f"; the {'shortest ' * (len(parts) > 1)}period of the contact (the mass above on K_N), "
            f"{shortest:.3g} s, has {shortest / quake.dt:.2g} steps, too few for its impacts, "
            "which may add energy: what follows is not reliable, accelerations least; --engine "
            f"condensed shortens its steps there; compare with it or dt = "
            f"{shortest / STEPS_OF_IMPACT:.2g}"
        )
    return [text]


def notes(quake: Earthquake) -> list[str]:
    """What an engineer should know before the numbers of an earthquake."""
    period, texts = 1 / quake.frequencies[0], quake.record.offsets()
    longest = period / STEPS_OF_PERIOD
    if quake.dt > longest * (1 + ROUND_OFF):
        texts.append(
            f"dt = {quake.dt:.3g} s is longer than a thirtieth of the first period, {longest:.3g} "
            "s: the slip may depend on it; compare with half of it"
        )
    return texts


def values_at_end(case: Case, rows: Table, period: float) -> dict[str, Any]:
    """Whether the dam is at rest in the end, residual slip and tilt if it is, and the last values.

    rows: columns of quake.csv; period: the first one [s], shorter than which no rest is recognised.
    """
    time = rows["time"]
    shaken = np.flatnonzero((rows["ground_ax"] != 0) | (rows["ground_ay"] != 0))
    rest = float(time[-1] - (time[shaken[-1]] if len(shaken) else 0.0))
    length = min(MEAN_OVER, rest / 2)
    last = time > time[-1] - length + ROUND_OFF * time[-1]
    earlier = (time > time[-1] - 2 * length + ROUND_OFF * time[-1]) & ~last
    at_rest, steady, end, residual, broken = bool(length >= period), False, {}, {}, {}
    for k, joint in enumerate(case.joints):
        column = {name: rows[column_of(name, k)] for name in (*PEAKS_OF_JOINTS, "T")}
        slip, size = column["slip_mean"], joint.joint_length
        plastic = slip - column["T"] / (joint["K_T"] * size)  # its elastic part follows T
        openings = [np.maximum(column[n], 0.0) for n in ("heel_opening", "toe_opening")]
        rooms = REST_OF_SLIP * np.abs(slip).max(), REST_OF_OPENING * np.max(openings)
        moved = [float(np.ptp(values[last])) if length else 0.0 for values in (plastic, *openings)]
        moved_before = float(np.ptp(plastic[earlier])) if earlier.any() else 0.0
        limits = np.maximum([rooms[0], rooms[1], rooms[1]], LEAST_MOTION * case.size)
        at_rest &= bool((moved <= limits).all())
        steady |= bool(moved[0] > max(limits[0], STEADY * moved_before))
        end[column_of("slip", k)] = float(slip[-1])
        end[column_of("change", k)] = moved[0]
        end[column_of("change_before", k)] = moved_before
        if length:
            heel, toe, mean = (
                float(column[name][last].mean())
                for name in ("heel_opening", "toe_opening", "slip_mean")
            )
            residual[column_of("slip", k)] = mean
            residual[column_of("tilt", k)] = (heel - toe) / joint.joint_along
        if not joint.law.has_friction:
            broken[column_of("length", k)] = float(column["broken_length"][-1])
    return {
        "rest": rest,
        "mean_over": length,
        "at_rest": at_rest,
        "slides_on": bool(steady and length >= period),
        "end": end,
        "residual": residual if at_rest else {},
        "broken_without_friction": broken,
    }


def verdict(case: Case, summary: dict[str, Any]) -> str:
    """The verdict of a summary that has its `after`: STANDS or why not."""
    if not summary["after"]["equilibrium"]:
        return NO_EQUILIBRIUM
    if any(share > BROKEN for share in broken_shares(case, summary).values()):
        return NO_FRICTION
    return STANDS if summary["at_rest"] else NOT_AT_REST


def columns(case: Case, summary: dict[str, Any]) -> dict[str, Value]:
    """QUAKE_COLUMNS of a summary; empty where a value is not known."""
    residual, worst = summary["residual"], largest_slip(case, summary)
    slips = {column: residual.get(column_of(name, worst), "") for name, column in RESIDUAL.items()}
    openings = (summary["peaks"][column_of(n, worst)] for n in ("heel_opening", "toe_opening"))
    opening = max(0.0, *(peak["value"] for peak in openings))
    end = summary["end"][column_of("slip", worst)]
    row = {**slips, "end_slip": end, "peak_opening": opening, **summary["ground"]}
    return {name: row[name] for name in QUAKE_COLUMNS}


def largest_slip(case: Case, summary: dict[str, Any]) -> int:
    """The joint with the largest slip at the end, but for those between bodies that others hold."""
    slips = [
        -1 if case.graph.is_internal(k) else abs(summary["end"][column_of("slip", k)])
        for k in range(len(case.joints))
    ]
    return int(np.argmax(slips))


def broken_shares(case: Case, summary: dict[str, Any]) -> dict[int, float]:
    """The broken part of the joints, by their numbers, that have broken and have no friction."""
    lengths = summary["broken_without_friction"]
    return {
        k: length / joint.joint_length
        for k, joint in enumerate(case.joints)
        if (length := lengths.get(column_of("length", k), 0.0))
    }


def of(case: Case, joint: int) -> str:
    """The name of a joint, by its number, in brackets; empty if there is only one."""
    name = case.named((joint,))
    return f" ({name})" if name else ""


def in_millimetres(length: float, digits: int) -> str:
    """A length [m] in mm, without an exponent; 0 below a nanometre."""
    value = 1e3 * length
    if abs(value) < 1e-6:
        return "0"
    return f"{value:.0f}" if abs(value) >= 10**digits else f"{value:.{digits}g}"


def statement(case: Case, summary: dict[str, Any]) -> str:
    """What a summary says of the end of an earthquake."""
    joints = range(len(case.joints))
    parts = [
        f"law = {case.joints[k]['law']}{of(case, k)} has no friction, and the joint has broken "
        f"over {share:.0%} of its length (law = bond keeps the friction)"
        for k, share in broken_shares(case, summary).items()
    ]

    def millimetres(values: dict[str, float], name: str, k: int) -> str:
        return f"{in_millimetres(values[column_of(name, k)], 3)} mm"

    if summary["at_rest"]:
        slips = [millimetres(summary["residual"], "slip", k) + of(case, k) for k in joints]
        parts.append(f"residual slip {', '.join(slips)}")
    else:
        end, steady = summary["end"], summary["slides_on"]
        ends = [
            f"{millimetres(end, 'slip', k)}{of(case, k)}, changed by "
            f"{millimetres(end, 'change', k)}"
            + f", by {millimetres(end, 'change_before', k)} in the same time before"
            * steady
            for k in joints
        ]
        parts.append(
            f"not at rest in the last {summary['mean_over']:.3g} of {summary['rest']:.3g} s "
            f"without shaking, no residual slip: slip {'; '.join(ends)}; "
            + (SLIDES_ON + RADIATES * (not case["rock_mass"]) if steady else LONGER_REST)
        )
    parts.append(ENDS[verdict(case, summary)])
    return "; ".join(parts)


#: What is said of a dam that is not at rest; of one whose slip does not slow down, and on rock
#: without mass.
LONGER_REST = "set a longer record_rest"
SLIDES_ON = (
    "the sliding does not slow down: the static loads push the dam on whenever its vibration takes "
    "its weight off the joint, and their work keeps it vibrating, as long a record_rest as may be"
)
RADIATES = "; rock without mass takes no energy of it away: compare with rock_mass = 1"

#: The end of a statement, by its verdict.
ENDS = {
    STANDS: "the dam stands after the earthquake",
    NO_EQUILIBRIUM: "no static equilibrium is found after the earthquake",
    NOT_AT_REST: "whether the dam stands is not known",
    NO_FRICTION: "by this law nothing holds the joint: neither its slip nor whether the dam stands "
    "is known",
}
