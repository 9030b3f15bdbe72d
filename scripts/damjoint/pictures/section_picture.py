"""Picture of the section: the deformed mesh and its joint, water, silt, drains, other loads, the
resultant. Displacements are exaggerated.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path

from ..input.scene import DOWN, UP
from ..input.values import has_drains
from ..model.fields import Solution
from ..model.loads import Loading
from .drawing import (
    CONCRETE,
    DARK,
    GREEN,
    GREY,
    RED,
    ROCK,
    SILT,
    STATES,
    WATER,
    AnyFigure,
    arrow_style,
    figure_size,
    panels,
    polygons,
    runs_of,
)
from .outline import Section
from .scene import (
    QUAKE,
    Scene,
    displaced_faces,
    force_label,
    level_label,
    pressed,
    pressure_label,
    resultant_label,
)

#: Length of an arrow over the dam's size.
ARROW = 0.16
#: Over the dam's height: ground shown beside and below, and below at most; distance of a level's
#: mark from the edge; depth of the drains; distance of the middle third below the joint.
BESIDE, BELOW, DEEP, MARK, DRAIN, THIRD = 0.6, 0.45, 0.8, 0.1, 0.3, 0.025
#: Length of the resultant's arrow over that of the others; space above all, for a label, over the
#: height of the picture.
RESULTANT, LABEL = 2.5, 0.05
#: Height of the axis below the section, and of the legend's usual number of rows [inches].
BOTTOM, LEGEND, ROWS = 0.4, 0.68, 4
#: Distance of the legend from the edge of its figure, which else cuts its symbols [inches].
ABOVE_EDGE = 0.06
DRAINS: dict[str, Any] = {"color": "#1565c0", "linestyle": "-.", "linewidth": 1.5}


def draw_section(figure: AnyFigure, solution: Solution, time: float) -> None:
    """Draw the section at a requested time; a note instead if there is none."""
    (axes,) = panels(figure, left=0.55, right=0.1, bottom=BOTTOM + LEGEND, top=0.25).flat
    axes.set_anchor("N")
    why = "no section: the run wrote no fields"
    if time in solution.fields:
        result = solution.result
        state = result.state(time)
        loading = Loading.at(result.case, time, state["level"], state["tail_level"])
        scene = Scene(result, solution.bodies, solution.fields, [time], [loading])
        (section,) = scene.sections
        if section:
            SectionDrawing(axes, scene, section).draw()
            return
        why = "no section: the mesh has none at its lowest z"
    axes.set_axis_off()
    axes.text(0.5, 0.5, why, ha="center", color=GREY, transform=axes.transAxes)


class SectionDrawing:
    """Draws a scene at one time onto axes as its section, and its legend."""

    def __init__(self, axes: Axes, scene: Scene, section: Section) -> None:
        self.axes, self.scene, self.section = axes, scene, section
        self.case, self.joints = scene.case, scene.joints
        (self.loading,) = scene.loadings
        self.height = np.ptp(section.dam.points[:, 1])
        self.legend: list[tuple[Patch | Line2D, str]] = []

    def draw(self) -> None:
        """Draw all, from the back to the front."""
        self.set_limits()
        self.water()
        self.bodies()
        self.joint()
        self.drains()
        self.forces()
        for number in range(len(self.joints)):
            self.resultant(number)
        scale = f"displacements x {self.scene.scale:g}; dashed: undeformed"
        self.axes.set_title(scale, fontsize=8, loc="left")
        self.axes.set_aspect("equal")
        self.axes.set_xlabel("x [m]", fontsize=9)
        self.axes.set_ylabel("y [m]", fontsize=9)
        self.write_legend()

    def write_legend(self) -> None:
        """Write the legend below the section, which gives way to more rows than usual; in a single
        column if there is room.
        """
        handles, labels = zip(*self.legend, strict=True) if self.legend else ((), ())
        figure, height = self.axes.figure, figure_size(self.axes.figure)[1]
        box = self.axes.get_position(original=True)
        room = box.y0 * height - BOTTOM  # inches
        columns = 1 if room > LEGEND * len(labels) / ROWS > LEGEND else 2
        needed = LEGEND * max(-(-len(labels) // columns) / ROWS, 1)
        if needed > room:
            box.y0 = (BOTTOM + needed) / height
            self.axes.set_position(box)
        bottom = max(room - needed, 0) + ABOVE_EDGE
        figure.legend(
            handles,
            labels,
            loc="lower left",
            bbox_to_anchor=(0.01, bottom / height),
            ncols=columns,
            fontsize=7.5,
            frameon=False,
            borderpad=0.2,
            columnspacing=1.0,
            labelspacing=0.3,
        )

    def set_limits(self) -> None:
        """Show the dam, and enough ground to fill the axes, but not more than DEEP: they are then
        lower.
        """
        dam, ground = self.section.dam.points, self.section.foundation.points
        beside, below = BESIDE * self.height, BELOW * self.height
        left, right = dam[:, 0].min() - beside, dam[:, 0].max() + beside
        bottom = min(self.section.heel[1], self.section.toe[1], self.section.bed[0, 1]) - below
        crest = max(dam[:, 1].max(), self.section.crest[:, 1].max())
        top = max(crest, self.loading.level) + 1.2 * ARROW * self.height
        top += LABEL * (top - bottom)
        width, height = self.axes.bbox.size
        deepest = max(bottom - (DEEP - BELOW) * self.height, ground[:, 1].min())
        bottom -= max((right - left) * height / width - (top - bottom), 0)
        wider = max((top - bottom) * width / height - (right - left), 0) / 2
        left, right = max(left - wider, ground[:, 0].min()), min(right + wider, ground[:, 0].max())
        bottom = max(bottom, deepest)
        self.axes.set_xlim(left, right)
        self.axes.set_ylim(bottom, top)
        lower = height - (top - bottom) / (right - left) * width
        if lower > 0:
            box = self.axes.get_position(original=True)
            box.y0 += lower / self.axes.figure.bbox.height
            self.axes.set_position(box)

    def water(self) -> None:
        """Draw reservoir, tailwater, silt on the deformed faces; a uniform pressure as arrows."""
        level, tail = self.loading.level, self.loading.tail
        if self.case["face_load"] == "uniform":
            faces = displaced_faces(self.section)
            for side, height in ((UP, level), (DOWN, tail)):
                if label := pressure_label(self.case, height):
                    tips, inwards = pressed(faces[side])
                    for tip in tips:
                        self.arrow(tip, inwards, WATER)
                    self.legend.append((arrow_handle(WATER), label))
            return
        (fluids,) = self.scene.fluids()
        left, right = self.axes.get_xlim()
        draw_fluid(self.axes, fluids["water"], facecolor=WATER, alpha=0.4, zorder=0)
        for height, x in ((level, left + MARK * self.height), (tail, right - MARK * self.height)):
            if height > 0:
                self.surface(x, height)
        style: dict[str, Any] = {"facecolor": SILT, "alpha": 0.6, "hatch": "..."}
        if draw_fluid(self.axes, fluids["silt"], **style, zorder=0.5):
            self.legend.append(
                (Patch(**style, linewidth=0), f"silt, {self.case['silt_height']:g} m")
            )

    def surface(self, x: float, level: float) -> None:
        """Mark a water surface with its level."""
        self.axes.plot(x, level, "v", color=WATER, markersize=6, zorder=5)
        left, right = self.axes.get_xlim()
        side = "left" if x - left < right - x else "right"  # not beyond the frame
        at: dict[str, Any] = {"xytext": (-5 if side == "left" else 5, 6), "ha": side}
        at |= {"textcoords": "offset points", "fontsize": 8}
        self.axes.annotate(level_label(level), (x, level), **at)

    def bodies(self) -> None:
        """Draw the deformed mesh, and the undeformed outlines."""
        for body in reversed(self.section.bodies.values()):
            for name, tables in body.faces.items():
                for table in tables:
                    color = ROCK if name == "foundation" else CONCRETE
                    cells = polygons(body.moved[table], facecolor=color, zorder=1)
                    cells.set(edgecolor=GREY, linewidth=0.15, rasterized=True)
                    self.axes.add_collection(cells, autolim=False)
            outline = body.points[[*body.loop, body.loop[0]]]
            self.axes.plot(*outline.T, "--", color=GREY, linewidth=0.6, zorder=2)

    def joint(self) -> None:
        """Draw both faces of each joint in the style of its state; water in the cracks."""
        for joint in self.joints:
            (states,) = joint.segment_states
            for upper in (True, False):
                line = self.scene.displaced_face(joint, upper)[0, :, :2]
                self.axes.plot(*line.T, color=DARK, linewidth=0.8, zorder=3)
                for number, first, end in runs_of(states):
                    if number in STATES:
                        part = line[first : end + 1]
                        self.axes.plot(*part.T, **self.joint_style(number), zorder=3)
            cracks = polygons(self.scene.crack(joint)[0, :, :, :2], color=WATER, zorder=2)
            self.axes.add_collection(cracks, autolim=False)
        shown = np.concatenate([joint.segment_states[0] for joint in self.joints])
        for number, style in STATES.items():
            if number in shown:
                handle = Line2D([], [], **self.joint_style(number))
                self.legend.append((handle, f"joint {style.label}"))

    @staticmethod
    def joint_style(number: int) -> dict[str, Any]:
        """Line of the joint in a state."""
        style = STATES[number]
        return {"color": style.color, "linestyle": style.line, "linewidth": 2.4}

    def drains(self) -> None:
        """Draw the lines of the joints' drains from them down into the ground."""
        at: dict[str, list[int]] = {}
        for k, joint in enumerate(self.joints):
            if has_drains(joint.case):
                x, y, _ = self.scene.on_joint(joint, joint.case["drain_x"])[0]
                self.axes.plot([x, x], [y, y - DRAIN * self.height], **DRAINS, zorder=3)
                at.setdefault(f"{joint.case['drain_x']:.3g}", []).append(k)
        for x_drains, joints in at.items():
            name = f" of {self.case.named(joints)}" if len(at) > 1 else ""
            label = f"drains{name}, {x_drains} m from the heel"
            self.legend.append((Line2D([], [], **DRAINS), label))

    def forces(self) -> None:
        """Draw arrows of ice, additional force, anchor and earthquake, of those that act."""
        for name, ((tip,), (force,)) in self.scene.forces().items():
            label = force_label(name, force)
            if name == QUAKE:  # inside the dam: from its centroid, without a text there
                ahead = ARROW * self.height * force / np.hypot(*force)
                self.arrow(tip[:2] + ahead, force, RED)
                self.legend.append((arrow_handle(RED), f"{name}, {label}"))
            else:
                self.arrow(tip[:2], force, DARK, label)

    def resultant(self, number: int) -> None:
        """Draw the effective resultant where it meets a joint, and the joint's middle third."""
        joint = self.joints[number]
        x, y = self.scene.middle_third(joint)[0, :, :2].T
        self.axes.plot(x, y - THIRD * self.height, color=GREEN, linewidth=3, zorder=3)
        if number == 0:
            handle = Line2D([], [], color=GREEN, linewidth=3)
            self.legend.append((handle, "middle third"))
        (tip,), (force,) = self.scene.resultant(joint)
        if force.any():
            longer = RESULTANT * joint.s.max() / self.joints[0].s.max()
            self.arrow(tip[:2], force, GREEN, "", longer)
            label = resultant_label(self.case.named((number,)), joint.states[0])
            self.legend.append((arrow_handle(GREEN), label))

    def arrow(
        self, tip: np.ndarray, along: np.ndarray, color: str, label: str = "", longer: float = 1.0
    ) -> None:
        """Draw an arrow that ends at tip, in a direction (2,), with a label at its tail."""
        x, y = np.asarray(along) / math.hypot(*along)
        tail = np.asarray(tip) - longer * ARROW * self.height * np.array([x, y])
        style = arrow_style(color, shrinkA=2)
        self.axes.annotate("", tuple(tip), tuple(tail), arrowprops=style, zorder=6)
        aligned: dict[str, Any] = {
            "ha": "center" if abs(x) < 0.5 else "right" if x > 0 else "left",
            "va": "center" if abs(y) < 0.5 else "top" if y > 0 else "bottom",
        }
        away: dict[str, Any] = {"xytext": (-4 * x, -4 * y), "textcoords": "offset points"}
        self.axes.annotate(label, tuple(tail), **away, **aligned, fontsize=8, color=color, zorder=6)


def arrow_handle(color: str) -> Line2D:
    """Symbol of an arrow in a legend."""
    return Line2D([], [], color=color, marker=">", markersize=5, linewidth=1.6)


def draw_fluid(axes: Axes, quads: np.ndarray, **style: Any) -> bool:
    """Draw quadrangles (n, 4, 2) of a fluid as one area; whether it has any."""
    (x, y), (x1, y1) = (corners.transpose(2, 0, 1) for corners in (quads, np.roll(quads, -1, 1)))
    twice = np.sum(x * y1 - x1 * y, axis=1)
    quads = np.where((twice < 0)[:, None, None], quads[:, ::-1], quads)[twice != 0]
    if len(quads):
        path = Path.make_compound_path(*(Path(quad, closed=False) for quad in quads))
        axes.add_patch(PathPatch(path, linewidth=0, **style))
    return len(quads) > 0
