"""Parameters: names, defaults, labels and ranges are read from pro/parameters.pro by Gmsh's
parser.
"""

from __future__ import annotations

import difflib
import json
import math
import re
import signal
import tempfile
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import gmsh

from .. import InputError, data

DECLARATIONS = data("pro") / "parameters.pro"
#: The line by which a text includes the declarations.
INCLUDE = f'Include "{DECLARATIONS}";\n'

#: The value of a parameter that follows others.
AUTOMATIC = -1.0


def start_gmsh() -> None:
    """Start Gmsh once per process, quietly and without reading the user's settings."""
    if not gmsh.isInitialized():
        handlers = {n: signal.getsignal(n) for n in (signal.SIGTERM, signal.SIGHUP)}
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        if threading.current_thread() is threading.main_thread():
            for number, handler in handlers.items():  # Gmsh has put back the system's
                signal.signal(number, handler)
        gmsh.option.setNumber("General.Verbosity", 0)  # what goes wrong is raised, told in one line


def number(text: str) -> float:
    """A number as Gmsh reads it: Python alone knows 1_000, or the digits of other scripts.

    Raises ValueError.
    """
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


@dataclass(frozen=True)
class Parameter:
    """One declared parameter: ONELAB label with its unit, range or choices."""

    name: str
    label: str
    help: str = ""
    text: bool = False
    minimum: float = -math.inf
    maximum: float = math.inf
    choices: tuple = ()
    integer: bool = False
    #: what it follows when it is -1, in words; empty: it can not
    follows: str = ""
    #: default, and the scene it matters in (empty: any), as the declaration has them
    default: str = ""
    matters: str = ""

    @property
    def group(self) -> str:
        """Its group in the ONELAB tree."""
        return self.label.split("/")[-2].lstrip("0123456789")

    @property
    def meaning(self) -> str:
        """The label without its place in the ONELAB tree: description and unit."""
        return self.label.split("/")[-1].lstrip("0123456789")

    def allowed(self) -> str:
        """What is allowed, in words."""
        if self.choices:
            return "one of " + ", ".join(c if self.text else f"{c:g}" for c in self.choices)
        limits = []
        if self.minimum > -math.inf:
            limits.append("> 0" if self.minimum == 1e-30 else f">= {self.minimum:g}")
        if self.maximum < math.inf:
            limits.append("< 0.5" if self.maximum == 0.5 - 1e-9 else f"<= {self.maximum:g}")
        words = ("an integer " if self.integer else "a number ") + " and ".join(limits)
        return words.strip() + (f", or -1: {self.follows}" if self.follows else "")

    def check(self, value: float | str) -> float | str:
        """The value as a number or a choice.

        Raises InputError if it is not a number, out of range or not one of the choices.
        """
        bad = InputError(f"{self.name} = {value}: must be {self.allowed()} ({self.meaning})")
        if self.text:
            if value not in self.choices:
                raise bad
            return value
        try:
            found = number(str(value))
        except ValueError:
            raise bad from None
        if self.follows and found == AUTOMATIC:
            return found
        if not (math.isfinite(found) and self.minimum <= found <= self.maximum):
            raise bad
        if (self.choices and found not in self.choices) or (self.integer and found % 1):
            raise bad
        return found


def parse(text: str) -> dict[str, list[float] | list[str]]:
    """What Gmsh's parser knows after reading a text of our own: {name: values}.

    Raises InputError.
    """
    start_gmsh()
    gmsh.parser.clear()
    gmsh.onelab.clear()
    with tempfile.NamedTemporaryFile("w", suffix=".geo") as file:
        file.write(text)
        file.flush()
        try:
            gmsh.parser.parse(file.name)
        except Exception as error:  # what gmsh raises
            raise InputError(str(error)) from None
    found = {}
    for name in gmsh.parser.getNames():
        numbers = gmsh.parser.getNumber(name)
        found[name] = numbers.tolist() if len(numbers) else list(gmsh.parser.getString(name))
    return found


