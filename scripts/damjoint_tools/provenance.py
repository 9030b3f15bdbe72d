"""Origin of measured figures: code, machine and date. A page has figures of one version only."""

from __future__ import annotations

import hashlib
import os
import platform
import re
import subprocess
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path

import damjoint
from damjoint import __version__, data
from damjoint.fem import factor

#: Fields that are recorded with measured figures; code: fingerprint of all source files.
RECORDED = ("version", "commit", "code", "machine", "date")
#: Folders of the checkout that hold the code.
CODE_FOLDERS = ":/scripts", ":/pro", ":/geo", ":/cases"


def provenance() -> dict[str, str]:
    """Return RECORDED of figures that are measured now."""
    values = __version__, commit(), code_fingerprint(), machine(), f"{date.today()}"
    return dict(zip(RECORDED, values, strict=True))


def commit() -> str:
    """Return the commit of the checkout, with a note if its code has changes; empty outside of a
    checkout of this project.
    """
    package = Path(__file__).parents[1]

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(package), *words], capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", "damjoint_tools")  # fails in another project's checkout
        changed = git("status", "--porcelain", "--", *CODE_FOLDERS)
        return git("rev-parse", "--short=7", "HEAD") + (" with changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return ""


def code_fingerprint() -> str:
    """Return the hash of all source files."""
    packages = Path(damjoint.__file__).parent, Path(__file__).parent
    files = [path for package in packages for path in package.rglob("*.py")]
    files += data("pro").rglob("*.pro")
    files += data("geo").glob("*.geo")
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(files))).hexdigest()


def machine() -> str:
    """Return processor, cores, Python and factorisation, in a line."""
    try:
        processor = re.search(r"model name\s*:\s*(.*)", Path("/proc/cpuinfo").read_text())[1]
    except (OSError, TypeError):
        processor = platform.processor() or platform.machine()
    cores = len(os.sched_getaffinity(0))
    return f"{processor}, {cores} cores, Python {platform.python_version()}, {factor.name()}"


def source_line(records: Sequence[Mapping[str, str]], verb: str = "Measured") -> str:
    """Return the line of a page on the origin of its figures.

    records: RECORDED of each figure. Raises ValueError if they are of different code, or of
    unknown code.
    """
    if any(not record.get("version") or not record.get("code") for record in records):
        raise ValueError("figures of an unknown version: version or code is not recorded")
    if len({record["code"] for record in records}) != 1:
        versions = sorted({f"{r['version']} ({r['commit'] or r['code'][:7]})" for r in records})
        raise ValueError(f"figures of different versions: damjoint {', '.join(versions)}")
    first, days = records[0], sorted({record["date"] for record in records})
    when = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    code = f"commit {first['commit']}, {when}" if first["commit"] else when
    machines = " and ".join(dict.fromkeys(record["machine"] for record in records))
    return f"{verb} with damjoint {first['version']} ({code}) on {machines}."
