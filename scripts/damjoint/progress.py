"""Progress of long work: a bar on a terminal; elsewhere, as in a file, a line every ten seconds."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sized
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from tqdm import tqdm

#: Seconds before a bar appears: what takes less does not load it.
DELAY = 0.3

#: Seconds between two lines, and without an update after which a line says so.
INTERVAL = 10.0

Item = TypeVar("Item")


class Progress:
    """Progress of one piece of work, a context manager.

    Bar and lines come from a thread: also while the work does not report, as during unstable crack
    growth or in another process.
    """

    def __init__(
        self,
        title: str,
        total: float | None = None,
        show: bool = True,
        soon: bool = False,
        **options: Any,
    ) -> None:
        """total: of all updates; show: whether anything is printed; soon: whether also the first
        line comes as soon as a bar; options: of tqdm's bar.
        """
        self.soon, self.stage = soon, ""
        self.title, self.total, self.done, self.options = title, total, 0.0, options
        self.start = self.updated = time.monotonic()
        self.over = threading.Event()
        self.bar: tqdm[Any] | None = None
        self.thread: threading.Thread | None = None
        if show:
            work = self.show_bar if sys.stderr.isatty() else self.write_lines
            self.thread = threading.Thread(target=work, daemon=True)
            self.thread.start()

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self.over.set()
        if self.thread:
            self.thread.join()
        if self.bar is not None:  # a bar without total has no truth value
            self.bar.close()

    def update(self, amount: float = 1.0) -> None:
        """Add to what is done."""
        self.done, self.updated = self.done + amount, time.monotonic()
        if self.bar is not None:
            self.bar.update(self.done - self.bar.n)

    def describe(self, title: str, stage: str = "") -> None:
        """Replace the title; stage: what is done beside the work that is counted."""
        self.title, self.stage, self.updated = title, stage, time.monotonic()
        if self.bar is not None:
            self.bar.set_description_str(", ".join(filter(None, [title, stage])))

    def show_bar(self) -> None:
        """Show the bar on the terminal, unless the work is over before."""
        if self.over.wait(DELAY):
            return
        from tqdm import tqdm

        bar = tqdm(desc=self.title, total=self.total, initial=self.done, **self.options)
        bar.start_t -= time.monotonic() - self.start
        self.bar = bar
        self.update(0)  # an update may have come before the bar was there

    def write_lines(self) -> None:
        """Print lines to stderr until the work is over."""
        wait = DELAY if self.soon else INTERVAL
        while not self.over.wait(wait):
            wait = INTERVAL
            with contextlib.suppress(OSError, ValueError):  # closed
                print(self.line(), file=sys.stderr, flush=True)

    def line(self) -> str:
        """Title, part that is done, stage, elapsed time, and how long there has been no update."""
        now, parts = time.monotonic(), [self.title]
        if self.total:
            parts.append(f"{100 * self.done / self.total:.0f} %")
        parts += [*filter(None, [self.stage]), clock(now - self.start)]
        if now - self.updated > INTERVAL:
            parts.append(f"nothing new for {clock(now - self.updated)}")
        return ", ".join(parts)


def clock(seconds: float) -> str:
    """Seconds as [hours:]minutes:seconds."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes:02}:{rest:02}"


def track(items: Iterable[Item], title: str, total: int | None = None) -> Iterator[Item]:
    """Iterate with progress; total: number of items, by default their length."""
    count = len(items) if total is None and isinstance(items, Sized) else total
    with Progress(title, count) as progress:
        for item in items:
            yield item
            progress.update()
