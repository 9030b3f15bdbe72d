"""The critical level, strength or parameter, beyond which a dam has no equilibrium.

A value stands if there is an equilibrium at the case's last level, and fails if its equilibrium
path (see failure_path.py) ends below. Between such values the interval is bisected to the
precision. A critical level needs no bisection: it is the highest level of the path.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import chain, zip_longest

import numpy as np
from scipy.optimize import bisect

from .. import InputError, meant
from ..arrays import Setting
from ..engines import check_engine
from ..input.case import Case
from ..input.parameters import declared, independent, parameter
from ..input.resolve import resolve, varied
from ..joint.interface import interface_of
from ..model.results import Results, row_of_joint
from ..session import study_end
from ..solver.path import RISE, ROUGH, SURE
from ..solver.path_point import PRECISION, Point
from ..statics.statement import REASONS, words_of_bound
from ..statics.verdict import bound, highest_by_statics
from ..threads import limited_threads
from ..units import FORCES, STRESSES, with_unit
from .critical_gravity import GravityValues
from .critical_value import CriticalValue
from .critical_ways import SHORTER, Way, falls_by_water, repeats_whole, ways_to_confirm
from .critical_words import (
    beyond_limit,
    by_increments,
    end_at_drains,
    end_of_branch,
    events_on,
    falls_at_once,
    lost_beyond_limit,
    slips_whole,
    stands_beyond,
    withdrawn,
)
from .failure_path import ABOVE, FailurePath, Trial, brittle_in_shear

#: What is searched for beside the values of parameters.
OF = "level", "strength", "uplift"

#: Parameters that are divided by the strength reduction factor. The fracture energies are included:
#: the stresses of the softening curve are scaled, its jumps are not.
STRENGTH = ("sigma_max", "adhesion", "mu", "G_f", "G_t")

#: Partial factors that divide them beside it.
PARTIAL = {"mu": "factor_mu", "adhesion": "factor_c", "G_t": "factor_c"}

#: Few iterations for a step of the level: if it fails a displacement is prescribed.
QUICK = {"smallest_step": 1.0, "max_iterations": 15.0, "relaxation_iterations": 15.0}

#: Parameters of a prescribed displacement.
DRIVE = ("drive", "drive_begin", "drive_end", "drive_by")

#: How often at most a path is repeated by shorter increments before its highest level is said to
#: depend on them.
MOST_REPEATED = 3

#: How unstable crack growth is passed over: whether by relaxation.
AFTER = {"by displacement": False, "by relaxation": True}

#: The mode of a level at which a crack grows unstably, and beyond which there are equilibria.
GROWTH = "unstable crack growth"

#: What is said of a level at which a crack grows unstably on all paths, which some of them pass.
PASSED = "there the crack grows unstably, on all paths to the same level; some pass it"

#: What is said of it where all of them pass it.
PASSED_BY_ALL = "there the crack grows unstably, on all paths at the same level; they pass it"

#: Relative distance within which the bound of statics confirms a critical level below it.
NEAR_BOUND = 0.02

#: The smallest value of a parameter that has to be positive.
TINY = 1e-30

#: Relative distance from the gravity method's critical value at which the search begins [-].
BESIDE_GRAVITY = 0.01
#: Relative precision of that value [-].
GUESS_PRECISION = 1e-3

#: How often a step of the search is doubled at most.
MOST_DOUBLED = 20
#: How often the distance to the last value that the case allows is halved.
MOST_HALVED = 6


class Search:
    """The search for a critical value."""

    def __init__(self, case: Case, of: str) -> None:
        """case: of input.resolve.load; of: level, strength, uplift or a parameter.

        Raises InputError.
        """
        assert case.source  # input.resolve.load has it
        self.of, self.name = of, {"uplift": "drain_effectiveness"}.get(of, of)
        #: partial factors of the case; they are part of the reduced strength, not of a check
        self.partial = {name: case[factor] for name, factor in PARTIAL.items()}
        full = dict.fromkeys(PARTIAL.values(), 1.0)
        self.settings: dict[str, Setting] = {
            **QUICK,
            **case.source.overrides,
            "drive": "level",
            **full,
        }
        case = case.with_values(full)
        defaults = [joint for joint in case.joints if not joint.hardening_requested]
        for name in {joint.law.hardening_parameter for joint in defaults} - {""}:
            as_set = [joint[name] if joint.hardening_requested else 0.0 for joint in case.joints]
            self.settings[name] = of_each(as_set)
        self.case = case
        #: called with a message on the progress
        self.on_progress: Callable[[str], None] = lambda message: None
        self.trials: list[Trial] = []
        #: why the first value that the case does not allow is refused
        self.refused = ""
        #: how far paths are followed, see `FailurePath.follow`
        self.factor = ROUGH
        #: relative rise of the level that an increment of them aims at
        self.rise = RISE
        #: whether the highest levels after unstable growth are found, not only that there are any
        self.levels_after = False
        #: values on both sides of the gravity method's critical value
        self.guesses: list[float] = []
        self.gravity = GravityValues(case, of, self.case_at, self.joints_at)
        self.check_quantity()

    def check_quantity(self) -> None:
        """Raise InputError if the case has nothing to vary, or no engine can compute it."""
        case = self.case
        check_engine(case)
        if case.stores_water:
            raise InputError(
                f"time_unit = {case['time_unit']:g}: must be 0 in the search of a critical value, "
                "whose levels have no time"
            )
        drained = case["uplift"] == "drained" or (case["uplift"] == "cracked" and case["drains"])
        if self.of == "uplift" and not drained:
            raise InputError(
                f"--of uplift: needs drains; uplift = {case['uplift']}: must be drained, or "
                "cracked with drains = 1"
            )
        if self.of in ("level", "strength"):
            return
        if self.name not in declared() and (hint := meant(self.of, OF)):
            raise InputError(f"--of {self.of}: unknown; {hint}")
        varied = parameter(self.name)
        if not varied.real or varied.group == "Solver":
            raise InputError(
                f"--of {self.of}: must be level, strength, uplift or a parameter that is a number "
                "without steps"
            )

    @property
    def matters(self) -> bool:
        """Whether the parameter has an effect in the case, by its declaration."""
        joints = (joint.values for joint in self.case.joints)
        return any(map(parameter(self.name).matters_in, joints))

    @property
    def unit(self) -> str:
        """Unit of the varied quantity, after a blank."""
        if self.of in ("level", "strength"):
            return " m" if self.of == "level" else ""
        unit = parameter(self.name).unit
        return "" if unit == "-" else f" {unit.replace(' per ', '/')}"

    # -- one value
    # ----------------------------------------------------------------------------------------------

    @cached_property
    def base(self) -> Case:
        """The case with the settings of the search; those that nothing else follows are set after
        Gmsh's parser, which the rows of a sweep then share.
        """
        assert self.case.source
        source, alone = self.case.source.with_overrides(self.settings), independent()
        overrides = source.overrides.items()
        single = {n: v for n, v in overrides if n in alone and not isinstance(v, tuple)}
        rest = {n: v for n, v in overrides if n not in single}
        try:
            case = resolve(replace(source, overrides=rest)).changed(single)
        except InputError:  # the others are not allowed without these
            case = resolve(source)
        return replace(case, all_steps=self.case.all_steps)

    def case_at(self, value: float) -> Case:
        """The case with a value.

        Raises InputError.
        """
        if self.of == "strength":
            reduced = [self.reduced(joint, value) for joint in self.case.joints]
            changed = {n: of_each([values[n] for values in reduced]) for n in STRENGTH}
            changed["pena_rupture"] = -1.0
        elif self.name in independent():
            return self.base.changed({self.name: value})
        else:
            changed = {self.name: value}
        return varied(self.case, self.settings | changed)

    def reduced(self, joint: Case, factor: float) -> dict[str, float]:
        """The strength of a joint, divided by a factor and the partial factors."""
        return {n: joint[n] / (factor * self.partial.get(n, 1.0)) for n in STRENGTH}

    def joints_at(self, value: float) -> Sequence[Case]:
        """The case of each joint with a value, for the gravity method.

        Raises InputError.
        """
        if self.of == "level":
            return self.case.joints
        if self.of == "strength":  # without Gmsh's parser
            return [joint.with_values(self.reduced(joint, value)) for joint in self.base.joints]
        return self.case_at(value).joints

    def path(
        self, value: float, case: Case, target: float | None = None, to_growth: bool = False
    ) -> FailurePath:
        """The equilibrium path of a case, followed to a first estimate; adds a trial.

        to_growth: see `FailurePath`.
        """
        report = lambda level: self.on_progress(
            f"{self.of} {value:.6g}{self.unit}: level {level:.6g} m"
        )
        highest = max(target or 0, *case.levels)  # water may press on the crest
        interface = interface_of(replace(case, levels=(*case.levels[:-1], highest)))
        solver = {name: self.case[name] for name in QUICK}
        rise = self.rise / 2 if brittle_in_shear(case) else self.rise
        path = FailurePath(case, interface, target, report, to_growth, rise, solver)
        self.trials.append(Trial(value, path))
        path.follow(self.factor)
        return path

    def trial(self, value: float) -> Trial:
        """The trial of a value."""
        self.path(value, self.case_at(value))
        return self.trials[-1]

    # -- the search
    # ----------------------------------------------------------------------------------------------

    def run(self) -> CriticalValue:
        """Search, and compare with the gravity method; nothing is written. An error or interrupt
        that ended the search is in the result.
        """
        try:
            with limited_threads(1):
                self.levels_after = True
                result = self.find()
                return self.gravity.beside(result, self.trials[-1].path.points)
        except BaseException as error:
            return self.ended_early(error)

    def find(self) -> CriticalValue:
        """Search, without the values of the gravity method and, after unstable growth, the highest
        level: it is followed only until it shows that there are equilibria at higher ones.
        """
        return self.level() if self.of == "level" else self.value()

    def level(self) -> CriticalValue:
        """The highest level of the path, beyond the case's highest level."""
        first, grows, other = self.level_path()
        if first.reached:
            doubt = f"there is an equilibrium at {first.target:.4g} m, twice the dam's height"
            return CriticalValue(None, "", "", doubt, first.points[-1])
        result, path = self.at_limit(first, grows)
        if not result.point:
            return result
        result = self.confirmation(first, path, result, grows, other)
        return result if result.growth else replace(result, growth=path.passed_growth)

    def level_path(self) -> tuple[FailurePath, bool, FailurePath | None]:
        """The path to the critical level; whether a crack grows unstably there, see `finished`; and
        the last path by shorter increments, if they do not lead to the same level.
        """
        last = int(np.argmax(self.case.levels)) + 1
        levels, tails = self.case.levels[:last], self.case.tail_levels[:last]
        below = last < len(self.case.levels)
        case = varied(self.case, self.settings, levels, tails) if below else self.base
        # not the limit itself, from which no increment leads on
        most = (1 - PRECISION) * case.highest_level
        path, paths = self.path(max(case.levels), case, most, to_growth=True), list[FailurePath]()
        other: FailurePath | None = None
        for _ in range(MOST_REPEATED):
            path, grows = finished(other or path)
            other = None if path.reached else self.repeated(path)
            if other is None:
                return path, grows, None
            paths += path, other
        # the lowest of their levels, on the safe side
        complete = [path for path in paths if not path.unfinished] or paths
        return *finished(min(complete, key=lambda path: path.highest)), other

    def at_limit(self, first: FailurePath, grows: bool) -> tuple[CriticalValue, FailurePath]:
        """The result at the highest level of a path, with the unstable crack growth there, and the
        path, continued beyond it.
        """
        if not first.admissible:
            return self.result(None, first, None), first
        point, after, path = first.points[first.top], dict[str, float](), first
        if grows:
            after, path = self.after_growth(first)
        result = self.result(point.level, path, point)
        if after or (grows and first.ended):
            mode = GROWTH if after else result.mode
            result = replace(result, mode=mode, why=beyond_limit(path), doubt="", after=after)
            result = replace(result, growth=point.level)
            if not after and path.top + 1 == len(path.points):
                result = self.with_run(path, result)
        return result, path

    def confirmation(
        self,
        first: FailurePath,
        path: FailurePath,
        result: CriticalValue,
        grows: bool,
        other: FailurePath | None,
    ) -> CriticalValue:
        """A result of `at_limit`, confirmed or not: by the end of its path, if it has no mechanism,
        and by other ways, if shorter increments have led to no other path, see `level_path`.
        """
        mechanism = bool(result.why)
        if result.growth is None and not path.water_withdraws:
            if not mechanism:
                result = self.with_end_of(path, result)
            elif path.stops_at_water:  # the bound of statics alone is not near enough
                result = self.with_run(path, result)
        if other is None and path.varies and (path.entering or result.growth is not None):
            other = path
        if other is None:
            ways = ways_to_confirm(first, path, result, grows, mechanism)
            paths = (self.from_beginning(path, way) for path, way in ways)
            other = next((path for path in paths if path), None)
            if other and other.passed_to > other.highest:  # the growth that ends it is passed here
                result, path = self.at_limit(other, grows=False)
                return self.confirmation(other, path, result, False, None)
        if other:
            return replace(result, why="", doubt=by_increments(other))
        if path.begun_by_run and result.point is path.points[0]:
            return replace(result, why="", doubt=falls_at_once(path.points[0]))
        if path.water_withdraws:
            result = self.where_water_withdraws(path, result)
        if not path.passed_to > path.highest:
            return self.at_passed_growth(path, result) if result.confirmed else result
        result = replace(result, mode=GROWTH, why=PASSED, doubt="")
        highest = float(max(path.passed_to, result.stands_at or 0.0))
        after = {"by other increments": highest}
        return replace(result, growth=float(path.highest), stands_at=None, after=after)

    def at_passed_growth(self, path: FailurePath, result: CriticalValue) -> CriticalValue:
        """A result at the unstable growth that its path and all others have passed, below their
        highest level: rounding decides whether a path is led over it or ends there. The result
        itself if one of them has passed none.
        """
        growths = path.growth_of_all if path.passes_growth else None
        if growths is None:
            varies = path.differs_after_growth
            return replace(result, why="", doubt=by_increments(path)) if varies else result
        end = path.up_to(path.branches_with_less_tension[0] - 1)
        end.interval = low, high = growths
        result = self.result(end.highest, end, end.points[end.top])
        after = {"by displacement": float(path.highest)}
        result = replace(result, mode=GROWTH, growth=end.highest, after=after)
        if high - low > PRECISION * high:
            return replace(result, why="", doubt=by_increments(end))
        return replace(result, why=PASSED_BY_ALL, doubt="")

    def where_water_withdraws(self, path: FailurePath, result: CriticalValue) -> CriticalValue:
        """A result above which the water withdraws from the crack, and to which other ways lead:
        confirmed where the level falls; else unless a run has a higher level with as much uplift.
        """
        words = withdrawn(path)
        if path.leads_higher or not falls_by_water(path):
            level = path.level_above
            run = path.run_to(level)
            if not run.stopped:
                run = path.run_to(path.target, run)
            levels = np.array(run.history.rows["level"])
            full = levels[path.has_full_uplift(run.history)].max(initial=0.0)
            if full >= level:
                return replace(result, why="", doubt=stands_beyond(words, float(full)))
            if levels.max() >= level:
                words += f"; a run stands at {levels.max():.6g} m, with less uplift"
        return replace(result, why=words, doubt="")

    def repeated(self, path: FailurePath) -> FailurePath | None:
        """A path by shorter increments: from before its highest level, if its branch has led there;
        else, and where water enters the crack and no mechanism is found, from the beginning on.
        None if they lead to the same highest level.
        """
        if repeats_whole(path):
            return self.from_beginning(path, SHORTER)
        other = path.repeated()
        if other:
            self.trials[-1] = replace(self.trials[-1], path=other)
        return other

    def from_beginning(self, path: FailurePath, way: Way) -> FailurePath | None:
        """The path by another way from its beginning on, to the first unstable growth if it is;
        None if it leads to the same highest level, to its precision.
        """
        case, to_growth = path.case, path.to_growth
        if way.levels:
            case = varied(case, {}, way.levels, way.tails)
        other = FailurePath(
            *(case, path.interface, path.target),
            to_growth=to_growth,
            rise=way.share * path.rise,
            solver=path.solver,
            known=path if case is path.case else None,
        )
        other.unstable_fall = way.unstable_fall
        other, _ = finished(other)
        differs = path.widen(other, path.precision)
        other.interval = path.interval
        return other if differs else None

    def after_growth(self, path: FailurePath) -> tuple[dict[str, float], FailurePath]:
        """The highest levels [m] that are reached after the unstable crack growth that ends a path,
        by how it is passed over, or one above the path's, see `find`; and the path, continued if
        there is no growth.
        """
        after, ended, farther = dict[str, float](), path.ended, path
        for name, relaxes in AFTER.items():
            if relaxes and not (after or farther.ended):
                continue
            other = path.copied()
            other.relaxes, other.to_growth, other.ended = relaxes, False, False
            other.verified = False
            if relaxes:
                del other.points[path.top + 1 :]
                other.pass_over(other.points[-1])
            higher = (1 + PRECISION) * path.highest
            # where water enters a crack, it may withdraw later, and the levels not count
            enough = np.inf if self.levels_after or path.entering else higher
            other.follow(SURE, enough)
            if not other.highest > enough:
                other.refine()
            if other.highest > higher:
                after[name] = float(other.highest)
                if enough < np.inf:
                    break
            elif not (ended or relaxes):
                farther = other
        return after, path if after else farther

    def value(self) -> CriticalValue:
        """Search outwards from the case's own value for a stand and a failure, then bisect."""
        first = self.trial(1.0 if self.of == "strength" else self.case[self.name])
        if self.of != "strength" and not self.matters:
            doubt = f"{result_of(first)} with any value: {self.name} has no effect; it needs "
            return self.no_limit(first, doubt + parameter(self.name).matters)
        self.guesses = self.by_guess(first)
        ends = self.change(first)
        if ends is None:
            return self.no_change(first)
        stands, fails = ends
        while True:
            stands, fails = self.bisect(stands, fails)
            finished(fails.path)
            if not fails.stands:
                point, path = point_at_target(stands), stands.path
                assert path.arrival is not None
                growth = path.growth_until(path.arrival + 1)  # on the way to the target
                return replace(self.result_beyond(fails.path, stands.value, point), growth=growth)
            self.factor = SURE  # the first estimate is wrong for this dam
            ends = self.beyond(fails, fails.value - stands.value)
            if ends is None:
                return self.no_change(fails)
            stands, fails = ends

    def beyond(self, stands: Trial, step: float) -> tuple[Trial, Trial] | None:
        """A bracket beyond a value that stands: the last value with and the first without
        equilibrium. Tried are first the values that failed by their first estimate, whose paths are
        continued, then distances doubled from a step on. None if all allowed values stand.
        """

        def ahead(trial: Trial) -> float:
            return float((trial.value - stands.value) * np.sign(step))

        known = sorted((t for t in self.trials if not t.stands and ahead(t) > 0), key=ahead)
        for trial in known:
            trial.path.follow(SURE)
            if not trial.stands:
                return stands, trial
            stands, step = trial, trial.value - stands.value
        for _ in range(MOST_DOUBLED):
            step *= 2
            value = stands.value + step
            last = self.trial_towards(value, stands.value)
            if last and not last.stands:
                return stands, last
            if not last or last.value != value:
                break
            stands = last
        return None

    def trial_towards(self, value: float, known: float) -> Trial | None:
        """The trial of a value, or of the last one on the way to it that the case allows, which
        begins at a known one; None if it allows none.
        """
        try:
            return self.trial(value)
        except InputError as error:
            self.refused = self.refused or str(error)
        begin = known
        for _ in range(MOST_HALVED):
            between = (known + value) / 2
            try:
                self.case_at(between)
                known = between
            except InputError:
                value = between
        return self.trial(known) if known != begin else None

    def no_change(self, first: Trial) -> CriticalValue:
        """The result if all trials stand, or all fail."""
        tried = [t.value for t in self.trials]
        span = f"{min(tried):.6g} to {max(tried):.6g}{self.unit}"
        further = f"; beyond: {self.refused}" if self.refused else ""
        return self.no_limit(first, f"{result_of(first)} with all values tried, {span}{further}")

    def no_limit(self, trial: Trial, doubt: str) -> CriticalValue:
        """The result without a critical value, and why there is none; trial: any of them."""
        point = point_at_target(trial) if trial.stands else None
        return CriticalValue(None, trial.path.mode, "", doubt, point)

    def change(self, first: Trial) -> tuple[Trial, Trial] | None:
        """The nearest tried values of which one stands and the other fails; None if all trials have
        the first one's result.
        """
        closed = set[bool]()
        for value in chain(self.guesses[:1], self.outwards(first)):
            distance, tried = value - first.value, [t.value - first.value for t in self.trials]
            same_side = [d for d in tried if d * distance > 0]
            if any(abs(d) >= abs(distance) for d in same_side) or (distance > 0) in closed:
                continue  # nearer than a trial with the same result, or not allowed
            trial = self.trial_towards(value, first.value + max(same_side, key=abs, default=0.0))
            if not trial or trial.value != value:
                closed.add(distance > 0)
            if trial and trial.stands != first.stands:
                near = min(self.trials[:-1], key=lambda t: abs(t.value - trial.value))
                return (near, trial) if near.stands else (trial, near)
        return None

    def by_guess(self, first: Trial) -> list[float]:
        """Values beside the gravity method's critical value, the farther from the first trial
        first; empty if the gravity method has none, or another result for the first trial.
        """
        stands = self.gravity.stands
        if stands(first.value) != first.stands:
            return []
        for value in self.outwards(first):
            if stands(value) == (not first.stands):

                def sign(value: float) -> float:
                    return 1.0 if stands(value) == first.stands else -1.0

                guess = float(bisect(sign, first.value, value, rtol=GUESS_PRECISION))
                margin = BESIDE_GRAVITY * abs(guess) * np.sign(value - first.value)
                return [guess + margin, guess - margin]
        return []

    def outwards(self, first: Trial) -> Iterator[float]:
        """Values at increasing distance from the first: towards failure if it stands, else away
        from it; alternately in both directions where failure may be in either.
        """
        low, high = TINY, np.inf
        if self.of != "strength":
            low, high = parameter(self.name).minimum, parameter(self.name).maximum
        up, down = outwards(first.value, high), outwards(first.value, low)
        worse = {"strength": up, "k_h": up, "uplift": down}.get(self.of)
        if worse is None:
            by_turns = chain.from_iterable(zip_longest(up, down))
            return (value for value in by_turns if value is not None)
        return worse if first.stands else (down if worse is up else up)

    def bisect(self, stands: Trial, fails: Trial) -> tuple[Trial, Trial]:
        """Narrow an interval to the precision: at the guesses in it, by secants and at least every
        fourth time by half.
        """
        ends, turn, stood = (stands.value, fails.value), 1, 0
        while abs(ends[0] - ends[1]) > PRECISION * max(map(abs, ends)):
            inside = [v for v in self.guesses if min(ends) < v < max(ends)]
            if inside:
                value = inside[0]
            else:
                # widen the offset fourfold per consecutive success
                share = 0.4 * PRECISION * 4.0 ** max(stood - 1, 0)
                secant = self.extrapolate(stands, fails, share) if turn % 4 else None
                value, turn = middle(*ends) if secant is None else secant, turn + 1
            trial = self.trial(value)
            stands, fails = (trial, fails) if trial.stands else (stands, trial)
            stood = stood + 1 if trial.stands else 0
            ends = stands.value, fails.value
        return stands, fails

    def extrapolate(self, stands: Trial, fails: Trial, share: float) -> float | None:
        """The value at which the highest level reaches the target, by the secant of the two
        failures nearest to a stand; shifted by a share of it, to bracket it. None if outside.
        """
        known = [t for t in self.trials if not t.stands and t.path.points]
        known = sorted(known, key=lambda t: -abs(t.value - stands.value))[-2:]
        values = [t.value for t in known]
        missing = [t.path.target - t.path.highest for t in known]
        if len(set(missing)) < 2:
            return None
        root = values[1] - missing[1] * np.diff(values)[0] / np.diff(missing)[0]
        shift = np.sign(fails.value - stands.value) * share * abs(root)
        low, high = sorted((stands.value, fails.value))
        return next((v for v in (root - shift, root + shift) if low < v < high), None)

    def ended_early(self, error: BaseException) -> CriticalValue:
        """The result of a search that an error or an interrupt has ended: its last trials."""
        standing = [t for t in self.trials if t.stands]
        ends = [f"{t.value:.6g} {result_of(t)}" for t in self.trials[-2:]]
        reason = str(error) or study_end(error)[0]
        doubt = f"{reason}: {', '.join(ends)}" if ends else reason
        point = point_at_target(standing[-1]) if standing else None
        return CriticalValue(None, "", "", doubt, point, error=error)

    def result(
        self, value: float | None, failing: FailurePath, point: Point | None
    ) -> CriticalValue:
        """The result for a value and the path that fails beyond it."""
        mode, why, joint = failing.mode, "", failing.joint
        doubt = "no further equilibrium is found, but no mechanism either"
        if not failing.points:
            doubt = "no equilibrium is found even in the first step"
        elif value is None:
            first = failing.points[0]
            mode = ""
            toe, limit = (with_unit(v, STRESSES) for v in (first.compression, failing.case["f_c"]))
            doubt = (
                f"already at level {first.level:.6g} m, the first equilibrium, the toe's "
                f"compression, {toe}, exceeds f_c = {limit}; --levels may begin lower"
            )
        elif failing.crushed_at_top:
            limit = with_unit(failing.case["f_c"], STRESSES)
            why = f"beyond it the toe's compression passes f_c = {limit}"
        elif failing.slides:
            last = row_of_joint(failing.points[failing.top].last, failing.failing[0])
            what = failing.joint or "joint"
            shear = with_unit(last["T"], FORCES, 5)
            why = f"there the whole {what} slips: T = {shear} is its shear strength"
        elif failing.settled(SURE):
            top, limit_point = failing.points[failing.top], failing.points[failing.limit_point]
            ratio = failing.points[-1].imposed / failing.imposed(limit_point)
            why = (
                f"the equilibrium path reaches {top.level:.6g} m at most (followed to {ratio:.2g} "
                "times the displacement of that level)"
            )
            reached = bound(last_state(self, top))
            if reached.mode:
                where = self.case.named(reached.joints)
                why += f"; there {f'on {where} ' if where else ''}{words_of_bound(reached)}"
        else:
            mode, why, joint = self.by_statics(failing)
        events = events_on(failing.admissible) if failing.admissible else []
        doubt = "" if why else doubt
        return CriticalValue(value, mode, why, doubt, point, joint=joint, events=events)

    def result_beyond(self, failing: FailurePath, value: float, point: Point) -> CriticalValue:
        """The result for a value and the path that fails just beyond it, for another quantity than
        the level. An end before any unstable growth confirms it, if shorter increments find it too.
        """
        result = self.result(value, failing, point)
        if result.why or any(start <= failing.top for start in failing.starts):
            return result
        ended = self.with_end_of(failing, result)
        return ended if ended.why and self.repeated(failing) is None else result

    def with_end_of(self, path: FailurePath, result: CriticalValue) -> CriticalValue:
        """A result that no mechanism confirms, with what the end of its path says."""
        if path.ends_at_strength:
            return replace(result, mode="sliding", why=slips_whole(path), doubt="")
        if path.falls:
            return replace(result, why=lost_beyond_limit(path), doubt="")
        if path.loses_strength:  # after the end of a branch
            return self.with_run(path, replace(result, why=lost_beyond_limit(path), doubt=""))
        if path.branch_ends:
            return self.with_run(path, replace(result, why=end_of_branch(path), doubt=""))
        return result

    def with_run(self, path: FailurePath, result: CriticalValue) -> CriticalValue:
        """A result that rests on the end of a branch alone, with a run to a level above it (for
        another quantity than the level, to the target). Where the run stands, there are equilibria
        beyond: the branch has ended in unstable growth, or is not the highest one.
        """
        level = path.level_above if self.of == "level" else path.target
        run = path.run_to(level)
        if run.stopped:
            comes_near = run.state.loading.level > (1 - ABOVE) * path.highest
            near_drains = path.loses_drains and not comes_near
            return replace(result, why="", doubt=end_at_drains(path)) if near_drains else result
        grows = path.to_growth or path.opens_beyond(run.history)
        if self.of == "level" and self.levels_after:  # up to where it stands
            level = max(path.run_to(path.target, run).history.rows["level"])
        beyond = stands_beyond(result.why, level)
        known = path.interval[1] > level  # from a path by other increments
        result = replace(result, why="", doubt=by_increments(path) if known else beyond)
        if self.of != "level":
            return result
        if grows:
            result = replace(result, mode=GROWTH, why=beyond, doubt="")
        return replace(result, growth=path.highest, stands_at=float(level))

    def by_statics(self, failing: FailurePath) -> tuple[str, str, str]:
        """How an unconfirmed path fails, why, and at which joint, if there are several: its
        resultants have no equilibrium above a level near its highest (below the target, for another
        quantity than the level). Why is empty if they have.
        """
        top = failing.points[failing.top]
        level, mode, joint = highest_by_statics(top.model.case, top.last)
        if not level < (top.level * (1 + NEAR_BOUND) if self.of == "level" else failing.target):
            return failing.mode, "", failing.joint
        why = (
            f"by statics there is no equilibrium above {level:.6g} m, where {REASONS[mode]}; the "
            f"highest computed level is {top.level:.6g} m"
        )
        return mode, why, joint


