"""Checks: the finite elements' answer at the last level beside the gravity method's, with the
factors that the case requires; load combinations are cases that include a common file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tabulate import tabulate

from .. import InputError
from ..engines import engine_of
from ..model.case import Case
from ..model.fields import along
from ..model.results import HISTORY, Results
from ..post import folder as folders
from ..post.check_picture import SIGN, draw_check
from ..post.tables import write_csv
from ..post.units import FORCES, MOMENTS, STRESSES, unit
from ..run import run
from ..statics import gravity, verdict
from ..statics.gravity import GravityMethod

FINITE_ELEMENTS, GRAVITY = "finite elements", "gravity method"
LONGER = "gravity method, longer crack"
DIFFERENCE, REQUIRED = "difference", "required"
#: The verdict where nothing fails and nothing is required; what a case can require.
UNCHECKED, REQUIREMENTS = "not checked", ("required_SSF", "required_OSF", "f_c")

#: Columns of check.csv: a row per scene and answer at the last level, and one of differences.
CHECK = {
    "case": ("", "name of the case"),
    "answer": (
        "",
        "finite elements, gravity method (also with a longer crack), difference of the first two",
    ),
    "uplift": ("", "water in the joint"),
    "load": ("", "full; partial: the run stopped before its last t, where all loads are there"),
    "time": HISTORY["time"],
    **{name: HISTORY[name] for name in ("level", "tail_level", "N", "T", "M", "U", "x_resultant")},
    "sigma_n_heel": ("Pa", "total normal stress at the heel, compression < 0"),
    "sigma_n_toe": ("Pa", "total normal stress at the toe, compression < 0"),
    "sigma_n_eff_heel": ("Pa", "effective normal stress at the heel, compression < 0; 0: cracked"),
    "sigma_n_eff_toe": ("Pa", "effective normal stress at the toe, compression < 0"),
    "crack_length": HISTORY["crack_length"],
    "SSF": ("-", "sliding: (mu N + adhesion (length - crack_length)) / T"),
    "OSF": ("-", "overturning: stabilising over overturning moments about the toe"),
    "position": ("", "where N meets the joint: middle third, middle half, within base, outside"),
    "required_SSF": ("-", "what the case requires; 0: nothing"),
    "required_OSF": ("-", "what the case requires; 0: nothing"),
    "f_c": ("Pa", "compressive strength at the toe; 0: not checked"),
    "verdict": ("", "pass or fail; not checked: nothing fails, and nothing is required"),
    "why": ("", "why it fails"),
}

#: The columns of check.csv that are numbers which the two answers share.
NUMBERS = tuple(CHECK)[list(CHECK).index("level") : list(CHECK).index("OSF") + 1]

#: What the printed table shows: heading by column, in groups that share a unit.
SHOWN = (
    ((("m", 1),), {"level": "level"}),
    (FORCES, {"N": "N'", "T": "T", "U": "U"}),
    (MOMENTS, {"M": "M"}),
    ((("m", 1),), {"x_resultant": "N' at x"}),
    (STRESSES, {"sigma_n_eff_heel": "eff. heel", "sigma_n_eff_toe": "eff. toe"}),
    ((("m", 1),), {"crack_length": "crack"}),
    ((("-", 1),), {"SSF": "SSF", "OSF": "OSF"}),
)


@dataclass(frozen=True)
class Answer:
    """What one method says of a scene at its last level."""

    case: Case
    by: str
    #: t of the state; nan if there is none
    time: float
    #: NUMBERS in SI units; nan where there is none
    numbers: Mapping[str, float]
    #: why there is no equilibrium; empty if there is one
    statement: str = ""
    #: whether it is for a part of the case's loads only
    partial: bool = False

    @property
    def fails(self) -> list[str]:
        """Why it fails: the statement, and each check that is not met."""
        case, found = self.case, self.numbers
        said = [
            f"{name} {found[name]:.4g} < {value:g}"
            for name, value in required(case).items()
            if found[name] < value
        ]
        if case["f_c"] and -found["sigma_n_toe"] > case["f_c"]:
            pressed = f"compression {-found['sigma_n_toe']:.4g} Pa at the toe"
            said.append(f"{pressed} > f_c = {case['f_c']:g} Pa")
        return [self.statement, *said] if self.statement else said

    @property
    def verdict(self) -> str:
        """fail; pass if the case requires something; else not checked."""
        return "fail" if self.fails else "pass" if requires(self.case) else UNCHECKED

    @property
    def length(self) -> float:
        """Of the joint [m]."""
        return self.case.section["joint_length"][0]

    @property
    def row(self) -> dict[str, float | str]:
        """Its row of check.csv."""
        return {
            "case": self.case.name,
            "answer": self.by,
            "uplift": self.case["uplift"],
            "load": "partial" if self.partial else "full",
            "time": self.time,
            **self.numbers,
            "position": gravity.position(self.numbers["x_resultant"], self.length),
            **{name: self.case[name] for name in REQUIREMENTS},
            "verdict": self.verdict,
            "why": "; ".join(self.fails),
        }


def requires(case: Case) -> bool:
    """Whether a case requires anything: a safety factor, or a compressive strength at the toe."""
    return any(case[name] for name in REQUIREMENTS)


def least_sliding_factor(case: Case) -> float:
    """What the case requires; at least 1 where its law has friction: below it there is no
    equilibrium.
    """
    return max(case["required_SSF"], 1.0 if case.law.limits_shear else 0.0)


def by_gravity(method: GravityMethod, name: str = GRAVITY) -> Answer:
    """The gravity method's answer."""
    said = "" if method.stands else "overturning: no part of the joint is left under compression"
    numbers = {name: float(getattr(method, name)) for name in NUMBERS}
    return Answer(method.case, name, method.time, numbers, said)


