"""Case files: data in a small part of Gmsh's language, parsed without ever being executed.

A case is a list of statements, in any layout, with // and /* */ comments:

    Include "other.case";            the statements of another case file, beside this one, or of the
                                     package: "presets/usace_usual.case"
    title = "words";
    also_uplift = "none";            further uplift modes the case is published with
    geometry = "own.msh";            your own mesh or .geo, beside this file
    record = "quake.csv";            accelerations of the ground, beside this file
    hydrograph = "flood.csv";        water levels against time, beside this file
    default_<parameter> = value;     a text; arithmetic with + - * / ^ ( ), Pi, the units of
                                     pro/units.pro and defaults set before
    levels() = {value, ...};         tail_levels(), times(), lift_heights() and, with x, y of each
                                     corner, downstream_face() likewise
    Struct Joint::<joint> [ <parameter> value, ... ];
                                     values of the joint of this name, in which _ stands for all but
                                     letters and digits: Joint::lift_25_m
    <parameter>() = {value, ...};    of a joint: a value for each joint, the lowest first; in this
                                     version only
"""

from __future__ import annotations

import contextlib
import re
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

from .. import InputError, data
from ..arrays import Value
from ..storage import read_limited_text
from .arithmetic import arithmetic_value, explained
from .parameters import (
    GEOMETRY_LISTS,
    TEXTS,
    Parameter,
    assignments,
    checked,
    declared,
    parameter,
    unit_in_list,
)

LISTS = ("levels", "tail_levels", "times", *GEOMETRY_LISTS)
#: Most bytes of a case file.
LONGEST = 1_000_000
#: Most files that a case includes: more are an endless inclusion.
MOST_FILES = 50

TOKEN = re.compile(
    r"""(?P<nothing>\s+|//[^\n]*|/\*.*?\*/) |(?P<text>"[^"\\\n]*")
    |(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?) |(?P<name>[A-Za-z_]\w*)
    |(?P<mark>::|[-+*/^(){},;=[\]]) |(?P<other>.)""",
    re.X | re.S,
)

#: A number that needs no arithmetic.
PLAIN = re.compile(r"(0|[1-9]\d{,9})(\.\d{,9})?([eE][+-]?\d\d?)?")

#: A token: its kind (a group of TOKEN) and its text.
Token: TypeAlias = tuple[str, str]
#: Kinds and texts of the tokens of a value.
Item: TypeAlias = tuple[tuple[str, ...], tuple[str, ...]]


@dataclass
class CaseText:
    """The statements of a case file: defaults by parameter, lists, texts."""

    defaults: dict[str, Value] = field(default_factory=dict)
    lists: dict[str, list[float]] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    #: values of each joint, by parameter
    of_joints: dict[str, tuple[Value, ...]] = field(default_factory=dict)
    #: values by the key of a joint and the parameter; and the files that set them last
    blocks: dict[str, dict[str, Value]] = field(default_factory=dict)
    block_files: dict[str, Path] = field(default_factory=dict, compare=False)
    #: parameters and lists that a file of the user sets last, not one of the package
    of_user: set[str] = field(default_factory=set, compare=False)
    #: number of files read
    files: int = field(default=0, compare=False)

    @property
    def in_blocks(self) -> list[str]:
        """The parameters that blocks of joints set."""
        return list(dict.fromkeys(name for values in self.blocks.values() for name in values))

    def of_block(self, name: str) -> Iterator[Value]:
        """The values of a parameter in the blocks of joints that set it."""
        return (values[name] for values in self.blocks.values() if name in values)


def read(path: Path) -> CaseText:
    """Read a case file and the files that it includes.

    Raises InputError, with file, line and statement, for anything but the statements above.
    """
    case = CaseText()
    read_into(case, path)
    return case


