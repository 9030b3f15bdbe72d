"""Origin of measured figures: code, machine and date. A page has figures of one version only."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path

from damjoint import __version__, versions
from damjoint.fem import factor

#: Fields that are recorded with measured figures; code: fingerprint of all source files.
RECORDED = ("version", "commit", "code", "machine", "date")


def provenance() -> dict[str, str]:
    """Return RECORDED of figures that are measured now."""
    code = versions.code_fingerprint(Path(__file__).parent)
    values = __version__, versions.commit(), code, machine(), f"{date.today()}"
    return dict(zip(RECORDED, values, strict=True))


def machine() -> str:
    """Return processor, cores, Python and factorisation, in a line."""
    return f"{versions.machine()}, Python {platform.python_version()}, {factor.name()}"


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
