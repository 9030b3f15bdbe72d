"""States of an earthquake at chosen times: tables of the joints, displacement and stress."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from ..arrays import Array
from ..fem.bodies import material_of
from ..fem.elasticity import stress
from ..model.fields import Field
from ..model.results import Results
from ..solver.history import History
from ..solver.model import StepResult
from .step import Moving
from .stepper import Earthquake
from .system import System

#: Largest number of frames.
MOST_FRAMES = 200
#: Share of the interval of frames by which a time may miss them: sums of steps have round-off.
NEAR = 1e-6


@dataclass
class Frames:
    """The frames so far: the static state, every `interval` in a span, the record's last step."""

    #: [s], a multiple of the time step
    interval: float
    span: tuple[float, float]
    history: History
    #: of `Problem.retained` since the static state (k,)
    displacement: list[Array] = field(default_factory=list)

    @staticmethod
    def of(quake: Earthquake, span: tuple[float, float] | None = None) -> Frames:
        """The frame of the static state; span: of all others [s], by default the whole record."""
        span = span or (0.0, math.inf)
        interval = frame_interval(quake.dt, quake.record.duration, span)
        frames = Frames(interval, span, History(quake.problem.model.equilibrium))
        frames.add(quake, quake.problem.at_rest, 0, 0.0)
        return frames

    def __len__(self) -> int:
        return len(self.displacement)

    def wanted(self, time: float, duration: float) -> bool:
        """Whether there is a frame at a time, of a record of a duration."""
        near = NEAR * self.interval
        first, last = self.span
        regular = abs(time - round(time / self.interval) * self.interval) < near
        at_end = time > duration - near
        return (regular or at_end) and first - near < time < last + near

    def add(self, quake: Earthquake, moving: Moving, iterations: int, residual: float) -> None:
        """The frame of a state."""
        state = replace(moving.state, time=moving.time)
        history = self.history
        history.add(StepResult(state, iterations, residual), 0)
        moved = moving.retained.displacement
        history.rows["crest_ux"][-1] = float((quake.problem.crest @ moved)[0])
        history.save(state)
        history.saved.clear()  # the tables have all that is needed of it
        self.displacement.append(moved)

    def cut(self, number: int) -> None:
        """Keep a number of frames."""
        rows = {name: values[:number] for name, values in self.history.rows.items()}
        self.history.rows, self.history.tables = rows, self.history.tables[:number]
        self.displacement = self.displacement[:number]

    def results(self, quake: Earthquake) -> Results:
        """The tables; times in seconds, crest_ux since the static state."""
        result = self.history.results(quake.case, stopped=False)
        result.history["load_factor"] = np.ones(len(self))
        return result

    def fields(self, quake: Earthquake, static: Field) -> dict[float, Field]:
        """Displacement and stress by time, those of the static state included."""
        moved = quake.problem.whole(np.array(self.displacement).T)
        displacement, stresses, nodes = {}, {}, {}
        material, dim = material_of(quake.case), quake.bodies.mesh.dim
        for name, matrix in quake.system.motion.items():
            space = quake.system.spaces[name]
            u = (matrix @ moved).T.reshape(len(self), -1, dim)
            stresses[name] = static.stress[name] + stress(space, u, material)
            nodes[name] = len(space.body.points)
            parts = [static.displacement[name]]
            parts += [static.at_midpoints[name]] if space.order == 2 else []
            displacement[name] = np.concatenate(parts) + space.at_locations(u)
        return {
            time: Field.of(
                {name: u[i] for name, u in displacement.items()},
                {name: s[i] for name, s in stresses.items()},
                nodes,
            )
            for i, time in enumerate(self.history.rows["time"])
        }


def frame_interval(dt: float, duration: float, span: tuple[float, float]) -> float:
    """The smallest multiple of dt at which there are at most MOST_FRAMES in a span: the static
    state, both ends of the span, and the end of a record of a duration.
    """
    first, last = span
    steps = (min(last, duration) - first) / dt
    return dt * max(1, math.ceil(steps / (MOST_FRAMES - 3) - NEAR))


def at_nodes(system: System, displacement: Array) -> dict[str, Array]:
    """The displacement (nodes, dim) of each body in a state w (n,)."""
    return {
        name: (matrix @ displacement).reshape(len(system.spaces[name].locations), -1)[
            : len(system.spaces[name].body.points)
        ]
        for name, matrix in system.motion.items()
    }
