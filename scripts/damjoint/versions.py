"""Versions of the code and of what it uses, the machine, and memory, as run.json records them."""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import re
import resource
import subprocess
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from . import __version__, data

#: Folders of the checkout that hold the code.
CODE_FOLDERS = "scripts", "pro", "geo", "cases"
#: Packages whose versions are recorded.
PACKAGES = "gmsh", "numpy", "scipy"


def versions() -> dict[str, str]:
    """Return the versions of damjoint, Python and PACKAGES by name."""
    packages = {name: installed(name) for name in PACKAGES}
    return {"damjoint": __version__, **packages, "python": platform.python_version()}


@lru_cache
def code_fingerprint(*packages: Path) -> str:
    """Return the hash of the source files of damjoint and of further packages."""
    folders = Path(__file__).parent, *packages
    files = [path for folder in folders for path in folder.rglob("*.py")]
    files += [*data("pro").rglob("*.pro"), *data("geo").glob("*.geo")]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(files))).hexdigest()


def provenance(getdp: Mapping[str, Any]) -> dict[str, Any]:
    """Return run.json's memory, versions, commit, machine; getdp: its version, peak_memory_mb."""
    numbers = versions() | ({"getdp": getdp["version"]} if getdp.get("version") else {})
    memory = max(peak_memory(), getdp.get("peak_memory_mb") or 0.0)
    return {
        "peak_memory_mb": round(memory, 1),
        "versions": numbers,
        "commit": commit(),
        "machine": machine(),
    }


def peak_memory() -> float:
    """Return the peak resident memory of this process [MB]."""
    with contextlib.suppress(OSError):  # getrusage includes memory of the parent before exec
        if match := re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text()):
            return float(match[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@lru_cache
def installed(name: str) -> str:
    """Return the version of a package; empty if it is not installed."""
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


@lru_cache(maxsize=1)
def git_status() -> subprocess.Popen[str] | None:
    """Start git on the checkout, for `commit`; None outside of a checkout of this project."""
    checkout = Path(__file__).parents[2]
    if not (checkout / ".git").exists():
        return None
    # without locks, which runs at the same time would wait for
    git = "git", "--no-optional-locks", "-C", str(checkout)
    words = "status", "--porcelain=v2", "--branch", "--", *CODE_FOLDERS
    pipe, null = subprocess.PIPE, subprocess.DEVNULL
    with contextlib.suppress(OSError):
        return subprocess.Popen([*git, *words], stdout=pipe, stderr=null, text=True)
    return None


@lru_cache(maxsize=1)
def commit() -> str:
    """Return the commit of this project's checkout, noted if changed; or an empty text."""
    process = git_status()
    status = process.communicate()[0] if process else ""
    head = re.search("^# branch.oid ([0-9a-f]{7})", status)
    changed = re.search("^[^#]", status, re.MULTILINE)
    return head[1] + (" with changes" if changed else "") if head else ""


def machine() -> str:
    """Return processor and cores."""
    try:
        lines = Path("/proc/cpuinfo").read_text()
    except OSError:
        lines = ""
    model = re.search(r"model name\s*:\s*(.*)", lines)
    processor = model[1] if model else platform.processor() or platform.machine()
    return f"{processor}, {len(os.sched_getaffinity(0))} cores"
