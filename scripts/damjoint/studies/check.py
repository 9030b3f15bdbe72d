"""Safety checks: results at the last level by finite elements and by the gravity method, beside the
required factors. Load combinations are cases that include a common file.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate

from .. import ROUND_OFF, InputError
from ..engines import engine_of
from ..input.case import Case
from ..model.fields import along
from ..model.results import HISTORY, Results
from ..pictures.check_picture import SIGN, draw_check
from ..post import folder as folders
from ..post import stored
from ..post.summary import fitted
from ..post.tables import write_csv
from ..processes import in_processes
from ..runner import run
from ..session import finished, several
from ..statics import gravity, verdict
from ..statics.gravity import GravityMethod
from ..statics.statement import cracks_and_drains
from ..statics.statement import statement as statement_of
from ..units import FORCES, MOMENTS, STRESSES, Units, unit, with_unit
from .keys import key_of

FINITE_ELEMENTS, GRAVITY = "finite elements", "gravity method"
LONGER = "gravity method, longer crack"
DIFFERENCE, REQUIRED = "difference", "required"
#: Verdicts: nothing fails and nothing is required; nothing fails, but not all that is required
#: could be judged.
FAIL, PASS, UNCHECKED, NOT_JUDGED = "fail", "pass", "not checked", "not judged"
#: Parameters that set requirements.
REQUIREMENTS = ("required_SSF", "required_OSF", "f_c", "required_position")
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
    "cohesion": ("N/m", "c B: shear force by the cohesion that is left; gravity: uncracked joint"),
    "cohesion_undamaged": ("N/m", "c L: shear force by the cohesion of the undamaged joint"),
    "SSF": ("-", "sliding: (mu N + cohesion) / T"),
    "OSF": ("-", "overturning: stabilising over overturning moments about the toe"),
    "position": ("", "where N acts: middle third, middle half, within base, outside"),
    "required_SSF": ("-", "required factor against sliding; 0: none"),
    "required_OSF": ("-", "required factor against overturning; 0: none"),
    "f_c": ("Pa", "compressive strength at the toe; 0: not checked"),
    "required_position": ("", "required position of N; any: none"),
    "verdict": ("", "pass; fail; not judged, at all or in part; not checked: nothing required"),
    "why": ("", "failure, or each requirement that is not met or not judged"),
}

#: Part of the cohesion that a run has to destroy for a note.
DESTROYED = 0.01

#: Columns of check.csv with the numbers of both methods.
NUMBERS = tuple(CHECK)[list(CHECK).index("level") : list(CHECK).index("OSF") + 1]

#: A difference is not judged.
NO_VERDICT = {"position": "", "verdict": "", "why": ""}
#: Difference over the largest value of a quantity below which the printed table shows 0.
SHOWN_DIFFERENCE = 1e-5

Row = dict[str, Any]
#: Result, number of the joint with diagrams, gravity method by joint, both tables, reasons.
Cells = list[tuple[str, ...]]
PictureContent = tuple[Results, int, list[GravityMethod], Cells, Cells, str]

#: Columns of the printed table: heading by name, in groups that share a unit.
SHOWN: tuple[tuple[Units, dict[str, str]], ...] = (
    ((("m", 1),), {"level": "level"}),
    (FORCES, {"N": "N'", "T": "T", "U": "U"}),
    (MOMENTS, {"M": "M"}),
    ((("m", 1),), {"x_resultant": "N' at x"}),
    (STRESSES, {"sigma_n_eff_heel": "eff. heel", "sigma_n_eff_toe": "eff. toe"}),
    ((("m", 1),), {"crack_length": "crack"}),
    (FORCES, {"cohesion": "c B", "cohesion_undamaged": "c L"}),
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
    #: why nothing can be judged though the joint does not fail; empty if it can
    unjudged: str = ""
    #: whether it lies between bodies that other joints hold: its resultant is not limited
    internal: bool = False

    @property
    def failures(self) -> list[str]:
        """The statement, and each requirement that is not met."""
        case, numbers = self.case, self.numbers
        unmet = [
            f"{name} {numbers[name]:.4g} < {value:g}"
            for name, value in required(case).items()
            if numbers[name] < value and not self.internal
        ]
        if case["f_c"] and -numbers["sigma_n_toe"] > case["f_c"]:
            compression = f"compression {with_unit(-numbers['sigma_n_toe'], STRESSES)} at the toe"
            unmet.append(f"{compression} > f_c = {with_unit(case['f_c'], STRESSES)}")
        placed = self.internal or math.isnan(numbers["x_resultant"])
        if not placed and not self.position_allowed:
            unmet.append(f"N {self.position}: must be in {case['required_position']}")
        return [self.statement, *unmet] if self.statement else unmet

    @property
    def not_judged(self) -> list[str]:
        """Why requirements could not be judged."""
        if self.unjudged:
            return [self.unjudged]
        known = dict(zip(REQUIREMENTS, ("SSF", "OSF", "sigma_n_toe", "x_resultant"), strict=True))
        missing = [n for n in self.requirements if math.isnan(self.numbers[known[n]])]
        return [f"{name} is {NOT_JUDGED}: {known[name]} is not known" for name in missing]

    @property
    def requirements(self) -> list[str]:
        """The requirements that apply to the joint: between bodies only that on its stress."""
        return [n for n in requirements(self.case) if n == "f_c" or not self.internal]

    @property
    def verdict(self) -> str:
        """fail; not judged; pass if the case requires something; else not checked."""
        if self.failures:
            return FAIL
        if self.not_judged:
            return NOT_JUDGED
        return PASS if self.requirements else UNCHECKED

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
            "why": "; ".join([*self.failures, *self.not_judged]),
        }


def requirements(case: Case) -> list[str]:
    """Those of REQUIREMENTS that a case sets."""
    return [name for name in REQUIREMENTS if case[name] not in NOTHING]


def least_sliding_factor(case: Case) -> float:
    """Required sliding factor; at least 1 with friction: below it there is no equilibrium."""
    return max(case["required_SSF"], 1.0 if case.law.limits_shear else 0.0)


def by_gravity(method: GravityMethod, name: str = GRAVITY, partial: bool = False) -> MethodResult:
    """Result of the gravity method; partial: whether only a part of the case's loads acts."""
    statement = "" if method.stands else "overturning: no part of the joint is under compression"
    numbers = {name: float(getattr(method, name)) for name in NUMBERS}
    (joint,) = method.case.joint_names
    unjudged = f"{NOT_JUDGED} under a part of the loads" if partial else ""
    return MethodResult(
        method.case, joint, name, method.time, numbers, statement, partial, unjudged
    )


