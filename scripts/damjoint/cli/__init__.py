"""The command line: a module for each command, with its options and the function that runs it."""

from __future__ import annotations

import argparse
import io
import os
import signal
import sys
from importlib import import_module
from types import ModuleType

from .. import RUN_GEO, InputError, RunError, __version__, meant
from ..storage import SAVED
from .options import Parser, say

#: The commands: names of modules. Each has SUMMARY, `add`, which adds its options, and `call`,
#: which runs it and returns the exit code.
COMMANDS = (
    *("run", "check", "critical", "quake", "modes", "sweep", "reliability", "calibrate"),
    *("plot", "report", "tables", "gui", "new", "validate"),
)
DEVELOPERS = ("stress", "bench", "law")

EXIT_CODES = """exit codes:
  0    done, and the dam stands
  1    the dam fails, a requirement is not met or not judged, or the computation has failed
  2    bad input; nothing was computed or removed
  3    critical: the value is not confirmed; calibrate: a parameter is not determined
  130  interrupted; what is finished is saved"""


def parser(word: str = "") -> Parser:
    """Return the parser of the command that the first word names, or of all commands."""
    chosen = [name for name in (*COMMANDS, *DEVELOPERS) if name == word] or [*COMMANDS, *DEVELOPERS]
    modules = {name: import_module(f".{name}", __name__) for name in chosen}
    of_developers = (f"  {n:<11}  {modules[n].SUMMARY}" for n in DEVELOPERS if n in modules)
    top = Parser(
        formatter_class=argparse.RawDescriptionHelpFormatter,
        prog="damjoint",
        description="Concrete gravity dams on a thin joint: opening, cracking, sliding and uplift.",
        epilog="\n".join(
            [
                *("for developers:", *of_developers, "", EXIT_CODES, ""),
                "damjoint COMMAND --help explains the options of a command.",
            ]
        ),
    )
    top.add_argument("--version", action="version", version=__version__)
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, module in modules.items():
        add_command(commands, name, module)
    return top


def add_command(
    commands: argparse._SubParsersAction[Parser], name: str, module: ModuleType
) -> None:
    """Add a command; one for developers is listed apart."""
    summary, listed = module.SUMMARY, name not in DEVELOPERS
    command = commands.add_parser(
        name,
        description=f"{summary[0].upper()}{summary[1:]}.",
        **({"help": summary} if listed else {}),
    )
    module.add(command)
    command.set_defaults(call=module.call)


def check_command(word: str = "") -> None:
    """Raise InputError if the first word of the command line is nearly a command."""
    known = (*COMMANDS, *DEVELOPERS)
    if word not in known and not word.startswith("-") and (hint := meant(word, known)):
        raise InputError(f"{word}: unknown command; {hint}")


def check_encoding(word: str) -> None:
    """Raise InputError if a word of the command line is not text in the encoding of the locale."""
    try:
        word.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{word!a}: must be text in the locale's encoding ({sys.getfilesystemencoding()}); "
            "LANG=C.UTF-8 has all letters"
        ) from None


def one_line(error: BaseException) -> str:
    """Return an error's message in one line; line ends and control characters are escaped."""
    escape = lambda c: c if c.isprintable() else c.encode("unicode_escape").decode()
    return "damjoint: " + "".join(map(escape, str(error)))


def interrupted() -> str:
    """Return the message of an interrupted command."""
    return "damjoint: interrupted" + ("; results finished so far are saved" if SAVED else "")


def with_negative_lists(words: list[str]) -> list[str]:
    """Return the words with `--levels -1,3` as `--levels=-1,3`, else an option for argparse."""
    words = list(words)
    for i in reversed(range(len(words) - 1)):
        if words[i] in ("--levels", "--tail-levels"):
            words[i : i + 2] = [f"{words[i]}={words[i + 1]}"]
    return words


def main(argv: list[str] | None = None) -> int:
    """Run a command: the exit code is one of EXIT_CODES."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # µ and mathematical signs in a plain locale
    words = sys.argv[1:] if argv is None else argv
    SAVED.clear()
    try:
        for word in words:
            check_encoding(word)
        check_command(*words[:1])
        arguments = parser(*words[:1]).parse_args(with_negative_lists(words))
        if getattr(arguments, "run_geo", False):
            os.environ[RUN_GEO] = "1"  # an environment variable, for the processes of a sweep
        return int(arguments.call(arguments))
    except InputError as error:
        message, code = one_line(error), 2
    except MemoryError as error:
        message, code = f"damjoint: out of memory; {error}".rstrip("; "), 1
    # OSError: full disk, no permission; ImportError: a library that has been removed
    except (RunError, OSError, ImportError) as error:
        message, code = one_line(error), 1
        if signal.getitimer(signal.ITIMER_REAL)[0]:  # an interrupt waits for an import, see
            message, code = interrupted(), 130  # __main__.py; its signal has ended other processes
    except KeyboardInterrupt:
        message, code = interrupted(), 130
    say(message, file=sys.stderr)
    return code
