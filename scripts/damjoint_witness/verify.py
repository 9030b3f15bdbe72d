"""All checks of a run's files."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

from . import earthquake, replay, statics, stops, tables, water, water_in_motion, water_in_time
from .files import Files, Table, read_table, rows_where
from .reader import Asked, read


class Witness:
    """The files of a run or of an earthquake beside what its command has asked for."""

    def __init__(self, files: Files) -> None:
        self.files = files

    @cached_property
    def asked(self) -> Asked:
        """What the command has asked for."""
        return read(self.files.words)

    @property
    def shaken(self) -> earthquake.Shaken:
        """The files of an earthquake."""
        return earthquake.Shaken(self.files, self.asked)

    @cached_property
    def steps(self) -> Table:
        """Columns of steps.csv."""
        return read_table(self.files.folder / "steps.csv")

    def violations(self) -> list[str]:
        """The rules that the files violate, in words."""
        return list(self._violations())

    def _violations(self) -> Iterator[str]:
        files, asked, steps = self.files, self.asked, self.steps
        still = rows_where(steps, steps["earthquake"] == 0)
        if asked.command == "quake":
            yield from earthquake.violations(self.shaken, steps)
            yield from water_in_motion.violations(files, asked, steps)
        else:
            yield from tables.bookkeeping(files, asked)
            if asked.sections:  # else the balance of each body of the mesh, in elasticity
                yield from statics.balance(files, asked)
            if (files.folder / "fields").is_dir():
                yield from self._elasticity()
        if asked.sections:
            yield from tables.integrals(files, asked, still)
        yield from tables.nodes(files, asked, still)
        yield from water.violations(files, asked, steps)
        yield from water_in_time.violations(files, asked, steps)
        yield from replay.laws(steps, asked.joints)

    def _elasticity(self) -> Iterator[str]:
        from . import elasticity  # scikit-fem is needed here only

        return elasticity.violations(self.files, self.asked, self.steps)

    def stop(self) -> tuple[bool, str]:
        """Whether it is wrong that the run has stopped early, and a remark."""
        if self.asked.command == "quake":
            return earthquake.judge(self.shaken)
        return stops.judge(self.files, self.asked, self.steps)
