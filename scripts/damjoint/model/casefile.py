"""Case files: data in a small part of Gmsh's language, read here; nothing in them is ever executed.

A case is a list of statements, in any layout, with // and /* */ comments:

    Include "other.case";            the statements of another case file, beside this one
    title = "words";
    also_uplift = "none";            further uplift modes the case is published with
    geometry = "own.msh";            a mesh or .geo of one's own, beside this file
    default_<parameter> = value;     a text; arithmetic with + - * / ^ ( ), Pi, defaults set before
    levels() = {value, ...};         tail_levels() and times() likewise
"""

from __future__ import annotations

import difflib
import re
import unicodedata
from dataclasses import dataclass, field
from pathlib import Path

from .. import InputError
from .arithmetic import parsed, value_of
from .parameters import assignments, parameter

LISTS = ("levels", "tail_levels", "times")
TEXTS = ("title", "also_uplift", "geometry")
#: Bytes a case file may have, and files that a case may be made of.
LONGEST, MOST_FILES = 1_000_000, 50

TOKEN = re.compile(
    r"""(?P<nothing>\s+|//[^\n]*|/\*.*?\*/) |(?P<text>"[^"\\\n]*")
    |(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?) |(?P<name>[A-Za-z_]\w*)
    |(?P<mark>[-+*/^(){},;=]) |(?P<other>.)""",
    re.X | re.S,
)


@dataclass
class CaseText:
    """What a case file says: defaults by parameter, lists, texts."""

    defaults: dict[str, float | str] = field(default_factory=dict)
    lists: dict[str, list[float]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    #: how many files have been read
    files: int = field(default=0, compare=False)


def read(path: Path) -> CaseText:
    """The statements of a case file and of those it includes.

    Raises InputError, naming file, line and statement, for anything else than the statements above.
    """
    found = CaseText()
    read_into(found, path)
    return found


def written(said: CaseText) -> str:
    """The text of a case file that says the same: `read` gives it back."""
    lines = [f'{name} = "{words}";\n' for name, words in said.texts.items()]
    lists = [
        f"{name}() = {{{', '.join(map(repr, values))}}};\n" for name, values in said.lists.items()
    ]
    return "".join([*lines, assignments(said.defaults), *lists])


def read_into(found: CaseText, path: Path) -> None:
    """Add the statements of a case file."""
    if path.suffix != ".case":
        raise InputError(f'Include "{path.name}": must be a .case file')
    found.files += 1
    if found.files > MOST_FILES:
        raise InputError(f"case {path}: includes itself, or is one of more than {MOST_FILES} files")
    try:
        if path.exists() and not path.is_file():  # a pipe, a device: reading may not end
            raise InputError(f"case {path}: must be a file")
        if path.stat().st_size > LONGEST:
            raise InputError(f"case {path}: must be a text of at most {LONGEST} bytes")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"case {path}: {error}") from None
    statement, first = [], 0
    for match in TOKEN.finditer(text):
        kind, token = match.lastgroup, match[0]
        if kind == "nothing":
            continue
        first = first if statement else text.count("\n", 0, match.start()) + 1
        statement.append((kind, token))
        where = f"case {path}, line {first}"
        if kind == "text" and any(unicodedata.category(c) == "Cc" and c != "\t" for c in token):
            raise InputError(f"{where}: {token}: must have no control characters")
        if kind == "other":
            raise InputError(f"{where}: {said(statement)}: {token!r} is not part of a case")
        if token == ";":
            take(found, statement[:-1], path, where)
            statement = []
    if statement:
        raise InputError(f"{where}: {said(statement)}: does not end with a semicolon")


def said(statement: list[tuple[str, str]]) -> str:
    """A statement in one line, not longer than a line."""
    words = " ".join(token for _, token in statement)
    return words if len(words) < 60 else words[:57] + "..."


def take(found: CaseText, statement: list, path: Path, where: str) -> None:
    """Carry out one statement: enter what it sets into `found`."""
    kinds, tokens = zip(*statement, strict=True) if statement else ((), ())
    where = f"{where}: {said(statement)}"
    if tokens[:1] == ("Include",) and kinds[1:] == ("text",):
        read_into(found, path.parent / tokens[1][1:-1])
    elif kinds[:1] == ("name",) and tokens[1:4] == ("(", ")", "=") and tokens[0] in LISTS:
        found.lists[tokens[0]] = numbers(tokens[4:], found, where)
    elif kinds[:1] == ("name",) and tokens[1:2] == ("=",) and tokens[0] in TEXTS:
        if kinds[2:] != ("text",):
            raise InputError(f'{where}: must be {tokens[0]} = "words"')
        words = tokens[2][1:-1]
        if tokens[0] == "geometry":  # beside the file that names it
            words = str((path.parent / words).absolute())
        found.texts[tokens[0]] = words
    elif kinds[:1] == ("name",) and tokens[1:2] == ("=",) and tokens[0].startswith("default_"):
        name = tokens[0].removeprefix("default_")
        try:
            known = parameter(name)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        value = tokens[2][1:-1] if kinds[2:] == ("text",) else evaluate(tokens[2:], found, where)
        found.defaults[name] = known.check(value)
    else:
        words = [*(f"{n}()" for n in LISTS), *TEXTS, "Include", "default_<parameter>"]
        near = difflib.get_close_matches("".join(tokens[:3]).partition("=")[0], words, 1)
        raise InputError(
            f"{where}: not a statement of a case; allowed: "
            + (f"{near[0]} (did you mean that?), " if near else "")
            + 'Include "file.case", title, also_uplift, geometry, default_<parameter> = value, '
            + "levels() = {...}, tail_levels() = {...}, times() = {...}"
        )


def numbers(tokens: tuple[str, ...], found: CaseText, where: str) -> list[float]:
    """The values of a list { a, b, ...

    }.
    """
    if tokens[:1] != ("{",) or tokens[-1:] != ("}",):
        raise InputError(f"{where}: must be a list of numbers in braces, such as {{3, 6, 8, 9}}")
    if len(tokens) == 2:
        raise InputError(f"{where}: must have at least one number")
    items, part = [], []
    for token in (*tokens[1:-1], ","):
        if token == ",":
            items.append(evaluate(tuple(part), found, where))
            part = []
        else:
            part.append(token)
    return items


def evaluate(tokens: tuple[str, ...], found: CaseText, where: str) -> float:
    """The value of an arithmetic expression."""
    known = {f"default_{n}": v for n, v in found.defaults.items() if isinstance(v, float)}
    try:
        return value_of(parsed(" ".join(tokens)), known)
    except ValueError:
        raise InputError(
            f"{where}: must be a number, or arithmetic with + - * / ^ ( ), Pi and defaults set "
            "before"
        ) from None
