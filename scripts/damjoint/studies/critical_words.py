"""What is said of the equilibrium path that a critical value ends."""

from __future__ import annotations

from ..model.results import column_of
from ..solver.path import STRENGTH_LOST
from ..solver.path_point import Point
from .failure_path import FailurePath


def by_increments(path: FailurePath) -> str:
    """What is said of a highest level that is not certain."""
    low, high = path.interval
    on = "the increments of displacement"
    if path.weighed_with_water:
        on += " and on the first level (the weight alone leads to no equilibrium)"
    return f"between {low:.6g} and {high:.6g} m, depending on {on}"


def falls_at_once(point: Point) -> str:
    """What is said of a path whose level falls from its first point on."""
    return (
        f"the level falls from the first equilibrium on, at {point.level:.6g} m, and single steps "
        "do not lead there; --levels may begin lower"
    )


def beyond_limit(path: FailurePath) -> str:
    """What is said of unstable crack growth at the highest level of a branch."""
    beyond = f"the equilibria beyond it are lower, down to {path.lowest_after_top:.6g} m"
    if path.top + 1 == len(path.points):
        beyond = "no increment of the displacement, however short, leads on"
    return f"there the crack grows unstably: {beyond}, and shorter ones lead to the same level"


def lost_beyond_limit(path: FailurePath) -> str:
    """What is said of a path that is lost beyond the limit point, or not followed farther."""
    low = path.lowest_after_top
    end = f"followed below {STRENGTH_LOST:g} of it" if path.loses_strength else "found"
    return (
        f"there the level has a limit point: the equilibria beyond it are lower, down to {low:.6g} "
        f"m, shorter increments lead to the same, and further ones are not {end}"
    )


def end_of_branch(path: FailurePath) -> str:
    """What is said of a path that ends at its highest level."""
    return (
        "there the branch of equilibria ends: no increment of the crest, of the joints or of the "
        "process zone, however short, leads on, and shorter ones end at the same level"
    )


def stands_beyond(end: str, level: float) -> str:
    """What is said of the end of a path, in words, above which a run stands at a level [m]."""
    where = "on another branch, where the state may depend on its steps"
    return f"{end}; but a run stands at {level:.6g} m, {where}"


def end_at_drains(path: FailurePath) -> str:
    """What is said of a path that ends where a crack may take the effect of drains."""
    return (
        "there the branch of equilibria ends, but each point that the water reaches beside the "
        "drains turns it: another path may lead to another level"
    )


def withdrawn(path: FailurePath) -> str:
    """What is said of a path on which the water leaves the crack."""
    last = path.points[path.counted - 1].level
    falls = last < (1 - path.unstable_fall) * path.highest
    begin = (
        f"there the level falls to {last:.6g} m, from where on" if falls else f"above {last:.6g} m"
    )
    return (
        f"{begin} points of the crack close again and part its water from the reservoir: the "
        "equilibria beyond it have less uplift than an open crack, and no path leads on at a level "
        "just above the highest one"
    )


def slips_whole(path: FailurePath) -> str:
    """What is said of a path that ends where the whole joint slips."""
    return (
        f"there the whole {path.joint or 'joint'} slips; no increment of the displacement leads "
        "to a higher level, and shorter ones lead to the same"
    )


#: What happens to a joint, by the column of the history that is then positive.
EVENTS = {"crack_length": "opens", "slip_length": "slips"}


def events_on(points: list[Point]) -> list[str]:
    """When each of several joints first opens and slips on a path, in the order of the levels."""
    case, events = points[0].model.case, list[tuple[int, str]]()
    for k in range(len(case.of_joints)):
        for name, verb in EVENTS.items():
            first = next((i for i, p in enumerate(points) if p.last[column_of(name, k)] > 0), None)
            if first is not None:
                level = points[first].level
                events.append((first, f"{case.named((k,))} {verb} from {level:.5g} m"))
    listed = ", ".join(text for _, text in sorted(events))
    return [f"on the way: {listed}"] if listed else []
