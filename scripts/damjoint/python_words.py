"""Messages of the Python interface: arguments in place of the options of commands."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import wraps
from typing import ParamSpec, TypeVar

from . import RUN_GEO, InputError, RunError

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

#: Options of commands in messages, and what stands for them, in this order: the one without an
#: argument; those before NAME=...; those with a value; all others.
WORDS = (
    (r"add --run-geo\b", f'set os.environ["{RUN_GEO}"] = "1"'),
    (r"--(?:set|vary|sample|tie) (?=\w+ ?=)", ""),
    (r"--(accuracy|engine|of|record) ([\w.%]+)", r'\1="\2"'),
    (r"--(jobs) (\d+)", r"\1=\2"),
    (r"--tail-levels\b", "tail_levels"),
    (r"--(?=[a-z])", ""),
)


def in_python(message: str) -> str:
    """A message in which options of commands are arguments of functions."""
    for option, argument in WORDS:
        message = re.sub(option, argument, message)
    return message


def all_in_python(messages: Iterable[str]) -> list[str]:
    """The same of several messages."""
    return [in_python(message) for message in messages]


def speaks_python(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Let the errors of a function of the Python interface have messages in its words."""

    @wraps(function)
    def wrapped(*arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
        try:
            return function(*arguments, **named)
        except (InputError, RunError) as error:
            error.args = (in_python(str(error)), *error.args[1:])
            raise

    return wrapped