def by_finite_elements(
    result: Results, statement: str | None = None, unjudged: str = ""
) -> MethodResult:
    """Result of a run for a joint, the only one of `result`, at the last level it reached, with
    safety factors from its resultants.

    statement: why it fails, or empty; by default that of the result; unjudged: why a joint that
    does not fail can not be judged. Stresses are node values at the ends of the joint; those of an
    elastic body depend on the mesh.
    """
    case, last, partial = result.case, result.last, result.partial_load
    (joint,) = case.joint_names
    if statement is None:
        statement = statement_of(result) if verdict.failed(result) else ""
    if not last:
        nothing = dict.fromkeys(NUMBERS, math.nan)
        return MethodResult(case, joint, FINITE_ELEMENTS, math.nan, nothing, statement, partial)
    if partial and not (statement or unjudged):
        statement = f"ended at t = {last['time']:.6g} of {case.times[-1]:g}"
    rows = along(result.at())
    numbers = {name: last[name] for name in NUMBERS if name in last}
    for name in ("sigma_n", "sigma_n_eff"):
        numbers |= {f"{name}_heel": rows[name][0], f"{name}_toe": rows[name][-1]}
    numbers |= gravity.factors_of_state(case, last)
    numbers = {name: float(numbers[name]) for name in NUMBERS}
    return MethodResult(
        case, joint, FINITE_ELEMENTS, last["time"], numbers, statement, partial, unjudged
    )


