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
from .parameters import Case  # noqa: E402
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
    title = f"{case.title}, uplift {case['uplift']}"
    if case["uplift"] == "flow":
        title += f", leakage {result.history['flux'][-1]:.3g} kg/(m s)"
    top.set(ylabel="jump [µm]", title=title)
    bottom.set(ylabel="stress [kPa]", xlabel="x [m], heel to toe")
    for axes in (top, bottom):
        axes.axhline(0, color="black", linewidth=0.5)
        axes.legend(fontsize=8)
        axes.grid(alpha=0.3)
    if case["drive"] != "level":
        draw_curve(result, folder / f"{case.name}_curve.png")
    path = folder / f"{case.name}.png"
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path


def draw_curve(result: Results, path: Path) -> None:
    """Draw the level against the heel's opening; for a uniform pressure also where the rigid dam turns over."""
    case, history = result.case, result.history
    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    begin, end = (history["time"] > case[f"drive_{k}"] + e for k, e in (("begin", 1e-9), ("end", 1e-9)))
    for phase, label, style in ((~begin, "level prescribed", "o-"), (begin & ~end, f"{case['drive']} prescribed", "s-"),
                                (end, "level prescribed again", "^-")):
        axes.plot(result.heel[phase] * 1e6, history["level"][phase], style, markersize=4, label=label)
    if case["face_load"] == "uniform" and case["uplift"] == "none":
        bound = overturning_level(case)
        axes.axhline(bound, color="black", linestyle="--", linewidth=0.8, label=f"rigid dam turns over: {bound:.3f} m")
    axes.set(xlabel="opening of the heel [µm]", ylabel="level [m]", title=case.title)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def overturning_level(case: Case) -> float:
    """Level [m] of a uniform pressure at which the dry dam without tension turns over about its toe."""
    base, crest, height = case["dam_base"], case["dam_crest"], case["dam_height"]
    area = (base + crest) / 2 * height
    centroid = (base**2 + base * crest + crest**2) / (3 * (base + crest))
    weight = case["rho_dam"] * case["g"] * area
    return weight * (base - centroid) / (case["rho_water"] * case["g"] * height**2 / 2)
