"""The water in a joint by the gravity method: its pressure for a crack of a given length."""

from __future__ import annotations

import numpy as np

from .. import InputError
from ..input.case import Case
from ..input.values import flows
from ..model.loads import heads_at_ends
from ..model.network import WaterPath
from .rigid_block import JointLine


def path_of(case: Case, tail: float) -> WaterPath | None:
    """The path of the water through a joint at a level of the tailwater [m]; None if it leaves at
    more than one toe or at a heel, and in 3D where joints meet.
    """
    path = WaterPath.of(case)
    return path if path and tail <= path.highest_tail else None


class Uplift:
    """The water in the joint for a crack of length a from the heel: pressure [Pa] linear between
    positions s [m].

    Heads as in `heads_at_ends`. By `uplift`: none; imposed: linear from heel to toe; drained:
    reduced at the drains; cracked: that of the heel in the crack, beyond it as imposed or, with
    drains beyond the crack, as drained [USACE EM 1110-2-2200]; flow: as cracked without drains, the
    limit of the cubic law for a narrow closed joint; waterstop: the reservoir's up to it, none
    behind it. The pressure is not below zero.
    """

    def __init__(
        self,
        case: Case,
        body: JointLine,
        level: float,
        tail: float,
        crack: float,
        dry_until: float = 0.0,
    ) -> None:
        """dry_until: end [m] of the part without pressure that an earthquake has opened."""
        self.length, mode, path = body.length, case["uplift"], path_of(case, tail)
        if not path:
            raise InputError(
                f"uplift = {mode}: has no gravity method where joints meet and water leaves at "
                "more than one toe or at a heel"
            )
        path = path.at(level + case["joint_head_offset"])
        flowing = path.exits or flows(case)
        heights = path.heel_y, path.toe_y, flowing, path.rest_y
        ends = heads_at_ends(case, level, tail, *heights)
        #: heads at both ends of the path through the joint: heel and toe if it meets no other [m]
        self.first, self.last = first, last = float(ends[0]), float(ends[1])
        #: distance from the heel and head of the outlet [m] of drains that the crack has not passed
        self.drains: tuple[float, float] | None = None
        wet_crack, crack = crack, crack if mode in ("cracked", "flow") else 0.0
        drained = mode == "drained" or (mode == "cracked" and case["drains"])
        if mode == "waterstop" and not path.goes_on:
            first = last = level + case["joint_head_offset"]
        positions, heads = [0.0, crack, self.length], [first, first, last]
        at = case["drain_x"]
        if path.goes_on:
            positions, heads = self._on_path(case, body, path, tail, crack)
        elif drained and crack <= at < self.length:
            # that of the gallery or, if higher, the tailwater
            outlet = max(case["drain_level"], tail, body.heel[1] + at * body.along[1])
            self.drains = at, outlet
            undrained = float(np.interp(at, positions[1:], heads[1:]))
            if mode == "drained" and case["drain_reference"] == "reservoir":
                undrained = first
            positions.insert(2, at)
            effect = case["drain_effectiveness"]  # on the head above the outlet of the drains
            heads.insert(2, undrained - effect * max(undrained - outlet, 0.0))
        self.s = np.array(positions)
        height = np.interp(self.s, [0.0, self.length], [body.heel[1], body.toe[1]])
        weight = case["rho_water"] * case["g"] if mode != "none" else 0.0
        self.p = weight * (np.array(heads) - height)
        self.cut_off_suction()
        if mode == "waterstop":
            self.stop(min(case["waterstop"], self.length))
        if dry_until > wet_crack:
            self.dry(wet_crack, dry_until)

    def _on_path(
        self, case: Case, body: JointLine, path: WaterPath, tail: float, crack: float
    ) -> tuple[list[float], list[float]]:
        """Places [m] and heads [m] in a joint whose path goes on in others, which are not cracked:
        linear between the ends and the drains of the path without the crack, which conducts freely.
        """
        length, share = self.length, abs(path.end - path.begin)
        if not share:  # a branch in which the water is at rest
            head = self.first + (self.last - self.first) * path.begin
            return [0.0, length], [head, head]
        whole, forwards = length / share, path.end > path.begin
        start = path.begin * whole - (0 if forwards else crack)

        def along(s: float) -> float:
            return start + (1 if forwards else -1) * max(s - crack, 0.0)

        drains = [
            (whole * line.at, line.outlet, line.effectiveness, whole * line.reference)
            for line in path.drains
        ]
        at = case["drain_x"]
        if case["uplift"] == "cracked" and case["drains"] and crack <= at < length:
            outlet = max(case["drain_level"], body.heel[1] + at * body.along[1])
            self.drains = at, max(outlet, tail)
            drains = [(along(at), outlet, case["drain_effectiveness"], along(at))]
        ends = [0.0, whole - crack], [self.first, self.last]
        knots, positions = dict(zip(*ends, strict=True)), [0.0, crack, length]
        before, head = 0.0, self.first
        for drain, outlet, effect, reference in drains:
            share = (drain - before if before else reference) / (whole - crack - before)
            undrained = head + (self.last - head) * share
            knots[drain] = undrained - effect * max(undrained - max(outlet, tail), 0.0)
            before, head = drain, knots[drain]
            distance = (drain - start) * (1 if forwards else -1) + crack
            positions += [distance] if crack < distance < length else []
        positions, at_knots = sorted(positions), sorted(knots)
        heads = np.interp([along(s) for s in positions], at_knots, [knots[x] for x in at_knots])
        return positions, heads.tolist()

    def cut_off_suction(self) -> None:
        """Set negative pressures to zero."""
        s, p = self.s, self.p
        crossings = np.flatnonzero(p[:-1] * p[1:] < 0)
        if len(crossings):
            share = p[crossings] / (p[crossings] - p[crossings + 1])
            zeros = s[crossings] + share * (s[crossings + 1] - s[crossings])
            self.s, p = np.insert(s, crossings + 1, zeros), np.insert(p, crossings + 1, 0.0)
        self.p = np.maximum(p, 0.0)

    def stop(self, at: float) -> None:
        """Take the pressure away behind a waterstop [m from the heel]."""
        before = self.s < at
        pressure = np.interp(at, self.s, self.p) if at else 0.0
        self.s = np.concatenate([self.s[before], [at, at, self.length]])
        self.p = np.concatenate([self.p[before], [pressure, 0.0, 0.0]])

    def dry(self, start: float, end: float) -> None:
        """Take the pressure away between two positions [m from the heel]."""
        s, p = self.s, self.p
        first, last = np.interp([start, end], s, p)
        wet = [(s[s < start], p[s < start]), ([start], [first])] if start > 0 else []
        parts = [*wet, ([start, end], [0.0, 0.0]), ([end], [last]), (s[s > end], p[s > end])]
        self.s, self.p = (np.concatenate(column) for column in zip(*parts, strict=True))

    @property
    def force(self) -> float:
        """U, normal to the joint [N/m]."""
        return float(np.sum(np.diff(self.s) * (self.p[1:] + self.p[:-1])) / 2)

    @property
    def moment(self) -> float:
        """About the toe, lifting the dam > 0 [N m/m]."""
        arm, p = self.length - self.s, self.p
        parts = p[:-1] * (2 * arm[:-1] + arm[1:]) + p[1:] * (arm[:-1] + 2 * arm[1:])
        return float(np.sum(np.diff(self.s) * parts) / 6)
