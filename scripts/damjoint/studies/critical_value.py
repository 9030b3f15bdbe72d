"""The result of a search for a critical value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ..solver.path_point import Point

#: Relative difference up to which the levels agree that are reached after unstable crack growth.
AFTER_GROWTH = 1e-3


@dataclass(frozen=True)
class CriticalValue:
    """The result of a search for a critical value."""

    #: the largest load (or smallest strength) with an equilibrium; None if there is no limit
    value: float | None
    mode: str
    #: why it is confirmed, or why not; one of them is empty
    why: str
    doubt: str
    #: the last equilibrium
    point: Point | None
    #: critical value of the gravity method; None if it has none
    gravity: float | None = None
    #: the joint that fails by the gravity method, if there are several, and the value of the joint
    #: that fails by the finite elements, if that is another one
    gravity_joint: str = ""
    gravity_there: float | None = None
    #: the critical value with other assumptions, if they change it, {assumption: value}
    gravity_with: Mapping[str, float] = field(default_factory=dict)
    #: notes on the gravity method's values
    notes: Sequence[str] = ()
    #: level of the first unstable crack growth on the way, or at the critical level [m]; None: none
    growth: float | None = None
    #: the highest levels that are reached after the unstable growth that ends the branch, by how it
    #: is passed over [m]
    after: Mapping[str, float] = field(default_factory=dict)
    #: a level above the end of the branch at which a run stands [m]; None: none is known
    stands_at: float | None = None
    #: the joint that fails, if there are several, and the events on the way
    joint: str = ""
    events: Sequence[str] = ()
    #: error or interrupt that ended the search
    error: BaseException | None = None

    @property
    def confirmed(self) -> bool:
        """Whether there is a critical value, and a mechanism or bound of statics beyond it."""
        return self.value is not None and bool(self.why)

    @property
    def leads_higher(self) -> bool:
        """Whether there are equilibria at higher levels, after unstable growth."""
        return bool(self.after) or self.stands_at is not None

    @property
    def failure(self) -> str:
        """The failure mode and, of several joints, the one that fails; empty if there is none."""
        return f"{self.mode} on {self.joint}" if self.mode and self.joint else self.mode

    def by_gravity(self, unit: str) -> list[str]:
        """The values of the gravity method, each with its joint or assumption."""
        if self.gravity is None:
            return []
        where = f" on {self.gravity_joint}" if self.gravity_joint else ""
        values = {f"gravity method{where}": self.gravity}
        if self.gravity_there is not None:
            values[f"on {self.joint}"] = self.gravity_there
        return [f"{n}: {v:.6g}{unit}" for n, v in (values | {**self.gravity_with}).items()]