def written(case: CaseText) -> str:
    """The text of a case file from which `read` gives the same statements."""
    lines = [f'{name} = "{words}";\n' for name, words in case.texts.items()]
    lists = [
        f"{name}() = {{{', '.join(map(literal, values))}}};\n"
        for name, values in (case.lists | case.of_joints).items()
    ]
    blocks = [block(joint, values) for joint, values in case.blocks.items() if values]
    return "".join([*lines, assignments(case.defaults), *lists, *blocks])


def block_name(joint: str) -> str:
    """The name of a joint in a case file: Joint::lift_12_5_m for "lift 12.5 m"."""
    return re.sub(r"\W", "_", joint)


def block(key: str, values: Mapping[str, Value]) -> str:
    """The statement of a joint's own values."""
    entries = ", ".join(f"{name} {literal(value)}" for name, value in values.items())
    return f"Struct Joint::{key} [ {entries} ];\n"


def blocks_of(lists: Mapping[str, Sequence[Value]], joints: Sequence[str]) -> str:
    """The statements that say the same as lists with a value for each joint."""
    return "".join(
        block(block_name(joint), {name: values[k] for name, values in lists.items()})
        for k, joint in enumerate(joints)
    )


def literal(value: Value) -> str:
    """A value as it is written in a case file."""
    return f'"{value}"' if isinstance(value, str) else repr(value)


def read_into(case: CaseText, path: Path) -> None:
    """Add the statements of a case file to those of a case."""
    if path.suffix != ".case":
        raise InputError(f'Include "{path.name}": must be a .case file')
    case.files += 1
    if case.files > MOST_FILES:
        raise InputError(f"case {path}: includes itself, or is one of more than {MOST_FILES} files")
    statement: list[Token] = []
    text, first = read_limited_text(path, f"case {path}", LONGEST), 0
    for match in TOKEN.finditer(text):
        kind, token = match.lastgroup or "", match[0]
        if kind == "nothing":
            continue
        first = first if statement else text.count("\n", 0, match.start()) + 1
        statement.append((kind, token))
        where = f"case {path}, line {first}"
        if kind == "text" and any(unicodedata.category(c) == "Cc" and c != "\t" for c in token):
            raise InputError(f"{where}: {token}: must have no control characters")
        if kind == "other":
            raise InputError(f"{where}: {excerpt(statement)}: {token!r} is not part of a case")
        if token == ";":
            add_statement(case, statement[:-1], path, where)
            statement = []
    if statement:
        raise InputError(f"{where}: {excerpt(statement)}: does not end with a semicolon")


def included(name: str, path: Path) -> Path:
    """The file that a case file includes: beside it, else that of the package."""
    beside, packaged = path.parent / name, data("cases") / name
    return packaged if packaged.is_file() and not beside.exists() else beside


def excerpt(statement: list[Token]) -> str:
    """A statement in one line of less than 60 characters."""
    words = " ".join(token for _, token in statement)
    return words if len(words) < 60 else words[:57] + "..."