def hand_calculation(result: Results, alone: bool = True) -> GravityMethod | None:
    """The gravity method for a joint, the only one of `result`, at a case's last level with all
    loads; at the last state of a run under displacement control or beyond the last level, up to a
    critical one, and of a user's own geometry, whose loads are those of the finite elements. None
    if it does not apply there, see `gravity.of_state`.

    alone: whether this joint alone holds what is above it.
    """
    case, last = result.case, result.last
    if case.geometry:
        return gravity.of_state(case, result.at(), last) if last and alone else None
    if last and (case["drive"] != "level" or last["time"] > case.times[-1]):
        return gravity.at(case, last["time"], last["level"])
    return gravity.at(case, case.times[-1])


def compare_methods(
    result: Results, statement: str | None = None, unjudged: str = "", alone: bool = True
) -> SafetyCheck:
    """Apply both methods to a joint, the only one of `result`; arguments as in `by_finite_elements`
    and `hand_calculation`.
    """
    method = hand_calculation(result, alone)
    partial = bool(result.case.geometry) and result.partial_load
    return SafetyCheck(
        by_finite_elements(result, statement, unjudged),
        by_gravity(method, partial=partial) if method else None,
        result.info.get("error_estimate", {}).get("statement", ""),
        [by_gravity(longer, LONGER, partial) for longer in method.further] if method else (),
        [*method.notes, *beside_drains(result, method)] if method else (),
    )


def beside_drains(result: Results, method: GravityMethod) -> list[str]:
    """The note on crack and drains by both methods, see `cracks_and_drains`."""
    crack = result.last["crack_length"] if result.last else 0.0
    return list(filter(None, [cracks_and_drains(result.case, crack, method)]))


def compare_joints(result: Results) -> list[SafetyCheck]:
    """Apply both methods to each joint of the scene of a run.

    A run that failed fails at the joints that its verdict names, at all if it names none; the
    others are not judged if a part of the loads is missing.
    """
    why = statement_of(result) if verdict.failed(result) else ""
    failing = verdict.failing_joints(result) if why else ()
    case, checks = result.case, []
    for k, joint_result in enumerate(result.joints):
        fails, last = k in failing or not failing, result.last
        ended = ""
        if not fails and result.partial_load:
            end = f"t = {last['time']:.6g} of {case.times[-1]:g}"
            ended = f"{NOT_JUDGED} beyond {end}, where the run ended: {verdict.verdict(result)}"
        alone = case.separates((k,))
        internal = not alone and case.of_joints[k].lower != "foundation"
        check = compare_methods(joint_result, why if fails else "", ended, alone)
        checks.append(check.at_joint(case.joint_names[k], internal))
    return checks


