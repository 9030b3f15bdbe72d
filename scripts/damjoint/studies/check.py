"""Safety checks: results at the last level by finite elements and by the gravity method, beside the
required factors. Load combinations are cases that include a common file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from .. import ROUND_OFF
from ..input.case import Case
from ..model.fields import along
from ..model.results import HISTORY, Results
from ..statics import gravity, verdict
from ..statics.gravity import GravityMethod
from ..statics.statement import cracks_and_drains
from ..statics.statement import statement as statement_of
from ..units import STRESSES, with_unit

FINITE_ELEMENTS, GRAVITY = "finite elements", "gravity method"
LONGER = "gravity method, longer crack"
DIFFERENCE, REQUIRED = "difference", "required"
#: Verdicts; the last two: nothing is required; not all that is required could be judged.
FAIL, PASS, UNCHECKED, NOT_JUDGED = "fail", "pass", "not checked", "not judged"
#: Parameters that set requirements.
REQUIREMENTS = ("required_SSF", "required_OSF", "f_c", "required_position")
#: Value of a requirement that requires nothing.
NOTHING = 0.0, "any"

#: Columns of check.csv: a row per scene, joint and method at the last level; differences.
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
Row = dict[str, Any]


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
    #: whether it alone holds what is above it; else it may slip along its full length, with
    #: SSF = 1 less its hardening, while other joints hold
    alone: bool = True

    @property
    def failures(self) -> list[str]:
        """The statement, and each requirement that is not met."""
        case, numbers = self.case, self.numbers
        least = required(case) if self.alone else required_by_case(case)
        unmet = [
            f"{name} {numbers[name]:.4g} < {value:g}"
            for name, value in least.items()
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
    result: Results, statement: str, unjudged: str, alone: bool = True
) -> MethodResult:
    """Result of a run for a joint, the only one of `result`, at the last level it reached, with
    safety factors from its resultants.

    statement: why it fails, or empty; unjudged: why a joint that does not fail can not be judged,
    or empty; alone: see `MethodResult`. Stresses are node values at the ends of the joint; those of
    an elastic body depend on the mesh.
    """
    case, last, partial = result.case, result.last, result.partial_load
    (joint,) = case.joint_names
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
        case,
        joint,
        FINITE_ELEMENTS,
        last["time"],
        numbers,
        statement,
        partial,
        unjudged,
        alone=alone,
    )


def hand_calculation(result: Results, alone: bool = True) -> GravityMethod | None:
    """The gravity method for a joint, the only one of `result`, at a case's last level with all
    loads; at the last state of a run under displacement control or beyond the last level, up to a
    critical one, and of a user's own geometry, whose loads are those of the finite elements. None
    if there is an `obstacle`.

    alone: whether this joint alone holds what is above it.
    """
    case, last = result.case, result.last
    if case.geometry:
        return gravity.of_state(case, result.at(), last) if last and alone else None
    if last and (case["drive"] != "level" or last["time"] > case.times[-1]):
        return gravity.at(case, last["time"], last["level"])
    return gravity.at(case, case.times[-1])


def obstacle(result: Results, alone: bool) -> str:
    """Why `hand_calculation` does not apply to a joint; empty if it does."""
    if not result.case.geometry:
        return ""
    if not result.last:
        return "the run has no state"
    if not alone:
        return "the joint does not hold alone what is above it"
    return gravity.obstacle(result.case, result.at(), result.last)


def compare_methods(result: Results, statement: str, unjudged: str, alone: bool) -> SafetyCheck:
    """Both methods at the only joint; see `by_finite_elements` and `hand_calculation`."""
    method = hand_calculation(result, alone)
    elements = by_finite_elements(result, statement, unjudged, alone)
    accuracy = result.info.get("error_estimate", {}).get("statement", "")
    if not method:
        without = f"no gravity method: {obstacle(result, alone)}"
        return SafetyCheck(elements, None, accuracy, gravity_notes=[without])
    partial = bool(result.case.geometry) and result.partial_load
    longer = [by_gravity(longer, LONGER, partial) for longer in method.further]
    crack = result.last["crack_length"] if result.last else 0.0
    notes = [*method.notes, cracks_and_drains(result.case, crack, method)]
    shortest = by_gravity(method, partial=partial)
    return SafetyCheck(elements, shortest, accuracy, longer, list(filter(None, notes)))


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
        internal = case.graph.is_internal(k)
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
    #: notes on the results of the gravity method, or why there are none
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
        if not case.law.has_friction:
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
        names = "cohesion", "cohesion_undamaged"
        remaining, undamaged = (self.finite_elements.numbers[name] for name in names)
        uncracked = self.gravity.numbers["cohesion"] if self.gravity else 0.0
        if remaining < (1 - DESTROYED) * min(undamaged, uncracked):
            notes.append(
                f"the run has destroyed {1 - remaining / undamaged:.0%} of the cohesion; the "
                "gravity method has no history: its c B is that of an undamaged joint beyond the "
                "crack"
            )
        if case["f_c"]:
            notes.append("the finite elements' stress at the toe, a corner, depends on the mesh")
        if self.gravity and not self.comparable:
            reached, last = self.finite_elements.time, self.gravity.time
            note = "no differences: the finite elements did not reach the last level with all loads"
            notes.append(note + ("" if math.isnan(reached) else f", t = {reached:.5g} of {last:g}"))
        return [*notes, *self.gravity_notes]


def required(case: Case) -> dict[str, float]:
    """Required safety factors, also by the law; nan if there is none."""
    by_law = 1.0 if case.law.has_friction else 0.0  # below it there is no equilibrium
    least = {"SSF": max(case["required_SSF"], by_law), "OSF": case["required_OSF"]}
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


def common_notes(checks: Sequence[SafetyCheck]) -> Iterator[tuple[SafetyCheck, str, bool]]:
    """Yield the notes on joints, each with its check, and whether all of the checks have it."""
    for check in checks:
        for note in check.notes:
            yield check, note, all(note in other.notes for other in checks)


def verdict_line(check: SafetyCheck) -> str:
    """The verdict on a joint, and whether it is in equilibrium."""
    equilibrium = "no" if check.finite_elements.statement else "yes"
    return f"check: {worst_verdict(check)}; equilibrium: {equilibrium}"


def worst_verdict(*checks: SafetyCheck) -> str:
    """The worst verdict of both methods on joints; joints of which nothing is required do not count
    beside others.
    """
    verdicts = [result.verdict for check in checks for result in check.results]
    return min(verdicts, key=(FAIL, NOT_JUDGED, PASS, UNCHECKED).index)
