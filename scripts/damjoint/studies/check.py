"""Safety checks: results at the last level by finite elements and by the gravity method, beside the
required factors. Load combinations are cases that include a common file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate

from .. import ROUND_OFF, InputError
from ..engines import engine_of
from ..model.case import Case
from ..model.fields import along
from ..model.results import HISTORY, Results
from ..post import folder as folders
from ..post.check_picture import SIGN, draw_check
from ..post.tables import write_csv
from ..post.units import FORCES, MOMENTS, STRESSES, Units, unit
from ..runner import run
from ..statics import gravity, verdict
from ..statics.gravity import GravityMethod

FINITE_ELEMENTS, GRAVITY = "finite elements", "gravity method"
LONGER = "gravity method, longer crack"
DIFFERENCE, REQUIRED = "difference", "required"
#: Verdict if nothing fails and nothing is required; parameters that set requirements.
UNCHECKED, REQUIREMENTS = (
    "not checked",
    ("required_SSF", "required_OSF", "f_c", "required_position"),
)
#: Value of a requirement that requires nothing.
NOTHING = 0.0, "any"

#: Columns of check.csv: a row per scene, joint and method at the last level, and one of
#: differences.
CHECK = {
    "case": ("", "name of the case"),
    "joint": ("", "name of the joint: base, lift at a height"),
    "answer": (
        "",
        "method: finite elements, gravity method (also with a longer crack); or their difference",
    ),
    "uplift": ("", "water in the joint"),
    "load": ("", "full; partial: the run stopped before its last t, at which all loads act"),
    "time": HISTORY["time"],
    **{name: HISTORY[name] for name in ("level", "tail_level", "N", "T", "M", "U", "x_resultant")},
    "sigma_n_heel": ("Pa", "total normal stress at the heel, compression < 0"),
    "sigma_n_toe": ("Pa", "total normal stress at the toe, compression < 0"),
    "sigma_n_eff_heel": ("Pa", "effective normal stress at the heel, compression < 0; 0: cracked"),
    "sigma_n_eff_toe": ("Pa", "effective normal stress at the toe, compression < 0"),
    "crack_length": HISTORY["crack_length"],
    "cohesion": ("N/m", "shear force by the cohesion that is left; gravity: uncracked joint"),
    "cohesion_undamaged": ("N/m", "shear force by the cohesion of the undamaged joint"),
    "SSF": ("-", "sliding: (mu N + cohesion) / T"),
    "OSF": ("-", "overturning: stabilising over overturning moments about the toe"),
    "position": ("", "where N acts: middle third, middle half, within base, outside"),
    "required_SSF": ("-", "required factor against sliding; 0: none"),
    "required_OSF": ("-", "required factor against overturning; 0: none"),
    "f_c": ("Pa", "compressive strength at the toe; 0: not checked"),
    "required_position": ("", "required position of N; any: none"),
    "verdict": ("", "pass or fail; not checked: nothing fails, and nothing is required"),
    "why": ("", "failure, or each requirement that is not met"),
}

#: Columns of check.csv with the numbers of both methods.
NUMBERS = tuple(CHECK)[list(CHECK).index("level") : list(CHECK).index("OSF") + 1]

#: A difference is not judged.
NO_VERDICT = {"position": "", "verdict": "", "why": ""}
#: Difference over the largest value of a quantity below which the printed table shows 0.
SHOWN_DIFFERENCE = 1e-5

Row = dict[str, Any]

#: Columns of the printed table: heading by name, in groups that share a unit.
SHOWN: tuple[tuple[Units, dict[str, str]], ...] = (
    ((("m", 1),), {"level": "level"}),
    (FORCES, {"N": "N'", "T": "T", "U": "U"}),
    (MOMENTS, {"M": "M"}),
    ((("m", 1),), {"x_resultant": "N' at x"}),
    (STRESSES, {"sigma_n_eff_heel": "eff. heel", "sigma_n_eff_toe": "eff. toe"}),
    ((("m", 1),), {"crack_length": "crack"}),
    (FORCES, {"cohesion": "cohesion", "cohesion_undamaged": "undamaged"}),
    ((("-", 1),), {"SSF": "SSF", "OSF": "OSF"}),
)


@dataclass(frozen=True)
class MethodResult:
    """Result of one method for a joint of a scene at its last level."""

    #: of the joint
    case: Case
    joint: str
    method: str
    #: t of the state; nan if there is none
    time: float
    #: NUMBERS in SI units; nan if there is no state
    numbers: Mapping[str, float]
    #: why there is no equilibrium; empty if it exists
    statement: str = ""
    #: whether only a part of the case's loads acts
    partial: bool = False

    @property
    def failures(self) -> list[str]:
        """The statement, and each requirement that is not met."""
        case, numbers = self.case, self.numbers
        unmet = [
            f"{name} {numbers[name]:.4g} < {value:g}"
            for name, value in required(case).items()
            if numbers[name] < value
        ]
        if case["f_c"] and -numbers["sigma_n_toe"] > case["f_c"]:
            compression = f"compression {-numbers['sigma_n_toe']:.4g} Pa at the toe"
            unmet.append(f"{compression} > f_c = {case['f_c']:g} Pa")
        if not math.isnan(numbers["x_resultant"]) and not self.position_allowed:
            unmet.append(f"N {self.position}: must be in {case['required_position']}")
        return [self.statement, *unmet] if self.statement else unmet

    @property
    def verdict(self) -> str:
        """fail; pass if the case requires something; else not checked."""
        return "fail" if self.failures else "pass" if requires(self.case) else UNCHECKED

    @property
    def position(self) -> str:
        """In which part of the joint N meets it."""
        length = self.case.section["joint_length"][0]
        return gravity.position(self.numbers["x_resultant"], length)

    @property
    def position_allowed(self) -> bool:
        """Whether N meets the joint in the required part."""
        required = self.case["required_position"]
        return gravity.PARTS.get(self.position, 1.0) <= gravity.PARTS.get(required, 1.0)

    @property
    def row(self) -> Row:
        """Row of check.csv."""
        return {
            "case": self.case.name,
            "joint": self.joint,
            "answer": self.method,
            "uplift": self.case["uplift"],
            "load": "partial" if self.partial else "full",
            "time": self.time,
            **self.numbers,
            "position": self.position,
            **{name: self.case[name] for name in REQUIREMENTS},
            "verdict": self.verdict,
            "why": "; ".join(self.failures),
        }


def requires(case: Case) -> bool:
    """Whether a case requires a safety factor or limits the compression at the toe."""
    return any(case[name] not in NOTHING for name in REQUIREMENTS)


def least_sliding_factor(case: Case) -> float:
    """Required sliding factor; at least 1 with friction: below it there is no equilibrium."""
    return max(case["required_SSF"], 1.0 if case.law.limits_shear else 0.0)


def by_gravity(method: GravityMethod, name: str = GRAVITY) -> MethodResult:
    """Result of the gravity method."""
    statement = "" if method.stands else "overturning: no part of the joint is under compression"
    numbers = {name: float(getattr(method, name)) for name in NUMBERS}
    (joint,) = method.case.joint_names
    return MethodResult(method.case, joint, name, method.time, numbers, statement)


def by_finite_elements(result: Results, statement: str | None = None) -> MethodResult:
    """Result of a run for a joint, the only one of `result`, at the last level it reached, with
    safety factors from its resultants.

    statement: why it fails, or empty; by default that of the result. Stresses are node values at
    the ends of the joint; those of an elastic body depend on the mesh.
    """
    case, last, partial = result.case, result.last, result.partial_load
    (joint,) = case.joint_names
    if statement is None:
        statement = verdict.statement(result) if verdict.failed(result) else ""
    if not last:
        nothing = dict.fromkeys(NUMBERS, math.nan)
        return MethodResult(case, joint, FINITE_ELEMENTS, math.nan, nothing, statement, partial)
    if partial and not statement:
        statement = f"ended at t = {last['time']:.6g} of {case.times[-1]:g}"
    method, rows = gravity.at(case, last["time"], last["level"]), along(result.at())
    numbers = {name: last[name] for name in NUMBERS if name in last}
    for name in ("sigma_n", "sigma_n_eff"):
        numbers |= {f"{name}_heel": rows[name][0], f"{name}_toe": rows[name][-1]}
    numbers |= gravity.factors_of_state(method, last)
    numbers = {name: float(numbers[name]) for name in NUMBERS}
    return MethodResult(case, joint, FINITE_ELEMENTS, last["time"], numbers, statement, partial)


def hand_calculation(result: Results) -> GravityMethod:
    """The gravity method for a joint, the only one of `result`, at a case's last level with all
    loads; at the last state of a run under displacement control or beyond the last level, up to a
    critical one.
    """
    case, last = result.case, result.last
    if last and (case["drive"] != "level" or last["time"] > case.times[-1]):
        return gravity.at(case, last["time"], last["level"])
    return gravity.at(case, case.times[-1])


def compare_methods(result: Results, statement: str | None = None) -> SafetyCheck:
    """Apply both methods to a joint, the only one of `result`; statement: see
    `by_finite_elements`.
    """
    method = hand_calculation(result)
    return SafetyCheck(
        by_finite_elements(result, statement),
        by_gravity(method),
        result.info.get("error_estimate", {}).get("statement", ""),
        [by_gravity(longer, LONGER) for longer in method.further],
        method.notes,
    )


def compare_joints(result: Results) -> list[SafetyCheck]:
    """Apply both methods to each joint of the scene of a run.

    A run that stopped fails for all joints; a joint that has slipped, only for itself.
    """
    why = verdict.statement(result) if verdict.failed(result) else ""
    slipped = () if result.stopped else verdict.slipped_joints(result)
    return [
        compare_methods(own, why if k in slipped or not slipped else "")
        for k, own in enumerate(result.joints)
    ]


@dataclass(frozen=True)
class SafetyCheck:
    """Results of both methods for a joint of a scene."""

    finite_elements: MethodResult
    gravity: MethodResult
    #: message on the estimated errors, if the case requires an accuracy
    accuracy: str = ""
    #: results of the gravity method with longer cracks that are in equilibrium, too
    longer: Sequence[MethodResult] = ()
    #: notes on the results of the gravity method
    gravity_notes: Sequence[str] = ()

    @property
    def results(self) -> list[MethodResult]:
        """All results; each of them is judged."""
        return [self.finite_elements, self.gravity, *self.longer]

    @property
    def margin(self) -> float:
        """The smallest safety factor of both methods; below 0 if one of them fails."""
        factors = [r.numbers[name] for r in self.results for name in ("SSF", "OSF")]
        least = min([f for f in factors if not math.isnan(f)], default=0.0)
        return least - 1e9 * bool(self.why)

    @property
    def comparable(self) -> bool:
        """Whether both methods have the same load: the same t, by which loads grow, and level."""
        elements, rigid = self.finite_elements, self.gravity
        pairs = (elements.time, rigid.time), (elements.numbers["level"], rigid.numbers["level"])
        return all(math.isclose(*pair, abs_tol=ROUND_OFF) for pair in pairs)

    @property
    def rows(self) -> list[Row]:
        """Rows of check.csv: the results and, if they have the same load, their difference."""
        elements, rigid = self.finite_elements, self.gravity
        rows = [result.row for result in self.results]
        if not self.comparable:
            return rows
        numbers = {n: difference(elements.numbers[n], rigid.numbers[n]) for n in NUMBERS}
        row = replace(elements, method=DIFFERENCE, numbers=numbers, partial=False).row
        return [*rows, row | NO_VERDICT]

    @property
    def printed_rows(self) -> list[Row]:
        """Rows of the printed table: those of check.csv and the required factors."""
        case = self.gravity.case
        factors, where = required_by_case(case), position_by_case(case)
        if all(map(math.isnan, factors.values())) and not where:
            return self.rows
        scene = {n: self.gravity.row[n] for n in ("case", "joint", "uplift")}
        blank = dict.fromkeys(NUMBERS, math.nan)
        row = scene | {"answer": REQUIRED} | blank | factors | NO_VERDICT | {"position": where}
        return [*self.rows, row]

    @property
    def why(self) -> str:
        """All failures, each with its method."""
        failing = (result for result in self.results if result.failures)
        return "; ".join(f"{result.method}: {'; '.join(result.failures)}" for result in failing)

    @property
    def notes(self) -> list[str]:
        """Notes on the comparison of the two methods."""
        case, notes = self.gravity.case, []
        if not requires(case):
            notes.append(f"not checked: the case sets none of {', '.join(REQUIREMENTS)}")
        if not case.law.limits_shear:
            strength = f"mu = {case['mu']:g}, adhesion = {case['adhesion']:g} Pa"
            notes.append(f"SSF with {strength}, which the law {case['law']} does not have")
        partial = {n: case[n] for n in ("factor_mu", "factor_c") if case[n] != 1}
        if partial:
            listed = ", ".join(f"{name} = {value:g}" for name, value in partial.items())
            notes.append(f"SSF with the partial factors {listed}")
        if case["uplift"] == "flow":
            notes.append("gravity method: full head in the crack, linear beyond it")
        if case["f_c"]:
            notes.append("the finite elements' stress at the toe, a corner, depends on the mesh")
        if not self.comparable:
            reached, last = self.finite_elements.time, self.gravity.time
            note = "no differences: the finite elements did not reach the last level with all loads"
            notes.append(note + ("" if math.isnan(reached) else f", t = {reached:.5g} of {last:g}"))
        return [*notes, *self.gravity_notes]


def required(case: Case) -> dict[str, float]:
    """Required safety factors, also by the law; nan if there is none."""
    least = {"SSF": least_sliding_factor(case), "OSF": case["required_OSF"]}
    return {name: value or math.nan for name, value in least.items()}


def required_by_case(case: Case) -> dict[str, float]:
    """Required safety factors, without a factor that only the law requires."""
    least = required(case)
    return {n: v if case[f"required_{n}"] else math.nan for n, v in least.items()}


def position_by_case(case: Case) -> str:
    """Required position of N; empty if there is none."""
    return "" if case["required_position"] in NOTHING else case["required_position"]


def difference(first: float, second: float) -> float:
    """Subtract; 0 if the numbers agree to nine digits, or are both infinite."""
    return 0.0 if math.isclose(first, second, rel_tol=ROUND_OFF) else first - second


def text_table(checks: list[SafetyCheck]) -> str:
    """Format checks as a table in suitable units; below it the failures and notes."""
    rows = [row for check in checks for row in check.printed_rows]
    is_difference = np.array([row["answer"] == DIFFERENCE for row in rows])
    columns, heads = [], []
    for units, names in SHOWN:
        values = np.array([[row[name] for row in rows] for name in names], dtype=float)
        finite = values[np.isfinite(values)]
        size, factor = unit([finite], units)
        least = SHOWN_DIFFERENCE * np.abs(finite).max(initial=0)
        values[is_difference & (np.abs(values) < least)] = 0
        sign = f"\n{SIGN}" if units is STRESSES else ""
        heads += [f"{title}\n[{size}]{sign}" for title in names.values()]
        formats = [signed_cell if is_signed else number_cell for is_signed in is_difference]
        columns += [[f(v * factor) for f, v in zip(formats, line, strict=True)] for line in values]
    verdicts = ([row[name] for row in rows] for name in ("position", "verdict"))
    scenes, methods = [scene_label(checks, row) for row in rows], [method_label(r) for r in rows]
    table = tabulate(
        zip(scenes, methods, *columns, *verdicts, strict=True),
        ["case", "", *heads, "N' in", ""],
        disable_numparse=True,
        colalign=("left", "left", *("right" for _ in columns), "left", "left"),
    )
    lines = [
        f"{scene}, {row['answer']}: fails, {row['why']}"
        for scene, row in zip(scenes, rows, strict=True)
        if row["why"]
    ]
    return "\n\n".join(filter(None, [table, "\n".join([*lines, *labelled_notes(checks)])]))


def labelled_notes(checks: list[SafetyCheck]) -> list[str]:
    """Notes with the scene and joint of each; one that all of a case have, once with its name."""
    lines = dict[str, None]()  # in their order
    for check in checks:
        row = check.gravity.row
        same = [other for other in checks if other.gravity.row["case"] == row["case"]]
        for note in check.notes:
            common = all(note in other.notes for other in same)
            lines[f"{row['case'] if common else scene_label(checks, row)}: {note}"] = None
    return list(lines)


def scene_label(checks: list[SafetyCheck], row: Row) -> str:
    """Name of a row's case, with its uplift if the case has several scenes, and its joint if it has
    several.
    """
    same = [c.gravity for c in checks if c.gravity.case.name == row["case"]]
    joints = list(dict.fromkeys(result.joint for result in same))
    scenes = {result.case["uplift"] for result in same if result.joint == joints[0]}
    parts = [row["case"]]
    parts += [row["uplift"]] if len(scenes) > 1 else []
    parts += [row["joint"]] if len(joints) > 1 else []
    return ", ".join(parts)


def method_label(row: Row) -> str:
    """Method of a row, and whether it has a part of the loads only."""
    return row["answer"] + (", partial load" if row.get("load") == "partial" else "")


def number_cell(value: float) -> str:
    """Format a number with five digits; empty if it is nan."""
    return "" if math.isnan(value) else f"{value:.5g}"


def signed_cell(value: float) -> str:
    """Format a difference with its sign and three digits."""
    return f"{value:+.3g}" if value else "0"


def check_has_section(case: Case) -> None:
    """Raise InputError if the gravity method does not apply to a case."""
    if case.geometry:
        raise InputError(
            f"case {case.name}: must have a section by parameters, which the gravity method needs; "
            "damjoint critical finds the limits of any geometry"
        )


def check_cases(cases: list[Case], out: Path) -> list[SafetyCheck]:
    """Run cases, each into its folder below out, and check them.

    Writes check.csv into out after each case; gravity.csv and CASE_check.png into each scene's
    folder. Raises InputError, RunError.
    """
    names = [case.name for case in cases]
    for case in cases:
        if names.count(case.name) > 1:
            raise InputError(f"case {case.name}: must be given once, and have its own name")
        check_has_section(case)
        engine_of(case, "auto")
    checks = []
    for case in cases:
        for result in run(case, out / case.name):
            of_joints, methods = compare_joints(result), list(map(hand_calculation, result.joints))
            checks += of_joints
            folder = folders.scene_folder(case, result.case, out / case.name)
            write_csv(folder / "gravity.csv", loads_table(methods))
            k = min(range(len(methods)), key=lambda k: of_joints[k].margin)
            worst = of_joints[k]
            draw_check(result, k, methods[k], picture_table(worst), worst.why, folder)
        rows = [row for check in checks for row in check.rows]
        write_csv(out / "check.csv", {name: [row[name] for row in rows] for name in CHECK})
    return checks


def loads_table(methods: list[GravityMethod]) -> dict[str, list[Any]]:
    """Loads on the body above each joint; with the name of the joint if there are several."""
    tables = [method.table() for method in methods]
    if len(tables) == 1:
        return tables[0]
    names = [method.case.joint_names[0] for method in methods]
    rows = [name for name, table in zip(names, tables, strict=True) for _ in table["load"]]
    return {"joint": rows} | {n: [v for t in tables for v in t[n]] for n in tables[0]}


def picture_table(check: SafetyCheck) -> list[tuple[str, ...]]:
    """Table beside the picture: a row per quantity."""
    longer = ["longer"] * len(check.longer)
    cells = [(f"stress: {SIGN}", "FE", "gravity", *longer, "required")]
    least = required_by_case(check.gravity.case)
    for units, names in SHOWN:
        values = [[result.numbers[name] for result in check.results] for name in names]
        size, factor = unit([np.array(values)[np.isfinite(values)]], units)
        for (name, title), line in zip(names.items(), values, strict=True):
            numbers = (number_cell(v * factor) for v in line)
            head = title if size == "-" else f"{title} [{size}]"
            cells.append((head, *numbers, number_cell(least.get(name, math.nan))))
    if where := position_by_case(check.gravity.case):
        cells.append(("N' in", *(result.position for result in check.results), where))
    if check.finite_elements.partial:
        cells.insert(1, ("load", "partial", "full", *("full" for _ in longer), ""))
    return [*cells, ("", *(result.verdict for result in check.results), "")]