def by_finite_elements(result: Results) -> Answer:
    """The answer of a run at the last level it reached, safety factors from its resultants.

    Stresses are node values at the joint's ends, where those of an elastic body depend on the mesh.
    """
    case, last, partial = result.case, result.last, result.partial_load
    said = verdict.statement(result) if verdict.failed(result) else ""
    if not last:
        nothing = dict.fromkeys(NUMBERS, math.nan)
        return Answer(case, FINITE_ELEMENTS, math.nan, nothing, said, partial)
    if partial and not said:  # interrupted
        said = f"t = {last['time']:.6g} of {case.times[-1]:g} is what the run has come to"
    method, rows = gravity.at(case, last["time"], last["level"]), along(result.at())
    numbers = {name: last[name] for name in NUMBERS if name in last}
    for name in ("sigma_n", "sigma_n_eff"):
        numbers |= {f"{name}_heel": rows[name][0], f"{name}_toe": rows[name][-1]}
    uncracked = method.body.length - last["crack_length"]
    numbers["SSF"] = gravity.sliding_factor(case, last["N"], last["T"], uncracked)
    lifting = method.resultant.moment - last["M"]
    numbers["OSF"] = gravity.overturning_factor(method.loads, lifting)
    found = {name: float(numbers[name]) for name in NUMBERS}
    return Answer(case, FINITE_ELEMENTS, last["time"], found, said, partial)


def hand_calculation(result: Results) -> GravityMethod:
    """The gravity method at a case's last level with all its loads; where a displacement is
    prescribed, at the last state found.
    """
    case, last = result.case, result.last
    if case["drive"] != "level" and last:
        return gravity.at(case, last["time"], last["level"])
    return gravity.at(case, case.times[-1])


def compared(result: Results) -> Check:
    """The answers for the scene of a run."""
    method = hand_calculation(result)
    return Check(
        by_finite_elements(result),
        by_gravity(method),
        result.info.get("error_estimate", {}).get("statement", ""),
        [by_gravity(one, LONGER) for one in method.further],
        method.notes,
    )


