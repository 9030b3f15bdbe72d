"""The picture of the section: the deformed dam and its joint, water, silt, drains, other loads, the
resultant. What has moved is drawn from the mesh, with its displacement exaggerated.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import FigureBase
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..model.case import has_drains
from ..model.fields import (
    CLOSED,
    OPEN,
    SLIPPED,
    SOFTENING,
    Solution,
    distance,
    nearest_rows,
    state_of,
)
from ..model.loads import Loading, line_forces
from ..model.parameters import constants
from .drawing import CONCRETE, DARK, GREEN, GREY, ORANGE, RED, ROCK, SILT, VIOLET, WATER, panels
from .outline import Section, section_of
from .units import FORCES, STRESSES, told

#: Of the dam's size: the largest displacement drawn, an arrow, what is seen beside and below.
MOVED, ARROW, BESIDE, BELOW = 0.06, 0.16, 0.6, 0.45


def exaggeration(displacement: dict[str, np.ndarray], size: float) -> float:
    """The factor, of one digit, by which displacements are drawn."""
    largest = max((np.abs(u).max(initial=0) for u in displacement.values()), default=0)
    return float(f"{MOVED * size / largest:.1g}") if largest > 0 else 1.0


def draw_section(figure: FigureBase, solution: Solution, time: float) -> None:
    """The section at a requested time; a word instead if there are no fields, or no section."""
    (axes,) = panels(figure, left=0.6, right=0.1, bottom=1.05).flat
    case, field = solution.result.case, solution.fields.get(time)
    rows = solution.result.at(time)
    where = distance(rows)
    ends = np.array([[rows[axis][i] for axis in "xyz"] for i in (where.argmin(), where.argmax())])
    moved = field.displacement if field else {}
    scale = exaggeration(moved, case.size)
    section = section_of(solution.bodies, moved, scale, ends) if moved else None
    if section is None:
        axes.set_axis_off()
        why = "no section: " + ("the mesh shows none" if moved else "no fields were written")
        axes.text(0.5, 0.5, why, ha="center", color=GREY, transform=axes.transAxes)
        return
    Drawing(axes, solution, section, time, rows).draw()
    axes.set_title(f"displacements x {scale:g}; dashed: before them", fontsize=9, loc="left")


class Drawing:
    """A section on its way onto axes; collects its legend."""

    def __init__(
        self,
        axes: Axes,
        solution: Solution,
        section: Section,
        time: float,
        rows: dict[str, np.ndarray],
    ) -> None:
        self.axes, self.section, self.rows = axes, section, rows
        self.case = solution.result.case
        self.state = solution.result.state(time)
        self.loading = Loading.at(self.case, time, self.state["level"], self.state["tail_level"])
        self.height = np.ptp(section.dam.points[:, 1])
        self.legend: list[tuple[Patch | Line2D, str]] = []

    def draw(self) -> None:
        """Everything, from the back to the front."""
        self.limits()
        self.water()
        self.bodies()
        self.joint()
        self.drains()
        self.forces()
        self.resultant()
        self.axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
        handles, labels = zip(*self.legend, strict=True) if self.legend else ((), ())
        self.axes.legend(
            handles,
            labels,
            loc="upper left",
            bbox_to_anchor=(-0.1, -0.1),
            ncols=2,
            fontsize=8,
            frameon=False,
        )

    def limits(self) -> None:
        """What is seen: the dam, and as much of the ground as goes with it and fills the axes."""
        dam, under = self.section.dam.points, self.section.under.points
        beside, below = BESIDE * self.height, BELOW * self.height
        left, right = dam[:, 0].min() - beside, dam[:, 0].max() + beside
        bottom = min(self.section.heel[1], self.section.toe[1], self.section.bed[0, 1]) - below
        crest = max(dam[:, 1].max(), self.section.crest[:, 1].max())
        top = max(crest, self.loading.level) + 1.2 * ARROW * self.height
        top += 0.05 * (top - bottom)  # words over an arrow
        width, height = self.axes.bbox.size
        bottom -= max((right - left) * height / width - (top - bottom), 0)
        wider = max((top - bottom) * width / height - (right - left), 0) / 2
        (x0, y0), (x1, _) = under.min(axis=0), under.max(axis=0)
        self.axes.set_xlim(max(left - wider, x0), min(right + wider, x1))
        self.axes.set_ylim(max(bottom, y0), top)

    def water(self) -> None:
        """Reservoir, tailwater and silt against the deformed faces; a pressure that is uniform as
        arrows.
        """
        level, tail = self.loading.level, self.loading.tail
        if self.case["face_load"] == "uniform":
            self.pressure(self.section.upstream, level)
            self.pressure(self.section.downstream, tail)
            return
        left, right = self.axes.get_xlim()
        for polygon, height, at in (
            (self.section.reservoir(level), level, left + 0.12 * self.height),
            (self.section.tailwater(tail), tail, right - 0.12 * self.height),
        ):
            if height > 0 and len(polygon):
                self.axes.fill(*polygon.T, color=WATER, alpha=0.4, linewidth=0, zorder=0)
                self.surface(at, height)
        silt = self.case["silt_height"] * (self.loading.part("silt") > 0)
        polygon = self.section.reservoir(silt)
        if silt > 0 and len(polygon):
            look = {"facecolor": SILT, "alpha": 0.6, "hatch": "...", "linewidth": 0}
            self.axes.fill(*polygon.T, **look, zorder=0.5)
            self.legend.append((Patch(**look), f"silt, {silt:g} m"))

    def surface(self, x: float, level: float) -> None:
        """The mark of a water surface with its level."""
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
        """Arrows of a uniform pressure against a face (n, 2) [m]."""
        size = self.case["rho_water"] * self.case["g"] * level
        if not size:
            return
        place = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(face, axis=0).T))])
        tips = np.column_stack(
            [np.interp(np.linspace(0.04, 0.96, 9) * place[-1], place, axis) for axis in face.T]
        )
        dx, dy = face[-1] - face[0]
        inwards = np.array([-dy, dx]) / math.hypot(dx, dy)
        for tip in tips:
            self.arrow(tip, inwards, WATER)
        self.legend.append((arrow_handle(WATER), f"pressure {told(size, STRESSES)} on the face"))

    def bodies(self) -> None:
        """The deformed mesh, and the outlines before."""
        for plane in (self.section.under, self.section.dam):
            for name, tables in plane.faces.items():
                for table in tables:
                    color = ROCK if name == "foundation" else CONCRETE
                    cells = PolyCollection(plane.moved[table], facecolor=color, zorder=1)
                    cells.set(edgecolor=GREY, linewidth=0.12, rasterized=True)
                    self.axes.add_collection(cells, autolim=False)
            outline = plane.points[[*plane.loop, plane.loop[0]]]
            self.axes.plot(*outline.T, "--", color=GREY, linewidth=0.6, zorder=2)

    def joint(self) -> None:
        """Both lips where the joint is broken or open, softens, or has slipped; water in the
        crack.
        """
        shown, lips = set(), []
        for plane, lip in self.section.lips:
            row = self.rows_at(plane.points[lip])
            state = state_of(self.rows)[row]
            both = np.minimum(state[:-1], state[1:])
            lips.append(np.stack([plane.moved[lip][:-1], plane.moved[lip][1:]], axis=1))
            for number, color in enumerate((DARK, ORANGE, VIOLET, RED)):
                some = lips[-1][both == number]
                width = 0.8 if number == CLOSED else 2.2
                self.axes.add_collection(
                    LineCollection(some, color=color, linewidth=width, zorder=3), autolim=False
                )
                shown |= {number} if len(some) else set()
        if self.case["uplift"] != "none" and OPEN in shown:
            crack = np.concatenate([lips[0], lips[1][:, ::-1]], axis=1)[both == OPEN]
            self.axes.add_collection(PolyCollection(crack, color=WATER, zorder=2), autolim=False)
        for number, color, label in (
            (OPEN, RED, "joint open or broken"),
            (SOFTENING, VIOLET, "joint softening"),
            (SLIPPED, ORANGE, "joint slipped"),
        ):
            if number in shown:
                self.legend.append((Line2D([], [], color=color, linewidth=2.2), label))

    def rows_at(self, points: np.ndarray) -> np.ndarray:
        """The joint's rows nearest to places (n, 2) of the section."""
        lowest = np.full(len(points), self.rows["z"].min())
        return nearest_rows(np.column_stack([points, lowest]), self.rows)

    def drains(self) -> None:
        """The drains' line, from where it meets the joint down into the ground."""
        case = self.case
        if not has_drains(case):
            return
        x, y = self.on_joint(case["drain_x"])
        look = {"color": "#1565c0", "linestyle": "-.", "linewidth": 1.5}
        self.axes.plot([x, x], [y, y - 0.3 * self.height], **look, zorder=3)
        self.legend.append(
            (Line2D([], [], **look), f"drains, {case['drain_x']:.3g} m from the heel")
        )

    def forces(self) -> None:
        """Arrows for ice, another force, anchor, earthquake: those that are on."""
        case, section, numbers = self.case, self.case.section, constants()
        for name, (fx, fy) in line_forces(case, self.loading).items():
            size = math.hypot(fx, fy)
            region = numbers[name.upper()][0]
            if size and region in section["mark_region"]:
                i = section["mark_region"].index(region)
                tip = np.array([section["mark_x"][i], section["mark_y"][i]])
                self.arrow(self.moved_with_dam(tip), (fx, fy), DARK, f"{name} {told(size, FORCES)}")
        share = self.loading.part("quake")
        if share and (case["k_h"] or case["k_v"]):
            push = np.array([case["k_h"], case["k_v"]])
            ahead = ARROW * self.height * push / np.hypot(*push)
            self.arrow(self.section.dam.centroid + ahead, push, RED)
            said = ", ".join(f"{n} = {share * case[n]:.3g}" for n in ("k_h", "k_v") if case[n])
            self.legend.append((arrow_handle(RED), f"earthquake, {said}"))

    def resultant(self) -> None:
        """Where the effective resultant meets the joint, and the joint's middle third."""
        length = distance(self.rows).max()
        third = self.on_joint(np.linspace(length / 3, 2 * length / 3, 30))
        x, y = third.T
        self.axes.plot(x, y - 0.025 * self.height, color=GREEN, linewidth=3, zorder=3)
        self.legend.append((Line2D([], [], color=GREEN, linewidth=3), "middle third of the joint"))
        at, normal, shear = (self.state[n] for n in ("x_resultant", "N", "T"))
        if not math.isfinite(at):
            return
        along = (self.section.toe - self.section.heel) / np.hypot(
            *(self.section.toe - self.section.heel)
        )
        down = np.array([along[1], -along[0]])
        place = self.on_joint(at / self.case.joint_length * length)
        self.arrow(place, normal * down + shear * along, GREEN, "", 2.5)
        where = f"resultant {told(math.hypot(normal, shear), FORCES)}, {at:.3g} m from the heel"
        self.legend.append((arrow_handle(GREEN), where))

    def on_joint(self, s: float | np.ndarray) -> np.ndarray:
        """The places (..., 2) on the deformed lower lip at distances from the heel [m]."""
        plane, lip = self.section.lips[1]
        places = distance(self.rows)[self.rows_at(plane.points[lip])]
        return np.stack([np.interp(s, places, axis) for axis in plane.moved[lip].T], axis=-1)

    def moved_with_dam(self, place: np.ndarray) -> np.ndarray:
        """A place (2,) of the dam after its displacement."""
        dam = self.section.dam
        i = dam.loop[dam.nearest(place)]
        return place + dam.moved[i] - dam.points[i]

    def arrow(
        self, tip: np.ndarray, along: np.ndarray, color: str, said: str = "", longer: float = 1.0
    ) -> None:
        """An arrow that ends at tip, of a direction, with words behind its tail."""
        x, y = np.asarray(along) / math.hypot(*along)
        tail = np.asarray(tip) - longer * ARROW * self.height * np.array([x, y])
        look = {"arrowstyle": "-|>", "color": color, "linewidth": 1.6, "shrinkB": 0}
        self.axes.annotate("", tip, tail, arrowprops=look, zorder=6)
        place = {
            "ha": "center" if abs(x) < 0.5 else "right" if x > 0 else "left",
            "va": "center" if abs(y) < 0.5 else "top" if y > 0 else "bottom",
        }
        away = {"xytext": (-4 * x, -4 * y), "textcoords": "offset points"}
        self.axes.annotate(said, tail, **away, **place, fontsize=8, color=color, zorder=6)


def arrow_handle(color: str) -> Line2D:
    """What stands for an arrow in a legend."""
    return Line2D([], [], color=color, marker=">", markersize=5, linewidth=1.6)
