"""Output of damjoint in a process of its own."""

import re

#: A line of progress: title, part that is done, time.
PROGRESS = re.compile(r"^.+, \d[\d:]+(, nothing new for .*)?\n", re.MULTILINE)


def without_progress(err):
    """Standard error without the lines of progress that a slow machine has time to print."""
    return PROGRESS.sub("", err)
