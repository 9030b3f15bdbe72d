"""Concrete gravity dams on a thin joint that opens, breaks, slides and lets water in.

storage.py  atomic writes, locks on files and folders
model/      what is asked and what comes out, as data: parameters, case, mesh, loads, results
laws/       the joint laws, one file each
fem/        finite elements of the bodies, condensed onto the joint
joint/      the joint between them: interpolation, water, residual and tangent
solver/     load stepping, Newton's method, equilibrium path
engines/    a case solved: condensed/ with the parts above, getdp/ by the problem definition
statics/    gravity method, limit analysis, verdict
post/       tables, pictures, fields and folders of results
accuracy.py the mesh that an accuracy requires, and the error that is left
runner.py   one case, solved and written
studies/    checks, sweeps, critical values, a law along a path, reports
library.py  the interface for Python: case, run, check, critical, fill, own laws
gui/        the Gmsh window
cli.py      the command line; __main__.py what has to be done before it

Each of them uses only those above it. Beside the package stand damjoint_tools: benchmarks, random
verification and the pages made from the code.
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing's own takes time in which an interrupt is not yet heeded
if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

__version__ = "0.2.0"


#: Environment variable; 1: Gmsh may run a user's .geo file, a program that can do anything the user
#: can.
RUN_GEO = "DAMJOINT_RUN_GEO"

#: Relative round-off: computed coordinates, times and values that differ by less are equal.
ROUND_OFF = 1e-9


class InputError(ValueError):
    """Bad input: one line that names the parameter, its value and what is allowed.

    The command exits with 2.
    """


class RunError(RuntimeError):
    """A computation that failed for another reason than the input.

    The command exits with 1.
    """


def data(folder: str) -> Path:
    """The folder geo, pro, cases or reference: in the package where it is installed, else in the
    checkout.
    """
    from importlib.resources import files
    from pathlib import Path

    packaged = Path(str(files(__name__))) / folder
    return packaged if packaged.is_dir() else Path(__file__).resolve().parents[2] / folder


#: What `import damjoint` offers, see library.py; imported when it is used.
LIBRARY = ("LAWS", "Law", "case", "check", "critical", "fill", "run")


def __getattr__(name: str) -> Any:
    if name in LIBRARY:
        from importlib import import_module

        return getattr(import_module(".library", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *LIBRARY]