@dataclass(frozen=True)
class Check:
    """The answers for a scene."""

    finite_elements: Answer
    gravity: Answer
    #: the estimated errors of a mesh that was chosen for an accuracy, in words
    accuracy: str = ""
    #: the gravity method's with longer cracks that are in equilibrium, too
    longer: Sequence[Answer] = ()
    #: what to know of the gravity method's answers
    by_hand: Sequence[str] = ()

    @property
    def answers(self) -> list[Answer]:
        """All of them; each is judged."""
        return [self.finite_elements, self.gravity, *self.longer]

    @property
    def comparable(self) -> bool:
        """Whether both are for the same load: at the same t, by which loads grow, and level."""
        one, other = self.finite_elements, self.gravity
        pairs = (one.time, other.time), (one.numbers["level"], other.numbers["level"])
        return all(math.isclose(*pair, abs_tol=1e-9) for pair in pairs)

    @property
    def rows(self) -> list[dict[str, float | str]]:
        """Rows of check.csv: the answers and, if they are for the same load, their difference."""
        one, other = self.finite_elements, self.gravity
        rows = [answer.row for answer in self.answers]
        if not self.comparable:
            return rows
        less = {name: difference(one.numbers[name], other.numbers[name]) for name in NUMBERS}
        less = Answer(one.case, DIFFERENCE, one.time, less)
        return [*rows, less.row | NO_VERDICT]

    @property
    def shown(self) -> list[dict[str, float | str]]:
        """Rows of the printed table: those of check.csv and what is required."""
        factors = asked(self.gravity.case)
        if all(map(math.isnan, factors.values())):
            return self.rows
        scene = {"case": self.gravity.case.name, "uplift": self.gravity.case["uplift"]}
        blank = dict.fromkeys(NUMBERS, math.nan)
        return [*self.rows, scene | {"answer": REQUIRED} | blank | factors | NO_VERDICT]

    @property
    def why(self) -> str:
        """What fails, in words."""
        failing = (one for one in self.answers if one.fails)
        return "; ".join(f"{one.by}: {'; '.join(one.fails)}" for one in failing)

    @property
    def notes(self) -> list[str]:
        """What to know when the two are compared."""
        case, found = self.gravity.case, []
        if not requires(case):
            found.append(f"nothing is required: the case sets none of {', '.join(REQUIREMENTS)}")
        if not case.law.limits_shear:
            values = f"mu = {case['mu']:g}, adhesion = {case['adhesion']:g} Pa"
            found.append(f"SSF with {values}, which the law {case['law']} does not have")
        if case["uplift"] == "flow":
            found.append("gravity method: full head in the crack, linear beyond it")
        if case["f_c"]:
            found.append("the finite elements' stress at the toe, a corner, depends on the mesh")
        if not self.comparable:
            one, other = self.finite_elements, self.gravity
            said = "no differences: the finite elements did not reach the last level with all loads"
            got = "" if math.isnan(one.time) else f", t = {one.time:.5g} of {other.time:g}"
            found.append(said + got)
        return [*found, *self.by_hand]


#: A difference is not judged.
NO_VERDICT = {"position": "", "verdict": "", "why": ""}


def required(case: Case) -> dict[str, float]:
    """The safety factors that a case requires; nan where it requires none."""
    least = {"SSF": least_sliding_factor(case), "OSF": case["required_OSF"]}
    return {name: value or math.nan for name, value in least.items()}


def asked(case: Case) -> dict[str, float]:
    """`required`, but nan for what only the law asks for: what is shown as required."""
    least = required(case)
    return {n: v if case[f"required_{n}"] else math.nan for n, v in least.items()}


def difference(one: float, other: float) -> float:
    """One less the other; 0 if they agree to nine digits, or are both infinite."""
    return 0.0 if math.isclose(one, other, rel_tol=1e-9) else one - other


