"""Stress in dam and rock as a report tabulates and draws it: principal stresses, stress along the
faces, pressure on the rock.
"""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from ..arrays import Array, BoolArray
from ..mesh.body import Body
from ..model.fields import Solution, along
from ..pictures.drawing import GREY, panels
from ..pictures.outline import Section, joint_lines, section_outline, skin
from ..pictures.run_picture import is_user_solid
from ..post.field_files import principal
from ..post.summary import Table, formatted_table
from ..units import METRES, STRESSES, Units
from .check import SafetyCheck

#: Distance from the ends of a joint, over its length, within which the stress of elastic bodies is
#: singular and depends on the mesh.
CORNER = 0.05
#: Heights of the stresses along the faces, over the dam's height.
HEIGHTS = (0.1, 0.25, 0.5, 0.75)
#: Elements nearest to a point of a face from whose stress that on the face is extrapolated.
PATCH = 10
#: Percentiles of the dam's stresses between which the colors of a picture lie.
SCALED = (2, 98)
#: Ground shown around the dam, over its size.
AROUND = 0.15
MEGAPASCAL = STRESSES[:1]
ROCK = "foundation"


def corners(solution: Solution, time: float) -> list[tuple[Array, float]]:
    """The ends (k, 3) of the joints at a time, and how far is close to them [m], of each joint."""
    of_joints = []
    for joint in solution.result.joints:
        rows = joint.at(time)
        points, s = np.column_stack([rows[axis] for axis in "xyz"]), rows["s"]
        reach = CORNER * float(np.ptp(s))
        ends = (s < s.min() + reach / 10) | (s > s.max() - reach / 10)
        of_joints.append((points[ends], reach))
    return of_joints


def regular(points: Array, ends: list[tuple[Array, float]]) -> BoolArray:
    """Which of some points (n, 3) are not close to the ends of a joint, see `corners`."""
    result = np.ones(len(points), bool)
    for points_of_end, reach in ends:
        distance, _ = cKDTree(points_of_end).query(points)
        result &= distance > reach
    return result


def stress_of(solution: Solution, time: float, rock: bool) -> tuple[Array, Array]:
    """Middles (n, 3) and stresses (n, 6) [Pa] of the elements of the rock, or of all on it."""
    stress = solution.fields[time].stress
    names = [name for name in stress if (name == ROCK) == rock]
    middles = [solution.bodies[name].middles() for name in names]
    return np.concatenate(middles), np.concatenate([stress[name] for name in names])


def extremes(solution: Solution, time: float) -> Table:
    """Tabulate the largest principal stresses of dam and rock away from the joints' ends."""
    ends = corners(solution, time)
    names, rows = list[str](), list[list[float]]()
    for name, rock in (("dam", False), ("rock", True)):
        middles, stress = stress_of(solution, time, rock)
        away = regular(middles, ends)
        middles, values = middles[away], principal(stress[away])
        names.append(name)
        row = list[float]()
        for column, best in ((2, values[:, 2].argmax()), (0, values[:, 0].argmin())):
            row += [values[best, column], *middles[best, :2]]
        rows.append(row)
    columns = np.array(rows).T
    heads = ("largest", "at x", "y", "smallest", "at x", "y")
    units = (MEGAPASCAL, METRES, METRES) * 2
    table = formatted_table(list(zip(heads, columns, units, strict=True)), 3)
    return table.beside("principal stress", names)


def face_at(face: Array, height: float) -> tuple[Array, Array] | None:
    """The point (2,) [m] of a face (n, 2), from downstream to upstream, at a height, and the unit
    vector (2,) along the face there; None if the face does not cross the height.
    """
    y0, y1 = face[:-1, 1], face[1:, 1]
    crosses = (np.minimum(y0, y1) <= height) & (height <= np.maximum(y0, y1)) & (y0 != y1)
    if not crosses.any():
        return None
    start, end = face[crosses.argmax() :][:2]
    part = (height - start[1]) / (end[1] - start[1])
    return start + part * (end - start), (end - start) / np.linalg.norm(end - start)


def on_face(point: Array, along: Array, tree: cKDTree, stress: Array) -> tuple[float, float]:
    """The normal stress along the face, and that normal to it [Pa], at a point of a face, see
    `face_at`: from the plane through the stresses (n, 6) of the nearest elements, of the tree
    of their middles (n, 2).
    """
    _, nearest = tree.query(point, min(PATCH, tree.n))
    away = tree.data[nearest] - point
    basis = np.column_stack([np.ones(len(away)), away])
    (xx, yy, _, xy, *_), *_ = np.linalg.lstsq(basis, stress[nearest], rcond=None)[0]
    tensor, normal = np.array([[xx, xy], [xy, yy]]), np.array([-along[1], along[0]])
    return float(along @ tensor @ along), float(normal @ tensor @ normal)


