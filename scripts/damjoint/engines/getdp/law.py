"""A joint law along a path of jumps, by the functions of the problem definition."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from ... import RunError, data
from ...arrays import Values
from ...input.constraints import WORKS, check_acting
from ...input.parameters import assignments, listing, parameter
from ...input.resolve import NO_DAM, load
from ...storage import check_end
from . import process

#: GetDP needs a mesh: a line in the region JOINT (3).
LINE_MESH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
2
1 0 0 0
2 1 0 0
$EndNodes
$Elements
1
1 1 2 3 1 1 2
$EndElements
"""


def evaluate(
    law: str, jumps: np.ndarray, pressure: np.ndarray | None = None, settings: Values | None = None
) -> dict[str, np.ndarray]:
    """The law along a path.

    law: its name; jumps: (n, 3) delta_n, delta_t1, delta_t2 [m], row i a converged step to t = i,
    from the undamaged state; pressure: (n,) [Pa], 0 by default; settings: {parameter: value}.
    Returns columns sigma_n (total), tau_1, tau_2 [Pa], damage, open, slid and the internal
    variables. Raises InputError, RunError.
    """
    parameter("law").check(law)
    jumps = np.asarray(jumps, float).reshape(-1, 3)
    pressure = np.zeros(len(jumps)) if pressure is None else np.asarray(pressure, float)
    given = {**(settings or {}), "law": law}
    works = {f"{name}_t" for name in WORKS} & given.keys()  # their t are rows of the path
    case = load("dam", NO_DAM | {name: given[name] for name in given.keys() - works})
    case = case.with_values({name: parameter(name).check(given[name]) for name in works})
    check_acting(case, len(jumps))
    values = case.values
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "line.msh").write_text(LINE_MESH)
        columns = {
            "path_n": jumps[:, 0],
            "path_t1": jumps[:, 1],
            "path_t2": jumps[:, 2],
            "path_p": pressure,
        }
        problem = folder / "path.pro"
        problem.write_text(
            assignments(values)
            + "".join(listing(n, column) for n, column in columns.items())
            + f'out_dir = "./";\nInclude "{data("pro")}/law_path.pro";\n'
        )
        process.Runner().execute(problem, ["-msh", str(folder / "line.msh"), "-solve", "Path"])
        try:
            check_end(folder / "law.txt", "\n")
            heading, *rows = (folder / "law.txt").read_text().splitlines()
            _, names = heading.split(": ")
            table = np.loadtxt(rows, ndmin=2)
            if len(table) != len(jumps):
                raise ValueError(f"{len(table)} of {len(jumps)} rows")
        except (OSError, ValueError) as damage:
            raise RunError(f"GetDP: its table can not be read: {damage}") from None
    return dict(zip(names.split(), table.T, strict=False))