#: A declaration of pro/parameters.pro: name, and everything up to its closing brace.
DECLARED = re.compile(r"(\w+) = \{(?:Str\[)?default_\1\b((?:[^{}\"]|\"[^\"]*\"|\{[^{}]*\})*)\}")


@lru_cache(maxsize=1)
def constants() -> dict[str, list]:
    """All values of the declarations by themselves: defaults, regions, what the solvers share."""
    return parse(INCLUDE)


@lru_cache(maxsize=1)
def declared() -> dict[str, Parameter]:
    """All declared parameters by name."""
    parse(INCLUDE)
    text = re.sub(r"//[^\n]*", "", DECLARATIONS.read_text())
    parameters = {}
    for name, rest in DECLARED.findall(text):
        label = re.search(r'Name\s+"([^"]+)"', rest)[1]
        entry = json.loads(gmsh.onelab.get(label))
        low, high = entry.get("min", -1e200), entry.get("max", 1e200)
        minimum = low if low > -1e200 else -math.inf
        follower = re.match(r"-1: (.*); else (>=?) 0$", entry.get("help", ""))
        if follower:
            minimum = 0.0 if follower[2] == ">=" else 1e-30
        default = re.search(rf"default_{name} = ([^,\]]*?)\s*[,\]]", text)[1]
        visible = re.search(r"Visible\s+(.*?),\s*Name", rest)
        parameters[name] = Parameter(
            name,
            label,
            entry.get("help", ""),
            text=entry["type"] == "string",
            minimum=minimum,
            maximum=high if high < 1e200 else math.inf,
            choices=tuple(entry.get("choices", ())),
            integer=entry.get("step") == 1,
            follows=follower[1] if follower else "",
            default="-1" if default == "automatic" else default.strip('"'),
            matters=in_words(visible[1]) if visible else "",
        )
    return parameters


@lru_cache(maxsize=1)
def independent() -> frozenset[str]:
    """Names of the numbers that nothing follows, neither another parameter nor the section: they
    stand nowhere in the declarations but in their own.
    """
    texts = (DECLARATIONS, DECLARATIONS.with_name("section.pro"))
    rest = "".join(DECLARED.sub("", re.sub(r"//[^\n]*", "", t.read_text())) for t in texts)
    used = set(re.findall(r"\w+", rest))
    return frozenset(n for n, p in declared().items() if n not in used and not p.text)


def in_words(condition: str) -> str:
    """A Visible clause of the declarations in words."""
    words = re.sub(r'!StrCmp\((\w+), "(\w+)"\)', r"\1 = \2", condition)
    words = re.sub(r'StrCmp\((\w+), "(\w+)"\)', r"\1 not \2", words)
    for mark, word in (("==", "="), ("!= 0", "not 0"), ("||", "or")):
        words = words.replace(mark, word)
    return words.strip("()")


def parameter(name: str) -> Parameter:
    """The declared parameter of this name.

    Raises InputError, with the nearest names, if there is none.
    """
    known = declared()
    if name not in known:
        near = difflib.get_close_matches(name, known, 3) or sorted(known)
        raise InputError(f"{name}: unknown parameter; allowed: {', '.join(near)}")
    return known[name]


def settings(pairs: Iterable[str]) -> dict[str, float | str]:
    """{name: checked value} from texts 'name=value'.

    Raises InputError.
    """
    values = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals:
            raise InputError(f"--set {pair}: must be NAME=VALUE")
        values[name.strip()] = parameter(name.strip()).check(value.strip())
    return values


def assignments(values: dict[str, float | str]) -> str:
    """Lines default_name = value; in the common language of Gmsh and GetDP."""
    lines = (
        f'default_{n} = "{v}";\n' if isinstance(v, str) else f"default_{n} = {v!r};\n"
        for n, v in values.items()
    )
    return "".join(lines)


def listing(name: str, values: Iterable[float]) -> str:
    """A list in that language, a number a line: GetDP's parser loses its way in lines of some
    thousand characters.
    """
    return f"{name}() = {{\n" + ",\n".join(repr(float(v)) for v in values) + "};\n"
