"""Commands of damjoint_tools, for developers."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from .. import RunError


def tool(name: str) -> ModuleType:
    """Import a module of damjoint_tools. Raises RunError if the tools are not installed."""
    try:
        return import_module(f"damjoint_tools.{name}")
    except ModuleNotFoundError as error:
        if not str(error.name).startswith("damjoint_tools"):
            raise
        raise RunError(
            "damjoint_tools is not installed: this command needs it; install damjoint from its "
            "source folder (pip install .)"
        ) from None