def text_table(checks: list[Check]) -> str:
    """The table as text, in units by size, and below it why a row fails and what to know."""
    rows = [row for check in checks for row in check.shown]
    less = np.array([row["answer"] == DIFFERENCE for row in rows])
    columns, heads = [], []
    for units, names in SHOWN:
        values = np.array([[row[name] for row in rows] for name in names], dtype=float)
        finite = values[np.isfinite(values)]
        size, factor = unit([finite], units)
        # a difference beyond the digits that are shown
        values[less & (np.abs(values) < 1e-5 * np.abs(finite).max(initial=0))] = 0
        sign = f"\n{SIGN}" if units is STRESSES else ""
        heads += [f"{title}\n[{size}]{sign}" for title in names.values()]
        show = [signed if is_less else number for is_less in less]
        columns += [[f(v * factor) for f, v in zip(show, line, strict=True)] for line in values]
    told = ([row[name] for row in rows] for name in ("position", "verdict"))
    names, answers = [label(checks, row) for row in rows], [named(row) for row in rows]
    table = tabulate(
        zip(names, answers, *columns, *told, strict=True),
        ["case", "", *heads, "N' in", ""],
        disable_numparse=True,
        colalign=("left", "left", *("right" for _ in columns), "left", "left"),
    )
    said = [
        f"{label(checks, row)}, {row['answer']}: fails, {row['why']}" for row in rows if row["why"]
    ]
    said += [
        f"{label(checks, check.gravity.row)}: {note}" for check in checks for note in check.notes
    ]
    return "\n\n".join(filter(None, [table, "\n".join(said)]))


def label(checks: list[Check], row: Mapping) -> str:
    """The name of a row's scene, with its uplift where the case has several."""
    scenes = {c.gravity.case["uplift"] for c in checks if c.gravity.case.name == row["case"]}
    return row["case"] + (f", {row['uplift']}" if len(scenes) > 1 else "")


def named(row: Mapping) -> str:
    """Which answer a row gives, and whether it is for a part of the loads only."""
    return row["answer"] + (", partial load" if row.get("load") == "partial" else "")


def number(value: float) -> str:
    """A number's cell: five digits; empty where there is none."""
    return "" if math.isnan(value) else f"{value:.5g}"


def signed(value: float) -> str:
    """A difference's cell: its sign and three digits."""
    return f"{value:+.3g}" if value else "0"


def check(cases: list[Case], out: Path) -> list[Check]:
    """Run cases, each into its folder below out, and write check.csv there, again after each of
    them; into each scene's folder gravity.csv and CASE_check.png.

    Raises InputError, RunError.
    """
    names = [case.name for case in cases]
    for case in cases:
        if names.count(case.name) > 1:
            raise InputError(f"case {case.name}: must be given once, by a name of its own")
        if case.geometry:
            raise InputError(
                f"case {case.name}: must have a section by parameters, which the gravity method "
                "needs; damjoint critical finds the limits of any geometry"
            )
        engine_of(case, "auto")
    checks = []
    for case in cases:
        for result in run(case, out / case.name):
            method = hand_calculation(result)
            checks.append(compared(result))
            folder = folders.scene_folder(case, result.case, out / case.name)
            write_csv(folder / "gravity.csv", method.table())
            draw_check(result, method, picture_table(checks[-1]), checks[-1].why, folder)
        rows = [row for found in checks for row in found.rows]
        write_csv(out / "check.csv", {name: [row[name] for row in rows] for name in CHECK})
    return checks


def picture_table(found: Check) -> list[tuple[str, ...]]:
    """The table beside the picture: a row per quantity."""
    longer = ["longer"] * len(found.longer)
    cells = [(f"stress: {SIGN}", "FE", "gravity", *longer, "required")]
    least = asked(found.gravity.case)
    for units, names in SHOWN:
        values = [[answer.numbers[name] for answer in found.answers] for name in names]
        size, factor = unit([np.array(values)[np.isfinite(values)]], units)
        for (name, title), line in zip(names.items(), values, strict=True):
            told = (number(v * factor) for v in line)
            head = title if size == "-" else f"{title} [{size}]"
            cells.append((head, *told, number(least.get(name, math.nan))))
    if found.finite_elements.partial:
        cells.insert(1, ("load", "partial", "full", *("full" for _ in longer), ""))
    return [*cells, ("", *(answer.verdict for answer in found.answers), "")]
