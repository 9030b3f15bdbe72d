"""By which code, when and on what machine figures were measured; no page mixes two versions."""

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

#: What is recorded with measured figures: code is a fingerprint of all that is computed with.
RECORDED = ("version", "commit", "code", "machine", "date")
#: The checkout's folders whose changes a commit does not have.
OF_CODE = ":/scripts", ":/pro", ":/geo", ":/cases"


def provenance() -> dict[str, str]:
    """RECORDED of what is measured now."""
    found = __version__, commit(), sources(), machine(), f"{date.today()}"
    return dict(zip(RECORDED, found, strict=True))


def commit() -> str:
    """The checkout's commit, and whether its code has been changed since; empty outside of one."""
    package = Path(__file__).parents[1]

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(package), *words], capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", "damjoint_tools")  # or it is another project's checkout
        changed = git("status", "--porcelain", "--", *OF_CODE)
        return git("rev-parse", "--short=7", "HEAD") + (" with changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return ""


def sources() -> str:
    """A fingerprint of the code."""
    packages = Path(damjoint.__file__).parent, Path(__file__).parent
    files = [path for package in packages for path in package.rglob("*.py")]
    files += data("pro").rglob("*.pro")
    files += data("geo").glob("*.geo")
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(files))).hexdigest()


def machine() -> str:
    """Processor, cores, Python and factorisation, in a line."""
    try:
        told = Path("/proc/cpuinfo").read_text()
        processor = re.search(r"model name\s*:\s*(.*)", told)[1]
    except (OSError, TypeError):
        processor = platform.processor() or platform.machine()
    cores = len(os.sched_getaffinity(0))
    return f"{processor}, {cores} cores, Python {platform.python_version()}, {factor.name()}"


def said(records: Sequence[Mapping[str, str]], how: str = "Measured") -> str:
    """The line of a page on where its figures come from.

    records: RECORDED of each. Raises ValueError if they are of different code, or do not say.
    """
    if any(not record.get("version") or not record.get("code") for record in records):
        raise ValueError("figures that do not say which damjoint has measured them")
    if len({record["code"] for record in records}) != 1:
        versions = sorted({f"{r['version']} ({r['commit'] or r['code'][:7]})" for r in records})
        raise ValueError(f"figures of different versions: damjoint {', '.join(versions)}")
    first, days = records[0], sorted({record["date"] for record in records})
    when = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    code = f"commit {first['commit']}, {when}" if first["commit"] else when
    machines = " and ".join(dict.fromkeys(record["machine"] for record in records))
    return f"{how} with damjoint {first['version']} ({code}) on {machines}."
