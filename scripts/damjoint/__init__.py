"""Concrete gravity dams on a thin joint that opens, breaks, slides and lets water in.

    import damjoint as dj

    run = dj.run(dj.case("dam", levels=[30, 40, 45], mu=0.8))
    print(run.verdict, run.joint.at(level=45).opening.max())  # [m]

`help(dj.case)`, `help(dj.run)`, ... describe the functions, reference/python.md their use.
The package:

arrays.py   types of arrays; csr.py: sparse matrices; threads.py: threads of the linear algebra
units.py    units in which values are shown
storage.py  atomic writes, locks on files and folders
progress.py progress of long work, on a terminal and in redirected output
processes.py work in several processes
versions.py versions of the code and of what it uses, machine
laws/       the joint laws, one file each
input/      parameters, case files, a case and its checks
mesh/       meshes, by Gmsh or a user's own, with their regions and joints
model/      loads, water between joints, results
fem/        finite elements of the bodies, condensed onto the joint or, large in 3D, uncondensed
joint/      the joint between them: interpolation, water, residual and tangent
solver/     load stepping, Newton's method, equilibrium path
dynamics/   time integration of an earthquake
engines/    the engines: condensed/ from the parts above, getdp/ by the problem definition
statics/    gravity method, limit analysis, verdict; in words: notes on a case, hints, end of a run
post/       tables, fields and folders of results
pictures/   shapes of a scene; pictures of section, joint, history and check
accuracy.py mesh refinement to a required accuracy, error estimate
session.py  the life of a study in its output folder
runner.py   solves a case and writes its results
studies/    checks, sweeps, critical values, reliability, a law along a path, reports
verification/  published tests, for `damjoint validate`
library/    the interface for Python: case, run, check, quake, modes, ...; its words:
            python_words.py
gui/        the Gmsh window
cli/        the command line, a file for each command; __main__.py prepares its process

Each uses only those above it. damjoint_tools, beside the package: benchmarks, random verification
and the pages made from the code.
"""

from __future__ import annotations

TYPE_CHECKING = False  # importing typing takes time in which an interrupt is not yet handled
if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path
    from typing import Any

    from .library import *  # noqa: F403

__version__ = "0.2.0"

#: Environment variable; 1: Gmsh may run a user's .geo file, a program with all the user's rights.
RUN_GEO = "DAMJOINT_RUN_GEO"

#: Relative round-off: computed coordinates, times and values that differ by less are equal.
ROUND_OFF = 1e-9


class InputError(ValueError):
    """Bad input: one line that names the parameter, its value and what is allowed.

    The command exits with 2.
    """


def require(holds: object, name: str, value: float | str, rule: str) -> None:
    """Raise InputError, "name = value: must rule", unless a condition holds."""
    if not holds:
        shown = value if isinstance(value, str) else f"{value:g}"
        raise InputError(f"{name} = {shown}: must {rule}")


def meant(word: str, known: Iterable[str], most: int = 3) -> str:
    """Return "did you mean ...?" with the known names nearest a word, those that it begins first;
    empty if none is near.
    """
    import difflib

    names = list(known)
    near = [name for name in names if name.lower() == word.lower()]
    begun = [name for name in names if len(word) > 2 and name.lower().startswith(word.lower())]
    near = near or list(dict.fromkeys(begun + difflib.get_close_matches(word, names, most)))[:most]
    return f"did you mean {' or '.join(near)}?" if near else ""


class RunError(RuntimeError):
    """A computation failed, though not because of bad input.

    The command exits with 1.
    """


def data(folder: str) -> Path:
    """The folder geo, pro, cases or reference: of the package if installed, or the checkout."""
    from pathlib import Path

    packaged = Path(__file__).parent / folder
    return packaged if packaged.is_dir() else Path(__file__).resolve().parents[2] / folder


#: What `import damjoint` offers, see library/; imported when it is used.
LIBRARY = (
    *("case", "run", "load_steps", "check", "critical", "quake", "modes", "sweep"),
    *("reliability", "calibrate"),
    *("Case", "Run", "JointTable", "Step", "Checks", "Critical", "Quake", "Modes", "Sample"),
    *("Sweep", "Reliability", "sensitivity"),
    *("Law", "LAWS"),
)
__all__ = [*LIBRARY, "InputError", "RunError"]


def __getattr__(name: str) -> Any:
    if name == "fill":  # until the next version
        import warnings

        warnings.warn("dj.fill is called dj.load_steps now", DeprecationWarning, stacklevel=2)
        name = "load_steps"
    if name in LIBRARY:
        from importlib import import_module

        return getattr(import_module(".library", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
