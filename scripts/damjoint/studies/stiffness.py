"""What of a run's results moves with the stiffnesses of the joint, by repeating it.

K_N and K_T are hardly ever measured: a result that depends on them is as uncertain as they are,
over decades, for which a derivative does not stand.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from textwrap import wrap

import numpy as np

from .. import InputError, RunError
from ..input.case import Case
from ..input.resolve import varied
from ..model.results import Results
from ..post.summary import Table, aligned, fitted, formatted_table
from ..runner import compute
from ..statics import gravity
from ..statics.verdict import verdict
from ..units import LENGTHS, NUMBER, with_unit

#: Parameters by which a run can be repeated; factors of their values.
NAMES = "K_N", "K_T"
FACTORS = {" / 10": 0.1, " x 10": 10.0}


def named_in(text: str) -> list[str]:
    """The stiffnesses in a list of names, as of the option --sensitivity."""
    return [name for name in NAMES if name in map(str.strip, text.split(","))]


def meaning(case: Case) -> str:
    """What the stiffnesses of a case's first joint mean: its mean closure under the dam's weight,
    if the section is that of the parameters, and their ratios to the stiffness of the softer body,
    E/L with the joint's length L, E/h with that of an element.
    """
    joint = case.joints[0]
    young, length = min(joint["E_dam"], joint["E_found"]), joint.joint_length
    closure = ""
    if not case.geometry:
        weight = gravity.with_crack(joint, 0.0, 0.0, 0.0).N
        closed = with_unit(weight / (joint["K_N"] * length), LENGTHS, 3)
        closure = f"the weight closes the joint by {closed}; "
    h, name = length / joint["n_joint"], case.named((0,))
    return (
        f"K_N{name and f' of joint {name}'}: {closure}K_N L/E = "
        f"{joint['K_N'] * length / young:.3g}, K_N h/E = {joint['K_N'] * h / young:.3g}, "
        f"K_T/K_N = {joint['K_T'] / joint['K_N']:.3g}"
    )


def repetitions(
    case: Case, result: Results, names: Sequence[str], engine: str
) -> Iterator[tuple[str, Results | str]]:
    """The run and its repetitions, with what was changed; or why one has no results."""
    yield "as set", result
    for name in names:
        for label, factor in FACTORS.items():
            values = tuple(factor * joint[name] for joint in case.joints)
            try:
                changed = varied(case, {name: values if len(values) > 1 else values[0]})
                yield f"{name}{label}", compute(changed, engine, fields=False).result
            except (InputError, RunError) as error:
                yield f"{name}{label}", str(error)


#: Columns of the table: name in `last_state`, heading, units.
SHOWN = (
    ("level", "level", LENGTHS[:1]),
    ("crack_length", "crack", LENGTHS[:1]),
    ("slip_length", "slipped", LENGTHS[:1]),
    ("max_opening", "largest opening", LENGTHS),
    ("slip", "tangential jump", LENGTHS),
    ("crest_ux", "crest movement", LENGTHS),
)


def table(runs: Sequence[tuple[str, Results | str]]) -> tuple[Table, list[str]]:
    """The last state of each run and of each of its joints, and the messages of those without."""
    labels, rows, messages = [], [], []
    for label, result in runs:
        if isinstance(result, str):
            messages.append(f"{label}: {result}")
            continue
        for k, joint in enumerate(result.joints):
            labels.append((label, result.case.named((k,)), verdict(result)))
            rows.append(last_state(joint))
    columns = [(head, np.array([row[name] for row in rows]), units) for name, head, units in SHOWN]
    columns.append(("SSF", np.array([row["SSF"] for row in rows]), NUMBER))
    cells = formatted_table(columns)
    several = any(joint for _, joint, _ in labels)
    heads = ["run", *(["joint"] if several else [])]
    cells = Table(
        [*heads, *cells.names, "verdict"],
        [*[""] * len(heads), *cells.units, ""],
        [
            (label, *((joint,) if several else ()), *row, word)
            for (label, joint, word), row in zip(labels, cells.rows, strict=True)
        ],
    )
    return cells, messages


#: Columns that a narrow table leaves out, in this order.
LESS = ("level", "slipped", "tangential jump")
#: Columns that do not tell whether a joint's state changes: the crest's movement and the verdict
#: are of the dam, the tangential jump of a joint that holds is elastic, T/K_T.
NOT_OF_STATE = ("run", "tangential jump", "crest movement", "verdict")


def unchanged(cells: Table) -> list[str]:
    """Joints whose state is the same in all runs to the printed digits; one joint is left for the
    dam's values, the first.
    """
    if "joint" not in cells.names:
        return []
    joint = cells.names.index("joint")
    picked = [k for k, name in enumerate(cells.names) if name not in NOT_OF_STATE]
    states = {row[joint]: set[tuple[str, ...]]() for row in cells.rows}
    for row in cells.rows:
        states[row[joint]].add(tuple(row[k] for k in picked))
    _, *others = states
    return [name for name in others if len(states[name]) == 1]


def lines(runs: Sequence[tuple[str, Results | str]], width: int | None = None) -> list[str]:
    """The table as text, and the messages; width: of the terminal, None: all columns and joints."""
    cells, messages = table(runs)
    less = [] if width is None else unchanged(cells)
    rows = [row for row in cells.rows if not set(row[1:2]) & set(less)]
    draw = partial(aligned, left=2 if "joint" in cells.names else 1)
    text = [fitted(cells.names, cells.stacked, rows, LESS, width, draw)]
    if less and width is not None:
        text += wrap(
            f"({', '.join(less)}: no change but of the tangential jump; rows with --wide)", width
        )
    return [*text, *messages]


def last_state(result: Results) -> dict[str, float]:
    """The last row of a joint's history, its mean tangential jump [m] and its sliding factor."""
    last, case = result.last, result.case
    factor = np.inf
    if case.law.has_friction:
        factor = gravity.sliding_factor(case, last["N"], last["T"], last["bonded_length"])
    rows = result.at(last["time"]) if len(result.joint["time"]) else {}
    slip = float(np.mean(rows["delta_t1"])) if rows else np.nan
    return {**last, "SSF": factor, "slip": slip, "max_opening": max(last["max_opening"], 0.0)}
