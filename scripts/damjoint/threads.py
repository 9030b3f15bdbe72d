"""Number of threads of the linear algebra, also of libraries that are loaded later."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import ModuleType

from threadpoolctl import threadpool_limits

#: The limits that hold now, the last one within the others, and the stack that ends each.
LIMITS: list[tuple[int | None, ExitStack]] = []


@contextmanager
def limited_threads(number: int | None) -> Iterator[None]:
    """Limit the threads of the linear algebra in a block; None: no limit."""
    with ExitStack() as stack:
        stack.enter_context(threadpool_limits(number))
        LIMITS.append((number, stack))
        try:
            yield
        finally:
            LIMITS.remove((number, stack))


def scipy_linalg() -> ModuleType:
    """scipy.linalg, loaded when it is needed, as it takes long: within the limits that hold."""
    loaded = "scipy.linalg" in sys.modules
    from scipy import linalg

    if not loaded:
        for number, stack in LIMITS:
            stack.enter_context(threadpool_limits(number))
    return linalg