@dataclass(frozen=True, repr=False)
class SafetyCheck:
    """Results of both methods for a joint of a scene."""

    finite_elements: MethodResult
    #: None where the gravity method does not apply
    gravity: MethodResult | None
    #: message on the estimated errors, if the case requires an accuracy
    accuracy: str = ""
    #: results of the gravity method with longer cracks that are in equilibrium, too
    longer: Sequence[MethodResult] = ()
    #: notes on the results of the gravity method
    gravity_notes: Sequence[str] = ()

    def __repr__(self) -> str:
        scene = f"{self.case.name}, {self.finite_elements.joint}"
        factors = [f"{r.method} SSF {r.numbers['SSF']:.4g}" for r in self.results]
        reasons = [self.why] if self.why else []
        return "; ".join([f"{scene}: {verdict_line(self)}", *factors, *reasons])

    @property
    def results(self) -> list[MethodResult]:
        """All results; each of them is judged."""
        return [r for r in (self.finite_elements, self.gravity, *self.longer) if r]

    @property
    def case(self) -> Case:
        """The case of the joint."""
        return self.finite_elements.case

    def at_joint(self, name: str, internal: bool) -> SafetyCheck:
        """The same with the name of the joint; internal: see `MethodResult`."""

        def at_joint(result: MethodResult) -> MethodResult:
            return replace(result, joint=name, internal=internal)

        return replace(
            self,
            finite_elements=at_joint(self.finite_elements),
            gravity=self.gravity and at_joint(self.gravity),
            longer=list(map(at_joint, self.longer)),
        )

    @property
    def margin(self) -> float:
        """The smallest safety factor of both methods; below 0 if one of them fails."""
        factors = [r.numbers[name] for r in self.results for name in ("SSF", "OSF")]
        least = min([f for f in factors if not math.isnan(f)], default=0.0)
        return least - 1e9 * any(result.failures for result in self.results)

    @property
    def comparable(self) -> bool:
        """Whether both methods have the same load: the same t, by which loads grow, and level."""
        elements, rigid = self.finite_elements, self.gravity
        if rigid is None:
            return False
        pairs = (elements.time, rigid.time), (elements.numbers["level"], rigid.numbers["level"])
        return all(math.isclose(*pair, abs_tol=ROUND_OFF) for pair in pairs)

    @property
    def rows(self) -> list[Row]:
        """Rows of check.csv: the results and, if they have the same load, their difference."""
        elements, rigid = self.finite_elements, self.gravity
        rows = [result.row for result in self.results]
        if rigid is None or not self.comparable:
            return rows
        numbers = {n: difference(elements.numbers[n], rigid.numbers[n]) for n in NUMBERS}
        row = replace(elements, method=DIFFERENCE, numbers=numbers, partial=False).row
        return [*rows, row | NO_VERDICT]

    @property
    def printed_rows(self) -> list[Row]:
        """Rows of the printed table: those of check.csv and the required factors."""
        factors, where = required_by_case(self.case), position_by_case(self.case)
        nothing = all(map(math.isnan, factors.values())) and not where
        if nothing or self.finite_elements.internal:
            return self.rows
        scene = {n: self.finite_elements.row[n] for n in ("case", "joint", "uplift")}
        blank = dict.fromkeys(NUMBERS, math.nan)
        row = scene | {"answer": REQUIRED} | blank | factors | NO_VERDICT | {"position": where}
        return [*self.rows, row]

    @property
    def why(self) -> str:
        """All failures and what is not judged, each with its method."""
        reasons = ((result.method, result.row["why"]) for result in self.results)
        return "; ".join(f"{method}: {why}" for method, why in reasons if why)

    @property
    def notes(self) -> list[str]:
        """Notes on the comparison of the two methods."""
        case, notes = self.case, []
        if self.finite_elements.internal:
            notes.append("between bodies that other joints hold: N and T are not limited")
        if not requirements(case):
            notes.append(f"only equilibrium is judged: {', '.join(REQUIREMENTS)} are not set")
        if not case.law.limits_shear:
            strength = f"mu = {case['mu']:g}, adhesion = {case['adhesion']:g} Pa"
            notes.append(f"SSF with {strength}, which the law {case['law']} does not have")
        partial = {n: case[n] for n in ("factor_mu", "factor_c") if case[n] != 1}
        if partial:
            listed = ", ".join(f"{name} = {value:g}" for name, value in partial.items())
            notes.append(f"SSF with the partial factors {listed}")
        if self.gravity and case["uplift"] == "flow":
            notes.append("gravity method: full head in the crack, linear beyond it")
        cracked = any(r.numbers["crack_length"] > 0 for r in self.results)
        if self.gravity and cracked and case.law.open_tension:
            notes.append(
                "the finite elements' SSF has the cohesion of the open part, which the law "
                f"{case['law']} keeps with its tension of adhesion/mu = "
                f"{with_unit(case.law.open_tension, STRESSES)}; the gravity method's has none there"
            )
        left, undamaged = (
            self.finite_elements.numbers[name] for name in ("cohesion", "cohesion_undamaged")
        )
        if self.gravity and left < (1 - DESTROYED) * min(
            undamaged, self.gravity.numbers["cohesion"]
        ):
            notes.append(
                f"the run has destroyed {1 - left / undamaged:.0%} of the cohesion; the gravity "
                "method has no history: its c B is that of an undamaged joint beyond the crack"
            )
        if case["f_c"]:
            notes.append("the finite elements' stress at the toe, a corner, depends on the mesh")
        if self.gravity is None:
            notes.append(
                "no gravity method: it needs a plane joint that alone holds what is above it, "
                "water that leaves at one toe, and none that follows from a crack before an "
                "earthquake"
            )
        elif not self.comparable:
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


