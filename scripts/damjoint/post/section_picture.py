"""Picture of the section: the deformed mesh and its joint, water, silt, drains, other loads, the
resultant. Displacements are exaggerated.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..arrays import Table
from ..input.parameters import constants
from ..input.values import has_drains
from ..model.fields import BROKEN, Solution, distance, nearest_rows, state_of
from ..model.loads import Loading, line_forces
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
    panels,
    runs_of,
)
from .outline import Section, exaggeration, joint_lines, section_of
from .units import FORCES, STRESSES, with_unit

#: Length of an arrow over the dam's size.
ARROW = 0.16
#: Over the dam's height: ground shown beside and below; distance of a level's mark from the edge;
#: depth of the drains; distance of the middle third below the joint.
BESIDE, BELOW, MARK, DRAIN, THIRD = 0.6, 0.45, 0.1, 0.3, 0.025
#: Length of the resultant's arrow over that of the others; space above all, for a label, over the
#: height of the picture.
RESULTANT, LABEL = 2.5, 0.05
#: Height of the axis below the section, and of the legend's usual number of rows [inches].
BOTTOM, LEGEND, ROWS = 0.4, 0.62, 4
#: Arrows of a uniform pressure: places along the face, away from its ends.
PRESSED = np.linspace(0.04, 0.96, 9)
DRAINS = {"color": "#1565c0", "linestyle": "-.", "linewidth": 1.5}


def draw_section(figure: FigureBase, solution: Solution, time: float) -> None:
    """Draw the section at a requested time; a note instead if there is none."""
    (axes,) = panels(figure, left=0.55, right=0.1, bottom=BOTTOM + LEGEND, top=0.25).flat
    axes.set_anchor("N")
    case, field = solution.result.case, solution.fields.get(time)
    rows = [own.at(time) for own in solution.result.joints]
    displacement = field.displacement if field else {}
    scale = exaggeration(displacement, case.size)
    section = None
    if displacement:
        lines = joint_lines(case, rows)
        section = section_of(solution.bodies, displacement, scale, lines)
    if section is None:
        axes.set_axis_off()
        why = "no section: " + (
            "the mesh has none at its lowest z" if displacement else "the run wrote no fields"
        )
        axes.text(0.5, 0.5, why, ha="center", color=GREY, transform=axes.transAxes)
        return
    SectionDrawing(axes, solution, section, time, rows).draw()
    axes.set_title(f"displacements x {scale:g}; dashed: undeformed", fontsize=8, loc="left")


class SectionDrawing:
    """Draws a section onto axes, and its legend."""

    def __init__(
        self,
        axes: Axes,
        solution: Solution,
        section: Section,
        time: float,
        rows: list[Table],
    ) -> None:
        """rows: of each joint."""
        self.axes, self.section, self.rows = axes, section, rows
        self.case, self.joints = solution.result.case, solution.result.joints
        self.state = solution.result.state(time)
        self.states = [own.state(time) for own in self.joints]
        self.loading = Loading.at(self.case, time, self.state["level"], self.state["tail_level"])
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
        for k in range(len(self.joints)):
            self.resultant(k)
        self.axes.set_aspect("equal")
        self.axes.set_xlabel("x [m]", fontsize=9)
        self.axes.set_ylabel("y [m]", fontsize=9)
        self.write_legend()

    def write_legend(self) -> None:
        """Write the legend below the section, which gives way to more rows than usual."""
        handles, labels = zip(*self.legend, strict=True) if self.legend else ((), ())
        figure, more = self.axes.figure, -(-len(labels) // 2) - ROWS
        if more > 0:
            height = figure.bbox.height / figure.dpi
            box = self.axes.get_position(original=True)
            box.y0 = (BOTTOM + LEGEND * (1 + more / ROWS)) / height
            self.axes.set_position(box)
        figure.legend(
            handles,
            labels,
            loc="lower left",
            bbox_to_anchor=(0.01, 0),
            ncols=2,
            fontsize=7.5,
            frameon=False,
            borderpad=0.2,
            columnspacing=1.0,
            labelspacing=0.3,
        )

    def set_limits(self) -> None:
        """Show the dam, and enough ground to fill the axes."""
        dam, ground = self.section.dam.points, self.section.foundation.points
        beside, below = BESIDE * self.height, BELOW * self.height
        left, right = dam[:, 0].min() - beside, dam[:, 0].max() + beside
        bottom = min(self.section.heel[1], self.section.toe[1], self.section.bed[0, 1]) - below
        crest = max(dam[:, 1].max(), self.section.crest[:, 1].max())
        top = max(crest, self.loading.level) + 1.2 * ARROW * self.height
        top += LABEL * (top - bottom)
        width, height = self.axes.bbox.size
        bottom -= max((right - left) * height / width - (top - bottom), 0)
        wider = max((top - bottom) * width / height - (right - left), 0) / 2
        (x0, y0), (x1, _) = ground.min(axis=0), ground.max(axis=0)
        self.axes.set_xlim(max(left - wider, x0), min(right + wider, x1))
        self.axes.set_ylim(max(bottom, y0), top)

    def water(self) -> None:
        """Draw reservoir, tailwater, silt on the deformed faces; a uniform pressure as arrows."""
        level, tail = self.loading.level, self.loading.tail
        if self.case["face_load"] == "uniform":
            self.pressure(self.section.upstream, level)
            self.pressure(self.section.downstream, tail)
            return
        left, right = self.axes.get_xlim()
        for polygon, height, at in (
            (self.section.reservoir(level), level, left + MARK * self.height),
            (self.section.tailwater(tail), tail, right - MARK * self.height),
        ):
            if height > 0 and len(polygon):
                self.axes.fill(*polygon.T, color=WATER, alpha=0.4, linewidth=0, zorder=0)
                self.surface(at, height)
        silt = self.case["silt_height"] * (self.loading.part("silt") > 0)
        polygon = self.section.reservoir(silt)
        if silt > 0 and len(polygon):
            style = {"facecolor": SILT, "alpha": 0.6, "hatch": "...", "linewidth": 0}
            self.axes.fill(*polygon.T, **style, zorder=0.5)
            self.legend.append((Patch(**style), f"silt, {silt:g} m"))

    def surface(self, x: float, level: float) -> None:
        """Mark a water surface with its level."""
        self.axes.plot(x, level, "v", color=WATER, markersize=6, zorder=5)
        self.axes.annotate(
            f"{level:.4g} m",
            (x, level),
            (0, 6),
            textcoords="offset points",
            ha="center",
            fontsize=8,
        )

    def pressure(self, face: np.ndarray, level: float) -> None:
        """Draw arrows of a uniform pressure on a face (n, 2) [m]."""
        size = self.case["rho_water"] * self.case["g"] * level
        if not size:
            return
        along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(face, axis=0).T))])
        tips = np.column_stack([np.interp(PRESSED * along[-1], along, axis) for axis in face.T])
        dx, dy = face[-1] - face[0]
        inwards = np.array([-dy, dx]) / math.hypot(dx, dy)
        for tip in tips:
            self.arrow(tip, inwards, WATER)
        self.legend.append(
            (arrow_handle(WATER), f"pressure {with_unit(size, STRESSES)} on the face")
        )

    def bodies(self) -> None:
        """Draw the deformed mesh, and the undeformed outlines."""
        for body in reversed(self.section.bodies.values()):
            for name, tables in body.faces.items():
                for table in tables:
                    color = ROCK if name == "foundation" else CONCRETE
                    cells = PolyCollection(body.moved[table], facecolor=color, zorder=1)
                    cells.set(edgecolor=GREY, linewidth=0.15, rasterized=True)
                    self.axes.add_collection(cells, autolim=False)
            outline = body.points[[*body.loop, body.loop[0]]]
            self.axes.plot(*outline.T, "--", color=GREY, linewidth=0.6, zorder=2)

    def joint(self) -> None:
        """Draw both faces of each joint in the style of its state; water in the cracks."""
        shown = set[int]().union(*(self.faces(k) for k in range(len(self.joints))))
        for number, style in STATES.items():
            if number in shown:
                handle = Line2D([], [], **self.joint_style(number))
                self.legend.append((handle, f"joint {style.label}"))

    @staticmethod
    def joint_style(number: int) -> dict[str, Any]:
        """Line of the joint in a state."""
        style = STATES[number]
        return {"color": style.color, "linestyle": style.line, "linewidth": 2.4}

    def faces(self, joint: int) -> set[int]:
        """Draw both faces of a joint, and water in its crack; the states of the lower face."""
        faces = []
        case = self.joints[joint].case
        states = state_of(self.rows[joint], case.law)
        for body, face in self.section.joint_faces[joint]:
            state = states[self.rows_at(body.points[face], joint)]
            both_ends = np.minimum(state[:-1], state[1:])
            line = body.moved[face]
            faces.append(np.stack([line[:-1], line[1:]], axis=1))
            self.axes.plot(*line.T, color=DARK, linewidth=0.8, zorder=3)
            for number, first, end in runs_of(both_ends):
                if number in STATES:
                    self.axes.plot(*line[first : end + 1].T, **self.joint_style(number), zorder=3)
        if case["uplift"] != "none" and (both_ends == BROKEN).any():
            crack = np.concatenate([faces[0], faces[1][:, ::-1]], axis=1)[both_ends == BROKEN]
            self.axes.add_collection(PolyCollection(crack, color=WATER, zorder=2), autolim=False)
        return set(both_ends.tolist())

    def rows_at(self, points: np.ndarray, joint: int) -> np.ndarray:
        """Rows of a joint's table nearest to points (n, 2) of the section."""
        lowest = np.full(len(points), self.rows[joint]["z"].min())
        return nearest_rows(np.column_stack([points, lowest]), self.rows[joint])

    def drains(self) -> None:
        """Draw the lines of the joints' drains from them down into the ground."""
        at: dict[str, list[int]] = {}
        for k, own in enumerate(self.joints):
            if has_drains(own.case):
                x, y = self.on_joint(own.case["drain_x"], k)
                self.axes.plot([x, x], [y, y - DRAIN * self.height], **DRAINS, zorder=3)
                at.setdefault(f"{own.case['drain_x']:.3g}", []).append(k)
        for place, joints in at.items():
            name = f" of {self.case.named(joints)}" if len(at) > 1 else ""
            self.legend.append((Line2D([], [], **DRAINS), f"drains{name}, {place} m from the heel"))

    def forces(self) -> None:
        """Draw arrows of ice, additional force, anchor and earthquake, of those that act."""
        case, section, numbers = self.case, self.case.section, constants()
        for name, (fx, fy) in line_forces(case, self.loading).items():
            size = math.hypot(fx, fy)
            region = numbers[name.upper()][0]
            if size and region in section["mark_region"]:
                i = section["mark_region"].index(region)
                tip = np.array([section["mark_x"][i], section["mark_y"][i]])
                label = f"{name} {with_unit(size, FORCES)}"
                self.arrow(self.moved_with_dam(tip), np.array([fx, fy]), DARK, label)
        share = self.loading.part("quake")
        if share and (case["k_h"] or case["k_v"]):
            inertia = np.array([case["k_h"], case["k_v"]])
            ahead = ARROW * self.height * inertia / np.hypot(*inertia)
            self.arrow(self.section.dam.centroid + ahead, inertia, RED)
            shown = ", ".join(f"{n} = {share * case[n]:.3g}" for n in ("k_h", "k_v") if case[n])
            self.legend.append((arrow_handle(RED), f"earthquake, {shown}"))

    def resultant(self, joint: int) -> None:
        """Draw the effective resultant where it meets a joint, and the joint's middle third."""
        length = distance(self.rows[joint]).max()
        third = self.on_joint(np.linspace(length / 3, 2 * length / 3, 30), joint)
        x, y = third.T
        self.axes.plot(x, y - THIRD * self.height, color=GREEN, linewidth=3, zorder=3)
        if joint == 0:
            handle = Line2D([], [], color=GREEN, linewidth=3)
            self.legend.append((handle, "middle third"))
        at, normal, shear = (self.states[joint][n] for n in ("x_resultant", "N", "T"))
        if not math.isfinite(at):
            return
        heel_to_toe = self.section.joints[joint].toe - self.section.joints[joint].heel
        along = heel_to_toe / np.hypot(*heel_to_toe)
        down = np.array([along[1], -along[0]])
        place = self.on_joint(at / self.joints[joint].case.joint_length * length, joint)
        longer = RESULTANT * length / distance(self.rows[0]).max()
        self.arrow(place, normal * down + shear * along, GREEN, "", longer)
        name = self.case.named((joint,))
        which = f"on {name}:" if name else "resultant"
        label = f"{which} {with_unit(math.hypot(normal, shear), FORCES, 3)}, {at:.3g} m from heel"
        self.legend.append((arrow_handle(GREEN), label))

    def on_joint(self, s: float | np.ndarray, joint: int) -> np.ndarray:
        """Points (..., 2) on a joint's deformed lower face at distances s from its heel [m]."""
        body, face = self.section.joint_faces[joint][1]
        along = distance(self.rows[joint])[self.rows_at(body.points[face], joint)]
        return np.stack([np.interp(s, along, axis) for axis in body.moved[face].T], axis=-1)

    def moved_with_dam(self, place: np.ndarray) -> np.ndarray:
        """Displace a point (2,) of the dam."""
        dam = self.section.dam
        i = dam.loop[dam.nearest(place)]
        return place + dam.moved[i] - dam.points[i]

    def arrow(
        self, tip: np.ndarray, along: np.ndarray, color: str, label: str = "", longer: float = 1.0
    ) -> None:
        """Draw an arrow that ends at tip, in a direction (2,), with a label at its tail."""
        x, y = np.asarray(along) / math.hypot(*along)
        tail = np.asarray(tip) - longer * ARROW * self.height * np.array([x, y])
        style = {"arrowstyle": "-|>", "color": color, "linewidth": 1.6, "shrinkB": 0}
        self.axes.annotate("", tip, tail, arrowprops=style, zorder=6)
        aligned = {
            "ha": "center" if abs(x) < 0.5 else "right" if x > 0 else "left",
            "va": "center" if abs(y) < 0.5 else "top" if y > 0 else "bottom",
        }
        away = {"xytext": (-4 * x, -4 * y), "textcoords": "offset points"}
        self.axes.annotate(label, tail, **away, **aligned, fontsize=8, color=color, zorder=6)


def arrow_handle(color: str) -> Line2D:
    """Symbol of an arrow in a legend."""
    return Line2D([], [], color=color, marker=">", markersize=5, linewidth=1.6)
