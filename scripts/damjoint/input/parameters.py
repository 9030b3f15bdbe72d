"""Parameters: names, defaults, labels and ranges, read from pro/parameters.pro by Gmsh's parser."""

from __future__ import annotations

import itertools
import json
import math
import re
import signal
import threading
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

from .. import InputError, __version__, data, meant
from ..arrays import Setting, Value
from ..laws import LAWS
from ..storage import atomic_write, cached
from .arithmetic import check_units, explained, quantity

DECLARATIONS = data("pro") / "parameters.pro"
#: The line by which a text includes the declarations.
INCLUDE = f'Include "{DECLARATIONS}";\n'

#: The value of a parameter that follows others.
AUTOMATIC = -1.0
#: Parameters of which each joint may have its own value, besides those of the group Joint.
OF_JOINTS = (
    *("law", "uplift", "joint_slope", "aperture_min"),
    *("drains", "drain_x", "drain_effectiveness", "drain_level"),
    *("drain_reference", "waterstop"),
    *("grout_pressure", "grout_t", "saw_thickness", "saw_t"),
)
#: Texts of a case that are no parameters, and options of commands that set them, too.
TEXTS = {
    **dict.fromkeys(("title", "also_uplift", "geometry", "hydrograph"), ""),
    "record": " or by --record FILE.csv",
}
#: Quantities that are no parameters, and what sets them.
OPTIONS = {
    **dict.fromkeys(("level", "levels"), "--levels, in a sweep also by --vary level=VALUES"),
    **dict.fromkeys(("tail_level", "tail_levels"), "--tail-levels"),
    "steps": "--steps",
}
#: Lists of a section's geometry, which are settings like parameters: empty by default.
GEOMETRY_LISTS = "lift_heights", "downstream_face"
#: Limit that means > 0 in the declarations.
TINY = 1e-30
#: Limit that means < 0.5 there.
BELOW_HALF = 0.5 - 1e-9
#: Limit of ONELAB that means none.
ANY = 1e200

#: Texts that a process caches: those of a run, but not of all rows of a sweep.
CACHED = 10
#: Texts of which it keeps the variables: those of one window, search or report.
KEPT = 50
COUNTER = itertools.count()
#: Long calls of Gmsh that an interrupt has left, see `interruptible`.
UNFINISHED = set[Future[Any]]()


def start_gmsh() -> ModuleType:
    """The module gmsh, started once per process, quietly and without reading the user's settings.

    It is imported here, as a command with cached data does not need it.
    """
    import gmsh

    wait(UNFINISHED)
    if not gmsh.isInitialized():
        numbers = signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE
        handlers = {n: signal.getsignal(n) for n in numbers}
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        if threading.current_thread() is threading.main_thread():
            for number, handler in handlers.items():  # Gmsh has reset them to the system's
                signal.signal(number, handler)
        raise_errors(gmsh)
    return gmsh


def raise_errors(gmsh: ModuleType) -> None:
    """Let Gmsh print nothing, and raise its errors."""
    gmsh.option.setNumber("General.Verbosity", 0)
    gmsh.option.setNumber("General.AbortOnError", 2)


def empty_gmsh() -> ModuleType:
    """Gmsh without a model and with its own options: those that an earlier geometry in this process
    has set would change the next mesh.
    """
    gmsh = start_gmsh()
    gmsh.clear()
    gmsh.option.restoreDefaults()
    raise_errors(gmsh)
    return gmsh


def interruptible(call: Callable[..., Any], *arguments: Any) -> None:
    """A long call of Gmsh in a thread of its own: Python handles a signal between two calls only.
    After an interrupt it goes on, and the next use of Gmsh waits for its end.
    """
    executor = ThreadPoolExecutor(1)
    future = executor.submit(call, *arguments)
    executor.shutdown(wait=False)
    UNFINISHED.add(future)
    future.add_done_callback(UNFINISHED.discard)
    future.result()


