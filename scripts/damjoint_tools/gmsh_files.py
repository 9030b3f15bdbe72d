"""Files for the window of Gmsh of cases with a geometry of their own:
python -m damjoint_tools.gmsh_files MY.case ...
"""

from __future__ import annotations

import sys
from pathlib import Path

from damjoint.engines.getdp.gmsh_files import write_gmsh_files
from damjoint.input.resolve import load


def main() -> None:
    """Write the files of the cases that are named, beside the first one."""
    write_gmsh_files([load(name) for name in sys.argv[1:]], Path(sys.argv[1]).parent)


if __name__ == "__main__":
    main()
