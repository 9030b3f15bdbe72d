"""The interface for Python: `import damjoint as dj`.

    case = dj.case("dam", levels=[30, 40, 45], mu=0.8)
    run = dj.run(case)
    run.verdict, run.joint.at(level=45).opening.max()

Results have `plot()`, the picture of the command, and `to_pandas()`, a table as a DataFrame.

Names and units are those of the parameters and of the tables (reference/parameters.md, results.md).
Only `Run.save` writes to disk.
"""

from __future__ import annotations

from ..input.case import Case
from ..laws import LAWS, Law
from ..studies.plan import Sample
from .cases import case
from .checks import Checks, check
from .critical_values import Critical, critical
from .quakes import Modes, Quake, modes, quake
from .runs import Run, Step, load_steps, run
from .sweeps import Sweep, sweep
from .tables import JointTable
from .uncertainty import Reliability, calibrate, reliability, sensitivity

#: What `import damjoint` offers, as in its `LIBRARY`.
__all__ = ["LAWS", "Case", "Checks", "Critical", "JointTable", "Law", "Modes", "Quake", "Run"]
__all__ += ["Reliability", "Sample", "Step", "Sweep", "calibrate", "case", "check", "critical"]
__all__ += ["load_steps", "modes", "quake", "reliability", "run", "sensitivity", "sweep"]
