"""Concrete gravity dams on a thin joint that opens, breaks, slides and lets water in.

storage.py  files written whole or not at all, by one process at a time
scene/    what is asked: parameters, case files, meshes
results/  what comes out: tables, verdict, fields, pictures, comparison with published numbers
engines/  how it is solved: getdp/ runs the problem definition, condensed/ follows the joint alone
accuracy.py  the mesh that an accuracy asks for, and what is still wrong on it
run.py    one case, solved and written
studies/  what is done with runs: checks, sweeps, critical values, benchmarks, a law along a path
window/   the Gmsh window, with the condensed engine behind it
cli.py    the command line; __main__.py what has to be done before it

Each of them uses only those above it.
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing's own takes time in which an interrupt is not yet heeded
if TYPE_CHECKING:
    from pathlib import Path

__version__ = "0.2.0"


#: Environment variable; 1: Gmsh may run a user's .geo file, a program that can do anything the user
#: can.
RUN_GEO = "DAMJOINT_RUN_GEO"


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