@dataclass(frozen=True)
class Parameter:
    """One declared parameter: ONELAB label with its unit, range or choices."""

    name: str
    #: path in the ONELAB tree, and its parts: group, description, unit (empty for a text)
    label: str
    group: str
    description: str
    unit: str
    help: str = ""
    text: bool = False
    minimum: float = -math.inf
    maximum: float = math.inf
    choices: tuple[Value, ...] = ()
    integer: bool = False
    #: whether it may be -1 and then follows others, as the help says
    automatic: bool = False
    #: default, and the scenes in which it matters (empty: all), as in the declaration
    default: str = ""
    matters: str = ""

    @property
    def real(self) -> bool:
        """Whether it is a real number: no text, choice or integer."""
        return not (self.text or self.choices or self.integer)

    @property
    def of_joints(self) -> bool:
        """Whether each joint may have its own value."""
        return self.group == "Joint" or self.name in OF_JOINTS

    @property
    def meaning(self) -> str:
        """Description and unit."""
        return f"{self.description} [{self.unit}]" if self.unit else self.description

    def matters_in(self, values: Mapping[str, Value]) -> bool:
        """Whether the parameter matters with the values of all parameters."""
        alternatives = [text.split(" and ") for text in self.matters.split(" or ")]
        return not self.matters or any(all(holds(c, values) for c in both) for both in alternatives)

    def allowed(self) -> str:
        """The allowed values, as text."""
        if self.choices:
            return "one of " + ", ".join(
                c if isinstance(c, str) else f"{c:g}" for c in self.choices
            )
        limits = []
        if self.minimum > -math.inf:
            limits.append("> 0" if self.minimum == TINY else f">= {self.minimum:g}")
        if self.maximum < math.inf:
            limits.append("< 0.5" if self.maximum == BELOW_HALF else f"<= {self.maximum:g}")
        words = ("an integer " if self.integer else "a number ") + " and ".join(limits)
        return words.strip() + (f", or {self.help}" if self.automatic else "")

    def check(self, value: Value) -> Value:
        """The value as a number or a choice.

        Raises InputError if it is not a number, out of range or not one of the choices.
        """
        shown = f"{value:.15g}" if isinstance(value, float) else value
        setting, rule = f"{self.name} = {shown}", f"must be {self.allowed()} ({self.meaning})"
        result: Value = value
        if not self.text:
            try:
                result = quantity(value, self.unit) if isinstance(value, str) else float(value)
            except (TypeError, ValueError) as error:
                raise InputError(explained(setting, rule, error)) from None
        if not self.allows(result):
            raise InputError(f"{setting}: {rule}")
        return result

    def allows(self, value: Value) -> bool:
        """Whether a value is one of the choices, or a number within the range."""
        if self.choices:
            return value in self.choices or (self.name == "law" and value in LAWS)
        if isinstance(value, str):
            return False
        if self.automatic and value == AUTOMATIC:
            return True
        within = math.isfinite(value) and self.minimum <= value <= self.maximum
        return within and not (self.integer and value % 1)


def parse(text: str) -> dict[str, list[Any]]:
    """Variables of Gmsh's parser after it has read a text written by this package: {name: numbers
    or texts}; the first CACHED texts of a process are cached, which spares the start of Gmsh, and
    the last KEPT ones are kept in memory.

    Raises InputError.
    """
    return {name: list(values) for name, values in parsed(text).items()}


@lru_cache(maxsize=KEPT)
def parsed(text: str) -> dict[str, list[Any]]:
    """See `parse`; must not be changed."""
    if next(COUNTER) >= CACHED:
        return parse_by_gmsh(text)
    return cached("variables", sources() + text, lambda: parse_by_gmsh(text))


#: A line that includes a file.
INCLUDED = r'(?m)^Include "(.*)";$'


def complete(text: str, folder: Path) -> str:
    """A text with the files that it includes, of absolute paths or relative to a folder, in place
    of the lines that include them: Gmsh does not close such files.
    """
    return re.sub(INCLUDED, lambda match: complete((folder / match[1]).read_text(), folder), text)


def parse_by_gmsh(text: str) -> dict[str, list[Any]]:
    """The same without the cache; the ONELAB database is that of the text afterwards."""
    import tempfile

    gmsh = start_gmsh()
    gmsh.parser.clear()
    gmsh.onelab.clear()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.geo"
        with atomic_write(path) as part:
            part.write_text(complete(text, DECLARATIONS.parent))
        try:
            gmsh.parser.parse(str(path))
        except Exception as error:  # what gmsh raises
            raise InputError(str(error)) from None
    variables = {}
    for name in gmsh.parser.getNames():
        numbers = gmsh.parser.getNumber(name)
        variables[name] = numbers.tolist() if len(numbers) else list(gmsh.parser.getString(name))
    return variables


#: A declaration of pro/parameters.pro: name, and everything up to its closing brace.
DECLARED = r"(\w+) = \{(?:Str\[)?default_\1\b((?:[^{}\"]|\"[^\"]*\"|\{[^{}]*\})*)\}"
#: The default of a declaration.
DEFAULT = r"\bdefault_(\w+) = ([^,\]]*?)\s*[,\]]"
#: A label: group and description without the digits that order the ONELAB tree, unit.
LABEL = r"^Parameters/\d*([^/]+)/\d*([^/]*?)(?: \[(.*)\])?$"


def constants() -> dict[str, list[Any]]:
    """Variables of the declarations without a case: defaults, regions, the solvers' constants."""
    variables: dict[str, list[Any]] = without_case()["variables"]
    return variables


