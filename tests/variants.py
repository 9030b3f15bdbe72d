"""Parameters of tests of which most are further variants of a default test."""

from typing import Any

import pytest


def further(first: int, values: Any) -> list[Any]:
    """Values of a parameter, or tuples of several; all but the first few are heavy."""
    values = list(values)
    return [*values[:first], *map(as_heavy, values[first:])]


def as_heavy(value: Any) -> Any:
    """A value, or a tuple of values, whose test is heavy."""
    if hasattr(value, "marks"):
        return value
    return pytest.param(*(value if isinstance(value, tuple) else [value]), marks=pytest.mark.heavy)