def finished(path: FailurePath) -> tuple[FailurePath, bool]:
    """A path followed to its end, or only its first branch where that ends in unstable growth, with
    its highest level, from which no short rise of the level and no run leads on; and whether it
    ends so.
    """
    highest = 0.0
    while True:
        path.refine()  # first: a limit point that is known is confirmed sooner
        path.follow(SURE)
        grows = path.to_growth and (path.grows or path.ends)
        if grows and path.jumps:
            path = path.first_branch()
        path.refine()
        if not path.highest > highest:  # the rise before has led no further
            break
        highest = path.highest
        if not (path.rise_on() or path.run_on() or path.step_over()):
            break
    return path.up_to_growth(), grows


def of_each(values: list[float]) -> Setting:
    """A setting from the values of each joint."""
    return tuple(values) if len(values) > 1 else values[0]


def point_at_target(trial: Trial) -> Point:
    """The equilibrium at the target level of a trial that stands."""
    path = trial.path
    assert path.arrival is not None
    if path.points[path.arrival].control != "level":
        path.refine()
    return path.points[path.arrival]


def result_of(trial: Trial) -> str:
    """The result of a trial in a word."""
    return "stands" if trial.stands else "fails"


def middle(a: float, b: float) -> float:
    """Mean of two values: geometric if they differ by more than a factor 2."""
    far = a * b > 0 and not 0.5 <= a / b <= 2
    return float(np.sign(a) * np.sqrt(a * b)) if far else (a + b) / 2


def outwards(value: float, end: float) -> Iterator[float]:
    """Values at increasing distance from a value, halving the distance to a finite end, by factors
    of 2 towards or away from 0, by powers of 10 from 0.
    """
    if np.isfinite(end) and abs(end) > TINY:
        yield from (value + (end - value) * 2.0**-k for k in range(7, -1, -1) if value != end)
    elif value == 0:
        yield from (float(np.sign(end)) * 10.0**k for k in range(-3, 10) if end)
    elif np.isfinite(end) or (end > 0) != (value > 0):
        yield from (value * 2.0**-k for k in range(1, 11))
        yield from [0.0] * (end != TINY)
    else:
        yield from (value * 2.0**k for k in range(1, 13))


def last_state(search: Search, point: Point) -> Results:
    """The results of an equilibrium and of the steps to it, with the user's own parameters."""
    case, history = point.model.case, point.history.copy()
    required = {n: search.case[n] for n in (*QUICK, *DRIVE)}
    if point.state.time > history.saved_until:
        history.save(point.state)
    return history.results(case.with_values(required), stopped=False)
