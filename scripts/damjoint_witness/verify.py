"""All checks of a run's files."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from . import earthquake, replay, statics, stops, tables, water, water_in_motion, water_in_time
from .files import Files, Table, read_table, rows_where
from .reader import Request, read


class Witness:
    """The files of a run or of an earthquake beside the request of its command."""

    def __init__(self, files: Files) -> None:
        self.files = files

    @cached_property
    def request(self) -> Request:
        """The request of the command."""
        return read(self.files.words)

    @property
    def shaken(self) -> earthquake.Shaken:
        """The files of an earthquake."""
        return earthquake.Shaken(self.request, 0, self.files)

    @cached_property
    def steps(self) -> Table:
        """Columns of steps.csv."""
        return read_table(self.files.folder / "steps.csv")

    def violations(self) -> list[str]:
        """The rules that the files violate, in words."""
        return list(self._violations())

    def _violations(self) -> Iterator[str]:
        files, request, steps = self.files, self.request, self.steps
        still = rows_where(steps, steps["earthquake"] == 0)
        if request.command == "quake":
            yield from earthquake.violations(self.shaken, steps)
            yield from water_in_motion.violations(files, request, steps)
        else:
            yield from tables.bookkeeping(files, request)
            if request.sections:  # else the balance of each body of the mesh, in elasticity
                yield from statics.balance(files, request)
            if (files.folder / "fields").is_dir():
                yield from self._elasticity()
        if request.sections:
            yield from tables.integrals(files, request, still)
        yield from tables.nodes(files, request, still)
        yield from water.violations(files, request, steps)
        yield from water_in_time.violations(files, request, steps)
        yield from replay.laws(steps, request.joints)

    def _elasticity(self) -> Iterator[str]:
        from . import elasticity  # scikit-fem is needed here only

        return elasticity.violations(self.files, self.request, self.steps)

    def stop(self) -> tuple[bool, str]:
        """Whether it is wrong that the run has stopped early, and a remark."""
        if self.request.command == "quake":
            return earthquake.judge(self.shaken)
        return stops.judge(self.files, self.request, self.steps)