#: Columns that a narrow table leaves out, in this order.
LESS = ("level", "c L", "c B", "eff. toe", "eff. heel", "M", "N' at x", "U", "crack", "T", "N'")


def text_table(checks: list[SafetyCheck], width: int | None = None) -> str:
    """Format the verdicts, below them a table in suitable units, and the notes; width: of the
    terminal, None: all columns.
    """
    rows = [row for check in checks for row in check.printed_rows]
    is_difference = np.array([row["answer"] == DIFFERENCE for row in rows])
    columns, heads, names = [], [], ["case", "method"]
    for units, shown in SHOWN:
        values = np.array([[row[name] for row in rows] for name in shown], dtype=float)
        finite = values[np.isfinite(values)]
        size, factor = units[0] if units in (FORCES, MOMENTS) else unit([finite], units)
        least = SHOWN_DIFFERENCE * np.abs(finite).max(initial=0)
        values[is_difference & (np.abs(values) < least)] = 0
        sign = f"\n{SIGN}" if units is STRESSES else ""
        names += shown.values()
        heads += [f"{title}\n[{size}]{sign}" for title in shown.values()]
        formats = [signed_cell if is_signed else number_cell for is_signed in is_difference]
        columns += [[f(v * factor) for f, v in zip(formats, line, strict=True)] for line in values]
    verdicts = ([row[name] for row in rows] for name in ("position", "verdict"))
    scenes, methods = [scene_label(checks, row) for row in rows], [method_label(r) for r in rows]
    columns = [scenes, methods, *columns, *verdicts]
    heads = ["case", "method", *heads, "N' in", "check"]
    aligned = ["left", "left", *("right" for _ in heads[4:]), "left", "left"]

    def draw(numbers: Sequence[int]) -> str:
        return str(
            tabulate(
                zip(*(columns[k] for k in numbers), strict=True),
                [heads[k] for k in numbers],
                disable_numparse=True,
                colalign=[aligned[k] for k in numbers],
            )
        )

    table = fitted([*names, "N' in", "check"], draw, LESS, width)
    lines = [
        f"{scene}, {row['answer']}: {'fails, ' * (row['verdict'] == FAIL)}{row['why']}"
        for scene, row in zip(scenes, rows, strict=True)
        if row["why"]
    ]
    verdict_lines = [
        f"{scene_label(checks, check.finite_elements.row)}: {verdict_line(check)}"
        for check in checks
    ]
    parts = "\n".join([*verdict_lines, *lines]), table, "\n".join(labelled_notes(checks))
    return "\n\n".join(filter(None, parts))


def verdict_line(check: SafetyCheck) -> str:
    """The verdict on a joint, and whether it is in equilibrium."""
    equilibrium = "no" if check.finite_elements.statement else "yes"
    return f"check: {worst_verdict(check)}; equilibrium: {equilibrium}"


def worst_verdict(check: SafetyCheck) -> str:
    """The worse verdict of both methods on a joint."""
    verdicts = [result.verdict for result in check.results]
    return min(verdicts, key=(FAIL, NOT_JUDGED, UNCHECKED, PASS).index)


def labelled_notes(checks: list[SafetyCheck]) -> list[str]:
    """Notes with the scene and joint of each; one that all of a case have, once with its name."""
    lines = dict[str, None]()  # in their order
    for check in checks:
        row = check.finite_elements.row
        same = [other for other in checks if other.case.name == check.case.name]
        for note in check.notes:
            common = all(note in other.notes for other in same)
            lines[f"{row['case'] if common else scene_label(checks, row)}: {note}"] = None
    return list(lines)


def scene_label(checks: list[SafetyCheck], row: Row) -> str:
    """Name of a row's case, with its uplift if the case has several scenes, and its joint if it has
    several.
    """
    same = [c.finite_elements for c in checks if c.case.name == row["case"]]
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
    """Format a difference with its sign and three digits; empty if it is nan."""
    return "" if math.isnan(value) else f"{value:+.3g}" if value else "0"


