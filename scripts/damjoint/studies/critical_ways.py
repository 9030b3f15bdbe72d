"""Other ways to a highest level, which have to lead to the same one for it to be confirmed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from ..input.case import Case
from ..solver.path_point import FALL
from .critical_value import CriticalValue
from .failure_path import LOWER_BEGIN, FailurePath

#: The level up to which the levels are prescribed to pass over a growth, over that of the growth.
ABOVE_GROWTH = 1.02
#: Factor by which the fall that is unstable growth is changed, down and up [-]: to this part of it
#: it is known how far the level falls.
FALL_FACTOR = 1.02


@dataclass(frozen=True)
class Way:
    """How a path is followed otherwise, from its beginning on."""

    #: share of the level's rise that an increment aims at
    share: float = 1.0
    #: relative fall of the level that is unstable growth
    unstable_fall: float = FALL
    #: levels and tailwater that are prescribed [m]; empty: those of the case
    levels: tuple[float, ...] = ()
    tails: tuple[float, ...] = ()


#: By shorter and by longer increments.
SHORTER, LONGER = Way(share=0.5), Way(share=1.5)


def repeats_whole(path: FailurePath) -> bool:
    """Whether a path is repeated from its beginning on: where the level is that after the end of a
    branch, or water enters the crack and no mechanism is found, or its points lose cohesion one by
    one all the way.
    """
    lost = path.entering and (path.stops or path.water_withdraws)
    return lost or path.loses_cohesion or bool(path.starts and path.top >= path.starts[0])


def ways_to_confirm(
    first: FailurePath, path: FailurePath, result: CriticalValue, grows: bool, mechanism: bool
) -> list[tuple[FailurePath, Way]]:
    """The other ways that have to lead to the level of a result, with the path that each is
    compared with.

    first: the path to the level; path: the same, continued beyond it; grows: whether a crack grows
    unstably there; mechanism: whether a mechanism confirms it.
    """
    repeated, shown, enters = repeats_whole(first), bool(result.why), path.entering
    grows_unstably = shown and result.leads_higher
    ends = (shown or path.water_withdraws) and not result.leads_higher
    # which points the water reaches, and which ones close again, depends on the increments
    parted = path.water_withdraws or (path.ran_on and not path.slides)
    grows_with_water = grows_unstably and enters and not (parted or first.to_growth)
    lower, longer = (path, lower_begin(path.case)), (path, LONGER)
    over = [(first, way) for way in over_growth(first, repeated)]
    further = [(path, way) for way in at_end(path, repeated and path is first, mechanism)]
    ways: tuple[tuple[bool, list[tuple[FailurePath, Way]]], ...] = (
        # the growth of a single point may be passed over
        (grows_unstably and not enters, over),
        (grows and first.releases_shear, over),
        (first.nearly_grows, over),
        (ends and result.growth is None, further),
        (ends and first.weighed_with_water, [lower]),
        # which points are left depends on all increments
        (first.loses_cohesion and not (first.coarse or first.weighed_with_water), [lower]),
        (parted, [lower, longer]),
        # long ones may pass it over, and to which branch depends on them, too
        (grows_with_water, [(path, replace(lower[1], share=SHORTER.share))]),
        (grows_with_water and path.passed_growth is not None, [longer]),
        (enters and path.softens and mechanism and not (parted or grows_with_water), [lower]),
    )
    return list(dict.fromkeys(way for applies, of in ways if applies for way in of))


def falls_by_water(path: FailurePath) -> bool:
    """Whether the level of a path has fallen where the water withdraws, or falls then."""
    ends = path.points[path.counted - 1], path.points[-1]
    fallen = min(point.level for point in ends) < (1 - FALL) * path.highest
    return path.water_withdraws and fallen


def over_growth(path: FailurePath, repeated: bool) -> Iterator[Way]:
    """Ways that may end at another unstable growth: by shorter increments, unless the path has been
    repeated so, with another fall of the level that counts as growth, and from a lower level. A
    point that releases its shear may be passed over by a step of the level, but by no increment of
    a displacement: where it ends the path, also by levels up to above it, and by none.
    """
    if not repeated:
        yield SHORTER
    yield from (Way(unstable_fall=fall) for fall in (FALL / FALL_FACTOR, FALL * FALL_FACTOR))
    yield lower_begin(path.case)
    levels, tails = path.case.levels, path.case.tail_levels
    if path.releases_shear and path.ended and path.has_last_loads(1.0):
        if sorted(levels) == list(levels):
            yield Way(levels=(LOWER_BEGIN * levels[0],), tails=tails[:1])
        above = ABOVE_GROWTH * path.highest
        if max(levels) < above < path.case.highest_level:
            yield Way(levels=(*levels, above), tails=(*tails, tails[-1]))


def at_end(path: FailurePath, repeated: bool, mechanism: bool) -> Iterator[Way]:
    """Ways beside shorter increments: beyond unstable growth those over it; where a branch ends and
    water enters the crack, each point of which turns the path, from a lower level. repeated: see
    `over_growth`; mechanism: whether one confirms the level.
    """
    if not path.to_growth and path.growth_until(path.top + 1) is not None:
        yield from over_growth(path, repeated)
    elif path.entering and not mechanism:
        yield lower_begin(path.case)


def lower_begin(case: Case) -> Way:
    """The way from a lower first level."""
    (first, *further), tails = case.levels, case.tail_levels
    levels = (LOWER_BEGIN * first, *(further or [first]))
    return Way(levels=levels, tails=tails if further else 2 * tails)
