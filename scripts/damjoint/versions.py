"""Versions of the code and of what it uses, and the machine, as run.json records them."""

from __future__ import annotations

import os
import platform
import re
import subprocess
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

from . import __version__

#: Folders of the checkout that hold the code.
CODE_FOLDERS = "scripts", "pro", "geo", "cases"
#: Packages whose versions are recorded.
PACKAGES = "gmsh", "numpy", "scipy"


def versions() -> dict[str, str]:
    """Return the versions of damjoint, Python and PACKAGES by name."""
    packages = {name: version(name) for name in PACKAGES}
    return {"damjoint": __version__, **packages, "python": platform.python_version()}


@lru_cache(maxsize=1)
def commit() -> str:
    """Return the commit of the checkout, with a note if its code has changes; empty outside of a
    checkout of this project.
    """
    checkout = Path(__file__).parents[2]
    if not (checkout / ".git").exists():
        return ""

    def git(*words: str) -> str:
        done = subprocess.run(
            # without locks, which runs at the same time would wait for
            ["git", "--no-optional-locks", "-C", str(checkout), *words],
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.strip()

    try:
        changed = git("status", "--porcelain", "--", *CODE_FOLDERS)
        return git("rev-parse", "--short=7", "HEAD") + (" with changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return ""


def machine() -> str:
    """Return processor and cores."""
    try:
        lines = Path("/proc/cpuinfo").read_text()
    except OSError:
        lines = ""
    model = re.search(r"model name\s*:\s*(.*)", lines)
    processor = model[1] if model else platform.processor() or platform.machine()
    return f"{processor}, {len(os.sched_getaffinity(0))} cores"
