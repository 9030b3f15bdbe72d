"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tabulate import tabulate


def markdown(rows: Sequence[tuple[Any, ...]], heads: tuple[str, ...]) -> str:
    """A table in Markdown."""
    return tabulate(rows, heads, tablefmt="github", disable_numparse=True)