def add_statement(case: CaseText, statement: list[Token], path: Path, where: str) -> None:
    """Add one statement of a file to those of a case."""
    kinds, tokens = (tuple(part[i] for part in statement) for i in (0, 1))
    where = f"{where}: {excerpt(statement)}"
    name = tokens[0] if kinds[:1] == ("name",) else ""
    if tokens.count("=") > 1:
        raise InputError(f"{where}: has two =; is there a semicolon between the statements?")
    if name == "Include" and kinds[1:] == ("text",):
        file = included(tokens[1][1:-1], path)
        if not file.exists():
            raise InputError(f"{where}: there is no such file beside {path.name}, and no preset")
        read_into(case, file)
    elif name in GEOMETRY_LISTS and tokens[1:] == ("(", ")", "=", "{", "}"):
        case.lists.pop(name, None)
        if name == "lift_heights":
            keep_first_block(case)
    elif name in LISTS and tokens[1:4] == ("(", ")", "="):
        items, unit = items_of(kinds[4:], tokens[4:], where), unit_in_list(name)
        case.lists[name] = [evaluate(item, unit, case, where) for _, item in items]
        note_owner(case, name, path)
    elif tokens[:3] == ("Struct", "Joint", "::"):
        add_block(case, kinds, tokens, path, where)
    elif name in TEXTS and tokens[1:2] == ("=",):
        if kinds[2:] != ("text",):
            raise InputError(f'{where}: must be {name} = "words"')
        words = tokens[2][1:-1]
        if name in ("geometry", "record", "hydrograph"):  # a path beside this file
            files = record_files(words, path.parent) if name == "record" else (path.parent / words,)
            words = "+".join(str(file.absolute()) for file in files)
        case.texts[name] = words
    elif name.startswith("default_") and tokens[1:2] == ("=",):
        name = name.removeprefix("default_")
        with located(where):
            known = parameter(name)
        case.of_joints.pop(name, None)
        replace_in_blocks(case, name, path, where)
        value = value_in((kinds[2:], tokens[2:]), known, case, where)
        with located(where):
            case.defaults[name] = known.check(value)
        note_owner(case, name, path)
    elif tokens[1:4] == ("(", ")", "=") and name in declared():
        items = items_of(kinds[4:], tokens[4:], where)
        values = tuple(value_in(item, parameter(name), case, where) for item in items)
        with located(where):
            checked(name, values)
        case.defaults.pop(name, None)
        replace_in_blocks(case, name, path, where)
        case.of_joints[name] = values
        note_owner(case, name, path)
    else:
        raise InputError(f"{where}: not a statement of a case; allowed: {allowed_like(tokens)}")


def record_files(text: str, folder: Path = Path()) -> tuple[Path, ...]:
    """The file of a record, or those of its components "H+V"; folder: of relative paths."""
    whole = folder / text
    first, plus, second = text.partition("+")
    return (folder / first, folder / second) if plus and not whole.exists() else (whole,)


def allowed_like(tokens: tuple[str, ...]) -> str:
    """The statements of a case, first the one that is probably meant by another one."""
    import difflib

    allowed = [*(f"{n}()" for n in LISTS), *TEXTS, "Include", "default_<parameter>"]
    near = difflib.get_close_matches("".join(tokens[:3]).partition("=")[0], allowed, 1)
    near = [f"default_{tokens[0]}"] if tokens[:1] and tokens[0] in declared() else near
    return (
        (f"{near[0]} (did you mean that?), " if near else "")
        + 'Include "file.case", title, also_uplift, geometry, record, hydrograph, '
        + "default_<parameter> = value, "
        + ", ".join(f"{n}() = {{...}}" for n in LISTS)
        + ", Struct Joint::<joint> [ <parameter> value, ... ]"
    )


def add_block(
    case: CaseText, kinds: tuple[str, ...], tokens: tuple[str, ...], path: Path, where: str
) -> None:
    """Add the values of one joint: Struct Joint::NAME [ parameter value, ... ]; with (Append) after
    the name only those that it does not have yet.
    """
    append = tokens[4:7] == ("(", "Append", ")")
    if append:
        kinds, tokens = (*kinds[:4], *kinds[7:]), (*tokens[:4], *tokens[7:])
    if kinds[3:4] != ("name",) or tokens[4:5] != ("[",) or tokens[-1:] != ("]",):
        raise InputError(
            f"{where}: must be Struct Joint::NAME [ parameter value, ... ], such as Struct "
            "Joint::lift_25_m [ mu 0.7, adhesion 0.1*MPa ]"
        )
    key, values = tokens[3], dict[str, Value]()
    if case.block_files.get(f"{key}::") == path:
        raise InputError(f"{where}: Joint::{key} is set twice in {path.name}")
    for item_kinds, item in items_of(
        ("mark", *kinds[5:-1], "mark"), ("{", *tokens[5:-1], "}"), where
    ):
        name = item[0] if item else ""
        with located(where):
            known = parameter(name)
            if not known.of_joints:
                raise InputError(f"{name}: is of the whole dam: must be set by default_{name}")
        if name in values:
            raise InputError(f"{where}: {name} is set twice")
        if name in case.of_joints:
            raise InputError(f"{where}: {name}() is a list: must be in blocks for all joints")
        value = value_in((item_kinds[1:], item[1:]), known, case, where)
        with located(where):
            values[name] = known.check(value)
        case.block_files[name] = path
        note_owner(case, name, path)
    case.block_files[f"{key}::"] = path
    before = case.blocks.get(key, {})
    case.blocks[key] = values | before if append else before | values