def check_cases(cases: list[Case], out: Path, jobs: int | None = None) -> list[SafetyCheck]:
    """Run cases, each into its folder below out, and check them; jobs: number of processes.

    Writes check.csv into out after each case; gravity.csv and CASE_check.png into each scene's
    folder, but not for a user's own geometry. Cases that have come to their end are not computed
    again by the same command. Raises InputError, RunError.
    """
    names = [case.name for case in cases]
    for case in cases:
        if names.count(case.name) > 1:
            raise InputError(f"case {case.name}: must be given once, and have its own name")
        engine_of(case, "auto")
    tasks, done = [(case, out / case.name) for case in cases], dict[int, list[SafetyCheck]]()
    by_folder = {folder: case for case, folder in tasks}
    with folders.claim_study_folder(out), several(by_folder):
        for number, checks in in_processes(check_case, tasks, jobs, "check"):
            done[number] = checks
            rows = [row for k in sorted(done) for check in done[k] for row in check.rows]
            write_csv(out / folders.CHECK, {name: [row[name] for row in rows] for name in CHECK})
    return [check for k in sorted(done) for check in done[k]]


def check_case(task: tuple[Case, Path], progress: bool) -> list[SafetyCheck]:
    """Run a case into a folder, or read its results of an earlier command, and check it."""
    case, out = task
    key = key_of(case, case.accuracy, case.also_uplift)
    folder_of = partial(folders.scene_folder, case, out=out)
    results = list[Results]()
    with contextlib.suppress(InputError):  # a file is missing or damaged
        if finished(out, key):
            results = [stored.read(folder_of(scene)).result for scene in case.scenes()]
    results = results or run(case, out, progress=progress, key=key)
    checks = list[SafetyCheck]()
    for result in results:
        of_joints = compare_joints(result)
        checks += of_joints
        if case.geometry:
            continue
        methods = hand_calculations(result)
        write_csv(folder_of(result.case) / "gravity.csv", loads_table(methods))
        draw_check(*picture_content(result, of_joints), folder_of(result.case))
    return checks


def hand_calculations(result: Results) -> list[GravityMethod]:
    """The gravity method on each joint of a section by parameters."""
    return [method for joint in result.joints if (method := hand_calculation(joint))]


def picture_content(result: Results, checks: list[SafetyCheck]) -> PictureContent:
    """What the picture of a scene shows: the arguments of `figure_of_check`."""
    methods = hand_calculations(result)
    k = min(range(len(methods)), key=lambda k: checks[k].margin)
    cells = picture_table(checks[k]), joints_table(checks)
    return result, k, methods, *cells, checks[k].why


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
    least = required_by_case(check.case)
    for units, names in SHOWN:
        values = [[result.numbers[name] for result in check.results] for name in names]
        size, factor = unit([np.array(values)[np.isfinite(values)]], units)
        for (name, title), line in zip(names.items(), values, strict=True):
            numbers = (number_cell(v * factor) for v in line)
            head = title if size == "-" else f"{title} [{size}]"
            cells.append((head, *numbers, number_cell(least.get(name, math.nan))))
    if where := position_by_case(check.case):
        cells.append(("N' in", *(result.position for result in check.results), where))
    if check.finite_elements.partial:
        cells.insert(1, ("load", "partial", "full", *("full" for _ in longer), ""))
    return [*cells, ("", *(result.verdict for result in check.results), "")]


def joints_table(checks: list[SafetyCheck]) -> list[tuple[str, ...]]:
    """Table of the joints of a scene: least factors of both methods, place of N by finite elements
    and the worse verdict.
    """
    cells: list[tuple[str, ...]] = [("joint", "SSF", "OSF", "N' in", "verdict")]
    for check in checks:
        numbers = [result.numbers for result in check.results]
        least = [np.nanmin([n[name] for n in numbers] + [np.inf]) for name in ("SSF", "OSF")]
        position = check.finite_elements.position
        name = check.finite_elements.joint
        cells.append(
            (
                name,
                *(f"{f:.3g}" if f < np.inf else "-" for f in least),
                position,
                worst_verdict(check),
            )
        )
    return cells
