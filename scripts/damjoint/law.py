"""A joint law along a path of jumps, evaluated by the very functions of the problem definition."""

from __future__ import annotations

import csv
import sys
import tempfile
from pathlib import Path

import numpy as np

from . import ROOT, InputError, getdp
from .mesh import assignments, listing
from .parameters import load, parameter
from .results import write_csv

#: What the scalar and the vector of a law's memory are called, in the output.
MEMORY = {"rupture": ("kappa", "released_1", "released_2"), "friction": ("lambda", "slip_1", "slip_2")}
JUMPS = ("delta_n", "delta_t1", "delta_t2")

#: GetDP wants a mesh: one line, in the region JOINT (3).
ONE_LINE = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n2\n1 0 0 0\n2 1 0 0\n$EndNodes\n$Elements\n1\n1 1 2 3 1 1 2\n$EndElements\n"


def evaluate(law: str, jumps: np.ndarray, pressure: np.ndarray | None = None, settings: dict | None = None) -> dict[str, np.ndarray]:
    """The law along a path.

    law: rupture or friction; jumps: (n, 3) delta_n, delta_t1, delta_t2 [m], each row one converged step from
    the virgin state on; pressure: (n,) [Pa], 0 by default; settings: {parameter: value}.
    Returns columns sigma_n (total), tau_1, tau_2 [Pa] and the law's state. Raises InputError, RunError.
    """
    parameter("law").check(law)
    jumps = np.asarray(jumps, float).reshape(-1, 3)
    pressure = np.zeros(len(jumps)) if pressure is None else np.asarray(pressure, float)
    values = {**load("dam", settings).values, "law": law}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "one.msh").write_text(ONE_LINE)
        columns = {"path_n": jumps[:, 0], "path_t1": jumps[:, 1], "path_t2": jumps[:, 2], "path_p": pressure}
        problem = folder / "path.pro"
        problem.write_text(
            assignments(values)
            + "".join(listing(n, column) for n, column in columns.items())
            + f'out_dir = "{folder}/";\nInclude "{ROOT}/pro/law_path.pro";\n')
        getdp.execute(problem, ["-msh", str(folder / "one.msh"), "-solve", "Path"])
        table = np.loadtxt(folder / "law.txt", ndmin=2)
    return dict(zip(("sigma_n", "tau_1", "tau_2", *MEMORY[law], "damage", "open", "slid"), table.T, strict=True))


def read_path(path: Path) -> dict[str, np.ndarray]:
    """A path file: columns delta_n, delta_t1, delta_t2 [m] and optionally p [Pa]. Raises InputError."""
    try:
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"path = {path}: {error}") from None
    heads = [h for h in ("delta_n", "delta_t1", "delta_t2", "p") if rows and h in rows[0]]
    if not rows or not set(JUMPS) <= set(heads):
        raise InputError(f"path = {path}: must have the columns delta_n,delta_t1,delta_t2 (and optionally p) and at least one row")
    table = {}
    for head in heads:
        try:
            table[head] = np.array([float(row[head]) for row in rows])
        except (TypeError, ValueError):
            raise InputError(f"path = {path}: column {head} must hold numbers only") from None
        if not np.isfinite(table[head]).all():
            raise InputError(f"path = {path}: column {head} must hold finite numbers only")
    return table


def follow(law: str, path: Path, settings: dict, out: Path | None) -> None:
    """Evaluate a law along the path of a CSV file and write path and answer to out, or print them."""
    parameter("law").check(law)
    table = read_path(path)
    if out is not None and not out.parent.is_dir():
        raise InputError(f"out = {out}: must be a file in an existing folder")
    answer = evaluate(law, np.column_stack([table[n] for n in JUMPS]), table.get("p"), settings)
    write_csv(out or sys.stdout, {**table, **answer})
