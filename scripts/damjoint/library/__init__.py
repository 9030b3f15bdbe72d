"""The interface for Python: `import damjoint as dj`.

    case = dj.case("dam", levels=[30, 40, 45], mu=0.8)
    run = dj.run(case)
    run.verdict, run.joint.at(level=45).opening.max()

Results have `plot()`, the picture of the command, and `to_pandas()`, a table as a DataFrame.

Names and units are those of the parameters and of the tables (reference/parameters.md, results.md).
Only `Run.save` writes to disk.
"""

from __future__ import annotations

from .. import LIBRARY
from ..input.case import Case as Case
from ..laws import LAWS as LAWS
from ..laws import Law as Law
from ..studies.plan import Sample as Sample
from .cases import case as case
from .checks import Checks as Checks
from .checks import check as check
from .critical_values import Critical as Critical
from .critical_values import critical as critical
from .quakes import Modes as Modes
from .quakes import Quake as Quake
from .quakes import modes as modes
from .quakes import quake as quake
from .runs import Run as Run
from .runs import Step as Step
from .runs import load_steps as load_steps
from .runs import run as run
from .sweeps import Sweep as Sweep
from .sweeps import sweep as sweep
from .tables import JointTable as JointTable
from .uncertainty import Reliability as Reliability
from .uncertainty import calibrate as calibrate
from .uncertainty import reliability as reliability
from .uncertainty import sensitivity as sensitivity

#: What `import damjoint` offers.
__all__ = [*LIBRARY]