def undeformed(solution: Solution, time: float) -> Section | None:
    """The section of the mesh, undeformed; None if a section does not represent the geometry."""
    result, field = solution.result, solution.fields[time]
    if is_user_solid(result.case):
        return None
    lines = joint_lines(result.case, [joint.at(time) for joint in result.joints])
    return section_outline(solution.bodies, field.displacement, 0.0, lines)


def faces(solution: Solution, time: float, section: Section) -> Table:
    """Tabulate the stresses along and normal to both faces of the dam at HEIGHTS."""
    low, high = section.heel[1], section.crest[:, 1].max()
    heights = low + np.array(HEIGHTS) * (high - low)
    middles, stress = stress_of(solution, time, rock=False)
    tree = cKDTree(middles[:, :2])
    columns: list[tuple[str, Array, Units]] = [("y", heights, METRES)]
    for side, face in (("upstream", section.upstream), ("downstream", section.downstream)):
        tangential, normal = np.full((2, len(heights)), np.nan)
        for k, height in enumerate(heights):
            if found := face_at(face, height):
                tangential[k], normal[k] = on_face(*found, tree, stress)
        columns += [
            (f"{side}, along the face", tangential, MEGAPASCAL),
            (f"{side}, normal to it", normal, MEGAPASCAL),
        ]
    return formatted_table(columns, 3)


def rock_pressure(solution: Solution, checks: list[SafetyCheck], time: float) -> Table | None:
    """Tabulate the total pressure of the dam on the rock, of each joint on it by each method: mean,
    at both ends, largest apart from them. None if no joint lies on the rock.
    """
    case, names = solution.result.case, list[str]()
    numbers = list[list[float]]()
    for k, (joint, check) in enumerate(zip(solution.result.joints, checks, strict=True)):
        if case.of_joints and case.of_joints[k].lower != ROCK:
            continue
        for method in (check.finite_elements, check.gravity):
            if method is None or np.isnan(method.numbers["N"]):
                continue
            values, length = method.numbers, joint.case.joint_length
            row = [(values["N"] + values["U"]) / length]
            row += [-values["sigma_n_heel"], -values["sigma_n_toe"]]
            if method is check.finite_elements:
                curves = along(joint.at(time))
                s = (curves["s"] - curves["s"].min()) / np.ptp(curves["s"])
                row.append(-curves["sigma_n"][(s >= CORNER) & (s <= 1 - CORNER)].min())
            else:
                row.append(max(row[1:]))
            numbers.append(row)
            names.append(f"{case.joint_names[k]}, {method.method}")
    if not names:
        return None
    heads = ("mean", "at the heel", "at the toe", "largest apart from the ends")
    columns = [
        (head, values, MEGAPASCAL) for head, values in zip(heads, np.array(numbers).T, strict=True)
    ]
    return formatted_table(columns, 3).beside("pressure on the rock, total", names)


def draw_principal(figure: Figure, solution: Solution, time: float, section: Section) -> None:
    """Draw the largest and the smallest principal stress, in colors that suit the dam's."""
    middles, stress = stress_of(solution, time, rock=False)
    values = principal(stress[regular(middles, corners(solution, time))]) / 1e6
    outline = section.dam.points[section.dam.loop]
    low, high = outline.min(axis=0), outline.max(axis=0)
    room = AROUND * float((high - low).max())
    titles = (2, "largest (tension > 0)"), (0, "smallest (compression < 0)")
    for axes, (column, title) in zip(panels(figure, 1, 2).flat, titles, strict=True):
        bounds = np.percentile(values[:, column], SCALED)
        bound = float(np.abs(bounds).max()) or 1.0
        for name, body in solution.bodies.items():
            if name in solution.fields[time].stress:
                of_body = principal(solution.fields[time].stress[name])[:, column] / 1e6
                mapped = draw_elements(axes, body, of_body, bound)
        axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room / 3))
        axes.set_aspect("equal", adjustable="box")
        axes.set_title(f"{title} principal stress [MPa]", fontsize=8, loc="left")
        bar = figure.colorbar(mapped, ax=axes, shrink=0.8, aspect=22, extend="both")
        bar.ax.tick_params(labelsize=7)


def draw_elements(axes: Axes, body: Body, values: Array, bound: float) -> PolyCollection:
    """Draw the elements of a body that are seen along z in colors of their values (elements,)."""
    polygons, shown = list[Array](), list[Array]()
    front = body.points[:, 2].min() + 1e-9 * np.ptp(body.points[:, :2])
    for faces_of_skin, owners in skin(body):
        seen = (body.points[faces_of_skin, 2] <= front).all(axis=1)
        polygons += list(body.points[faces_of_skin[seen], :2])
        shown.append(values[owners[seen]])
    cells = PolyCollection(polygons, array=np.concatenate(shown), cmap="RdBu_r")
    cells.set(clim=(-bound, bound), edgecolor=GREY, linewidth=0.05, rasterized=True)
    axes.add_collection(cells)
    return cells
