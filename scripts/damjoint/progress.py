"""Progress of long work: a bar on a terminal; elsewhere, as in a file, a line every ten seconds."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any, TypeVar

from tqdm import tqdm

#: Seconds between two lines, and without an update after which a line says so.
INTERVAL = 10.0

Item = TypeVar("Item")


class Progress:
    """Progress of one piece of work, a context manager.

    The lines come from a thread: also while the work does not report, as during unstable crack
    growth or in another process.
    """

    def __init__(
        self, title: str, total: float | None = None, show: bool = True, **options: Any
    ) -> None:
        """total: of all updates; show: whether anything is printed; options: of tqdm's bar."""
        terminal = sys.stderr.isatty()
        self.bar = tqdm(desc=title, total=total, disable=not (show and terminal), **options)
        self.title, self.total, self.done = title, total, 0.0
        self.start = self.updated = time.monotonic()
        self.over = threading.Event()
        if show and not terminal:
            threading.Thread(target=self.write_lines, daemon=True).start()

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.over.set()
        self.bar.close()

    def update(self, amount: float = 1.0) -> None:
        """Add to what is done."""
        self.done, self.updated = self.done + amount, time.monotonic()
        self.bar.update(amount)

    def describe(self, title: str) -> None:
        """Replace the title."""
        self.title, self.updated = title, time.monotonic()
        self.bar.set_description_str(title)

    def write_lines(self) -> None:
        """Print lines to stderr until the work is over."""
        while not self.over.wait(INTERVAL):
            with contextlib.suppress(OSError, ValueError):  # closed
                print(self.line(), file=sys.stderr, flush=True)

    def line(self) -> str:
        """Title, part that is done, elapsed time, and how long there has been no update."""
        now, parts = time.monotonic(), [self.title]
        if self.total:
            parts.append(f"{100 * self.done / self.total:.0f} %")
        parts.append(tqdm.format_interval(now - self.start))
        if now - self.updated > INTERVAL:
            parts.append(f"nothing new for {tqdm.format_interval(now - self.updated)}")
        return ", ".join(parts)


def track(items: Iterable[Item], title: str, total: int | None = None) -> Iterator[Item]:
    """Iterate with progress; total: number of items, by default their length."""
    count = total if total is not None or not hasattr(items, "__len__") else len(items)
    with Progress(title, count) as progress:
        for item in items:
            yield item
            progress.update()