@lru_cache(maxsize=1)
def sources() -> str:
    """Version and checksum of the declarations, of the files that they include, and of this file,
    which determines what the cache has of them.
    """
    texts = [DECLARATIONS.with_name(f"{n}.pro") for n in ("parameters", "section", "units")]
    texts.append(Path(__file__))
    return f"{__version__} {zlib.crc32(b''.join(text.read_bytes() for text in texts)):08x}\n"


@lru_cache(maxsize=1)
def declared() -> dict[str, Parameter]:
    """All declared parameters by name."""
    stored = without_case()["parameters"]
    parameters = (Parameter(**one | {"choices": tuple(one["choices"])}) for one in stored)
    return {parameter.name: parameter for parameter in parameters}


@lru_cache(maxsize=1)
def without_case() -> dict[str, Any]:
    """What Gmsh's parser makes of the declarations without a case: variables and parameters."""

    def parsed() -> dict[str, Any]:
        variables = parse_by_gmsh(INCLUDE)
        return {"variables": variables, "parameters": [asdict(p) for p in declarations()]}

    return dict(cached("declarations", sources(), parsed))


def declarations() -> list[Parameter]:
    """All declared parameters, after Gmsh has parsed the declarations without a case."""
    text = re.sub(r"//[^\n]*", "", DECLARATIONS.read_text())
    gmsh, result, defaults = start_gmsh(), [], dict[str, str]()
    for name, default in re.findall(DEFAULT, text):
        defaults.setdefault(name, default)
    for name, rest in re.findall(DECLARED, text):
        label = matched(r'Name\s+"([^"]+)"', rest)
        entry = json.loads(gmsh.onelab.get(label))
        result.append(declaration(name, rest, defaults[name], label, entry))
    return result


def declaration(name: str, rest: str, default: str, label: str, entry: dict[str, Any]) -> Parameter:
    """A parameter from the rest of its declaration, default, label and ONELAB entry."""
    group, description, unit = re.findall(LABEL, label)[0]
    # Min is -1 for a parameter that may be -1
    otherwise = entry.get("attributes", {}).get("Otherwise")
    low = {None: entry.get("min", -ANY), "> 0": TINY, ">= 0": 0.0}[otherwise]
    high = entry.get("max", ANY)
    return Parameter(
        name=name,
        label=label,
        group=group,
        description=description,
        unit=unit,
        help=entry.get("help", ""),
        text=entry["type"] == "string",
        minimum=low if low > -ANY else -math.inf,
        maximum=high if high < ANY else math.inf,
        choices=tuple(entry.get("choices", ())),
        integer=entry.get("step") == 1,
        automatic=otherwise is not None,
        default="-1" if default == "automatic" else default.strip('"'),
        matters=condition_text(matched(r"Visible\s+(.*?),\s*Name", rest)),
    )


def matched(pattern: str, text: str) -> str:
    """The first group of a pattern's first match; empty if there is none."""
    match = re.search(pattern, text)
    return match[1] if match else ""


@lru_cache(maxsize=1)
def independent() -> frozenset[str]:
    """Names of the numbers on which neither another parameter nor the section depends: those that
    occur only in their own declaration.
    """
    used = set(re.findall(r"\w+", computations()))
    return frozenset(n for n, p in declared().items() if n not in used and not p.text)


@lru_cache(maxsize=1)
def computations() -> str:
    """What the declarations and the section compute, without the declarations themselves."""
    others = ("section.pro", "automatic_of_joint.pro")
    texts = (DECLARATIONS, *(DECLARATIONS.with_name(name) for name in others))
    return "".join(re.sub(DECLARED, "", re.sub(r"//[^\n]*", "", t.read_text())) for t in texts)


#: A statement that computes a value: its name, and from what.
STATEMENT = r"(\w+)(?:\([^()=]*\))?\s*\+?=(?!=)([^;]*);"


@lru_cache(maxsize=200)
def followers(name: str) -> frozenset[str]:
    """Names of what is computed from a value, directly or through others."""
    reached, new = {name}, {name}
    while new:
        new = {to for to, of in statements() if of & new} - reached
        reached |= new
    return frozenset(reached - {name})


@lru_cache(maxsize=1)
def statements() -> list[tuple[str, set[str]]]:
    """What the statements of `computations` compute, and the words in their formulas."""
    matches = re.findall(STATEMENT, computations())
    return [(name, set(re.findall(r"\w+", formula))) for name, formula in matches]


def condition_text(condition: str) -> str:
    """The condition of a Visible option, as text."""
    words = re.sub(r'!StrCmp\((\w+), "(\w+)"\)', r"\1 = \2", condition)
    words = re.sub(r'StrCmp\((\w+), "(\w+)"\)', r"\1 not \2", words)
    for mark, word in (("==", "="), ("!= 0", "not 0"), ("||", "or"), ("&&", "and")):
        words = words.replace(mark, word)
    return words.strip("()")


