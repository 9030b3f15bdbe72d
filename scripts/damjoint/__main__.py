"""python -m damjoint is the command damjoint."""

import sys

from .cli import main

sys.exit(main())
