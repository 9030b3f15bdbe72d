"""The graph of the bodies, connected by the joints: what stands on which joints."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

#: The body that carries all others.
ROCK = "foundation"


@dataclass(frozen=True)
class JointGraph:
    """Bodies as nodes, joints as edges; `joints` are their lower and upper bodies, by number."""

    joints: tuple[tuple[str, str], ...]

    def separated(self, numbers: Collection[int]) -> set[str]:
        """The bodies that without the joints of these numbers have no connection to the rock."""
        rest = [pair for k, pair in enumerate(self.joints) if k not in numbers]
        reached, before = {ROCK}, set[str]()
        while reached != before:
            before = set(reached)
            reached |= {body for pair in rest if reached & set(pair) for body in pair}
        return {body for pair in self.joints for body in pair} - reached

    def is_internal(self, number: int) -> bool:
        """Whether other joints hold both bodies, as of a contraction joint: it has no limit."""
        return self.joints[number][0] != ROCK and not self.separated((number,))

    def separating(self, numbers: Sequence[int]) -> tuple[int, ...]:
        """Joints whose failure detaches a body: the first of `numbers` that does so alone, or else
        all joints on the rock if they are among them; else none.
        """
        for k in numbers:
            if self.separated((k,)):
                return (k,)
        on_rock = tuple(k for k, (lower, upper) in enumerate(self.joints) if lower == ROCK != upper)
        return on_rock if set(on_rock) <= set(numbers) else ()