def holds(condition: str, values: Mapping[str, Value]) -> bool:
    """Whether one part of a condition, as `condition_text` writes it, holds: "law not rupture"."""
    name, relation, other = (*condition.split(), "not", "0")[:3]
    value = values[name]
    if isinstance(value, float):
        return value > 0 if relation == ">" else (value == float(other)) == (relation == "=")
    return (value == other) == (relation == "=")


def parameter(name: str) -> Parameter:
    """The declared parameter of this name.

    Raises InputError, with the nearest names, if there is none.
    """
    known = declared()
    if name in TEXTS:
        raise InputError(f'{name}: must be set in the case ({name} = "...";){TEXTS[name]}')
    if name in OPTIONS:
        raise InputError(f"{name}: is no parameter; it is set by {OPTIONS[name]}")
    if name not in known:
        hint = meant(name, known) or f"allowed: {', '.join(sorted(known))}"
        raise InputError(f"{name}: unknown parameter; {hint}")
    return known[name]


def of_any_joint(name: str) -> Parameter:
    """The declared parameter of a name NAME or, for one joint, JOINT.NAME. Raises InputError."""
    return parameter(name.rpartition(".")[2])


def settings(pairs: Iterable[str]) -> dict[str, Setting]:
    """{name: checked value} from texts 'name=value', 'name=value,value' with a value for each
    joint, or 'joint.name=value' for one of them.

    Raises InputError.
    """
    values: dict[str, Setting] = {}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not equals:
            raise InputError(f"--set {pair}: must be NAME=VALUE")
        listed = value.split(",")
        check_units(f"--set {pair}", listed)
        values[name] = checked(name, listed if "," in value else value)
    return values


def checked(name: str, value: Any) -> Setting:
    """The value of a parameter, or the values of each joint, checked. Raises InputError."""
    if name in GEOMETRY_LISTS:
        return levels_of(name, value) if value else ()
    if "." in name:
        return of_one_joint(name, value)[2]
    known = parameter(name)
    if getattr(value, "ndim", None) == 0:  # a number of numpy
        value = value.item()
    if isinstance(value, (str, float, int)):
        return known.check(value)
    if not isinstance(value, Iterable):
        raise InputError(f"{name} = {value}: must be a number or a text")
    if not known.of_joints:
        listed = ",".join(map(str, value))
        raise InputError(
            f"{name} = {listed}: must be a single value; only parameters of a joint "
            "can have one for each joint"
        )
    return tuple(known.check(v) for v in value)


def of_one_joint(name: str, value: Any) -> tuple[str, str, Value]:
    """Joint, parameter and checked value of a setting 'joint.parameter' of one joint.

    Raises InputError.
    """
    joint, _, of_joint = name.rpartition(".")
    known = parameter(of_joint)
    if not known.of_joints:
        raise InputError(f"{name}: {of_joint} is of the whole dam: must be set without a joint")
    if isinstance(value, (list, tuple)):
        raise InputError(f"{name} = {','.join(map(str, value))}: must be a single value")
    return joint, of_joint, known.check(value)


def levels_of(name: str, levels: Any) -> tuple[float, ...]:
    """Heights [m], for example water levels, from numbers or a text 'a,b,c'.

    Raises InputError if there is none, or one is not finite.
    """
    values = levels.split(",") if isinstance(levels, str) else levels
    listed = levels if isinstance(levels, str) else ",".join(map(str, levels))
    kind = "x,y of each corner in metres" if name == "downstream_face" else "levels in metres"
    setting, rule = f"{name} = {listed}", f"must be a list of {kind}, such as 3,6,8,9"
    unit = unit_in_list(name)
    try:
        result = tuple(quantity(v, unit) if isinstance(v, str) else float(v) for v in values)
    except (TypeError, ValueError) as error:
        raise InputError(explained(setting, rule, error)) from None
    if not result or not all(map(math.isfinite, result)):
        raise InputError(f"{setting}: {rule}")
    return result


def unit_in_list(name: str) -> str:
    """The unit of the numbers in a list of a case."""
    return "-" if name == "times" else "m"


def assignments(values: Mapping[str, Value]) -> str:
    """Lines default_name = value; in the common language of Gmsh and GetDP."""
    return "".join(f"default_{name} = {quoted(value)};\n" for name, value in values.items())


def quoted(value: Value) -> str:
    """A value in that language."""
    return f'"{value}"' if isinstance(value, str) else repr(value)


def listing(name: str, values: Iterable[float]) -> str:
    """A list in that language."""
    return f"{name}() = {{{in_rows([repr(float(v)) for v in values])}}};\n"


def in_rows(texts: Sequence[str], number: int = 8, separator: str = ",") -> str:
    """Texts of that language, some a line: GetDP fails on lines of some thousand characters."""
    rows = (texts[i : i + number] for i in range(0, len(texts), number))
    return f"{separator}\n".join(f"{separator} ".join(row) for row in rows)