def replace_in_blocks(case: CaseText, name: str, path: Path, where: str) -> None:
    """Let a value for all joints, or a list, replace those that the blocks of included files set.

    Raises InputError if a block of the same file sets one.
    """
    if case.block_files.get(name) == path:
        raise InputError(f"{where}: must stand before the blocks of joints that set {name}")
    for values in case.blocks.values():
        values.pop(name, None)


def keep_first_block(case: CaseText) -> None:
    """Remove the blocks of all joints but the first: there are no others any more."""
    first = block_name(joint_name(float(case.defaults.get("joint_height", 0.0))))
    case.blocks = {key: values for key, values in case.blocks.items() if key == first}


def joint_name(height: float) -> str:
    """The name of a joint whose heel is at a height [m]."""
    return f"lift {height:g} m" if height else "base"


def note_owner(case: CaseText, name: str, path: Path) -> None:
    """Note whether a parameter or list is set by a file of the user or by one of the package."""
    if is_packaged(path.absolute()):
        case.of_user.discard(name)
    else:
        case.of_user.add(name)


@lru_cache
def is_packaged(path: Path) -> bool:
    """Whether a file, by its absolute path, is one of the package."""
    return data("cases").resolve() in path.resolve().parents


@contextlib.contextmanager
def located(where: str) -> Iterator[None]:
    """Add file and line of a statement to the message of an InputError."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def items_of(kinds: tuple[str, ...], tokens: tuple[str, ...], where: str) -> list[Item]:
    """The items of a list between commas, in braces."""
    if tokens[:1] != ("{",) or tokens[-1:] != ("}",):
        raise InputError(f"{where}: must be a list of numbers in braces, such as {{3, 6, 8, 9}}")
    if len(tokens) == 2:
        raise InputError(f"{where}: must have at least one number")
    commas = [i for i, token in enumerate(tokens) if token == ","]
    starts, ends = [1, *(i + 1 for i in commas)], [*commas, len(tokens) - 1]
    return [(kinds[a:b], tokens[a:b]) for a, b in zip(starts, ends, strict=True)]


def value_in(item: Item, known: Parameter, case: CaseText, where: str) -> Value:
    """A text or the value of an arithmetic expression, for a parameter."""
    kinds, tokens = item
    if known.text and kinds != ("text",):
        raise InputError(f"{where}: must be a text in quotes, {known.allowed()}")
    return tokens[0][1:-1] if kinds == ("text",) else evaluate(tokens, known.unit, case, where)


def evaluate(tokens: tuple[str, ...], unit: str, case: CaseText, where: str) -> float:
    """The value of an arithmetic expression in the unit of a label."""
    if len(tokens) == 1 and PLAIN.fullmatch(tokens[0]):
        return float(tokens[0])
    known = {f"default_{n}": v for n, v in case.defaults.items() if isinstance(v, float)}
    try:
        return arithmetic_value(" ".join(tokens), unit, known)
    except ValueError as error:
        rule = (
            "must be a number, or arithmetic with + - * / ^ ( ), Pi, units and defaults set before"
        )
        rule += "; a decimal number has a point, not a comma" if "," in tokens else ""
        raise InputError(explained(where, rule, error)) from None
