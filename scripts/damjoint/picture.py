"""The picture of a run: the deformed dam, and the joint with the reference points on it."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.collections import PolyCollection  # noqa: E402

from . import validate  # noqa: E402
from .fields import Field  # noqa: E402
from .mesh import Mesh  # noqa: E402
from .results import Results, rows_at  # noqa: E402


def outline(points: np.ndarray, cells: list[tuple[str, np.ndarray]]) -> list[np.ndarray]:
    """The plane cells of a body, or in 3D the element sides at z = 0, as rows of point numbers."""
    sides = {"tetra": ([0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]), "wedge": ([0, 1, 2], [3, 4, 5]),
             "hexahedron": ([0, 1, 2, 3], [4, 5, 6, 7])}
    found = []
    for shape, table in cells:
        for side in sides.get(shape, (slice(None),)):
            faces = table[:, side]
            found.append(faces[np.all(np.abs(points[faces, 2]) < 1e-9, axis=1)])
    return found


def draw(result: Results, mesh: Mesh, fields: dict[float, Field], folder: Path) -> Path:
    """Draw the last state to folder/<case>.png and return its path; fields: at least the last one.

    Left: the deformed bodies, displacement exaggerated so that it shows. Right: opening and slip, normal and
    shear stress along the joint (mean over z in 3D), with the reference values of the case.
    """
    case = result.case
    rows = rows_at(result.joint, None)
    x = np.unique(np.round(rows["x"], 9))
    mean = {n: np.array([rows[n][np.abs(rows["x"] - v) < 1e-8].mean() for v in x]) for n in rows}
    figure, ((left, top), (_, bottom)) = plt.subplots(2, 2, figsize=(12, 7), width_ratios=(1, 1.3), layout="constrained")
    left.remove()
    _.remove()
    left = figure.add_subplot(figure.axes[0].get_gridspec()[:, 0])

    if fields:
        moved = fields[max(fields)].displacement
        largest = max(np.abs(u).max() for u in moved.values())
        scale = 0.06 * case["dam_height"] / largest if largest > 0 else 1.0
        for name, color in (("foundation", "#d8c9ae"), ("dam", "#c3ccd6")):
            body = mesh.bodies[name]
            place = (body.points + scale * moved[name])[:, :2]
            for faces in outline(body.points, body.cells):
                left.add_collection(PolyCollection(place[faces], facecolor=color, edgecolor="#5a5a5a", linewidth=0.15))
        level = rows["level"][0]
        left.fill_betweenx([0, level], -case["found_side"], 0, color="#7fb2e5", alpha=0.5, linewidth=0)
        left.set(xlim=(-case["found_side"] * 1.05, (case["dam_base"] + case["found_side"]) * 1.03), aspect="equal",
                 ylim=(-case["found_depth"] * 1.05, case["dam_height"] * 1.1), xlabel="x [m]", ylabel="y [m]")
        left.set_title(f"level {level:g} m, displacement x {scale:.2g}", fontsize=10)

    top.plot(x, mean["delta_n"] * 1e6, label="opening", color="#0b5394")
    top.plot(x, mean["delta_t1"] * 1e6, label="slip (downstream)", color="#cc7a00")
    bottom.plot(x, mean["sigma_n"] / 1e3, label="normal stress (total)", color="#0b5394")
    bottom.plot(x, mean["tau_1"] / 1e3, label="shear stress", color="#cc7a00")
    if case["uplift"] != "none":
        bottom.plot(x, -mean["p"] / 1e3, label="minus water pressure", color="#3d9be0", linestyle="--")
    marks = {"delta_n": (top, 1e6, "#0b5394"), "delta_t1": (top, 1e6, "#cc7a00"), "sigma_n": (bottom, 1e-3, "#0b5394")}
    for row in validate.references(case):
        if row.quantity in marks and row.tolerance is not None:
            axes, factor, color = marks[row.quantity]
            axes.errorbar(row.x, row.value * factor, yerr=abs(row.value * row.tolerance * factor), fmt="o", markersize=4,
                          color=color, markerfacecolor="white", capsize=2)
    top.set(ylabel="jump [µm]", title=f"{case.title}, uplift {case['uplift']}")
    bottom.set(ylabel="stress [kPa]", xlabel="x [m], heel to toe")
    for axes in (top, bottom):
        axes.axhline(0, color="black", linewidth=0.5)
        axes.legend(fontsize=8)
        axes.grid(alpha=0.3)
    path = folder / f"{case.name}.png"
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path
