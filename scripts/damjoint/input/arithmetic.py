"""Arithmetic in texts of the user, parsed as an expression without ever being executed."""

from __future__ import annotations

import ast
import contextlib
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

from .. import InputError, data, meant
from ..units import with_slash

BINARY: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
UNARY: dict[type[ast.unaryop], Callable[[float], float]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}

PI = {"Pi": math.pi}
#: Powers of length, mass, temperature and angle.
Powers = tuple[float, ...]
#: Those in the SI units. Seconds are not counted: they have no unit that can be written.
POWERS: dict[str, Powers] = {
    "m": (1, 0, 0, 0),
    "m2": (2, 0, 0, 0),
    "m3": (3, 0, 0, 0),
    "N": (1, 1, 0, 0),
    "Pa": (-1, 1, 0, 0),
    "kg": (0, 1, 0, 0),
    "K": (0, 0, 1, 0),
    "degrees": (0, 0, 0, 1),
}
#: Numbers and powers in Python only: 1_000, 0x10, 2**3.
PYTHON_ONLY = r"\b\d+[_xXoObB]|\*\*"


class UnknownName(ValueError):
    """A name that is neither a unit nor known."""

    def __init__(self, name: str, known: Mapping[str, float]) -> None:
        hint = meant(name, known, 1) or f"units: {', '.join(units())}"
        super().__init__(f"{name} is unknown ({hint})")


class WrongUnit(ValueError):
    """Units in an expression that do not make up that of its label."""

    def __init__(self, unit: str) -> None:
        kind = "" if unit == "-" else f"in {with_slash(unit)}, or "
        super().__init__(f"must be {kind}without a unit")


def explained(setting: str, rule: str, error: Exception) -> str:
    """The message on a setting that is no arithmetic: "setting: rule; name is unknown", or what
    its unit must be.
    """
    if isinstance(error, WrongUnit):
        return f"{setting}: {error}"
    return f"{setting}: {rule}; {error}" if isinstance(error, UnknownName) else f"{setting}: {rule}"


@lru_cache(maxsize=1)
def units() -> dict[str, float]:
    """SI values of the units by name, from pro/units.pro; an angle's in degrees."""
    return {name: value_of(parsed(value), PI) for name, value, _ in declared_units()}


def declared_units() -> list[tuple[str, str, str]]:
    """Name, value and SI unit of each unit of pro/units.pro."""
    text = (data("pro") / "units.pro").read_text()
    return re.findall(r"(?m)^(\w+) = ([^;]+);  // (\w+)$", text)


@lru_cache(maxsize=1)
def powers_of_units() -> dict[str, Powers]:
    """Powers of length, mass, temperature and angle in each unit."""
    return {name: POWERS[unit] for name, _, unit in declared_units()}


@lru_cache(maxsize=64)
def powers_of_label(unit: str) -> Powers:
    """Powers of length, mass, temperature and angle in a label's unit: N per m, Pa s per m, -."""
    above, _, below = unit.partition("per ")
    signs = [(1, word) for word in above.split()] + [(-1, word) for word in below.split()]
    counted = [(sign, POWERS[word]) for sign, word in signs if word in POWERS]
    return tuple(sum(sign * powers[i] for sign, powers in counted) for i in range(4))


def fits(node: ast.expr, unit: str) -> bool:
    """Whether the units in an expression make up the unit of a label; empty: any. Numbers alone
    do; names that are no units may have any.
    """
    names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)} - set(PI)
    if not unit or not names or names - set(units()):
        return True
    try:
        return powers(node) in (None, powers_of_label(unit))
    except ValueError:
        return False


def powers(node: ast.expr) -> Powers | None:
    """Powers of the units in an expression, None without any. Raises ValueError for a sum of
    different ones, or where an exponent has units.
    """
    if isinstance(node, ast.UnaryOp):
        return powers(node.operand)
    if not isinstance(node, ast.BinOp):
        return powers_of_units().get(node.id) if isinstance(node, ast.Name) else None
    left, right = powers(node.left), powers(node.right)
    if isinstance(node.op, (ast.Add, ast.Sub)):
        if left and right and left != right:
            raise ValueError("a sum of different units")
        return left or right
    if isinstance(node.op, ast.Pow):
        if right:
            raise ValueError("an exponent with a unit")
        return left and tuple(p * value_of(node.right, PI) for p in left)
    if not (left or right):
        return None
    sign = -1 if isinstance(node.op, ast.Div) else 1
    pairs = zip(left or [0] * 4, right or [0] * 4, strict=True)
    return tuple(a + sign * b for a, b in pairs)


def arithmetic_value(text: str, unit: str = "", known: Mapping[str, float] | None = None) -> float:
    """The value of arithmetic with numbers, + - * / ^ ( ), Pi, units and known names: 20*GPa; unit:
    of its label, see `fits`.

    Raises ValueError, for example UnknownName, WrongUnit.
    """
    node = parsed(text)
    value = value_of(node, PI | units() | dict(known or {}))
    if not fits(node, unit):
        raise WrongUnit(unit)
    return value


def quantity(text: str, unit: str = "") -> float:
    """The value of a number, also nan or inf, or of arithmetic in the unit of a label.

    Raises ValueError.
    """
    try:
        return number(text)
    except ValueError:
        return arithmetic_value(text, unit)


def number(text: str) -> float:
    """A number as Gmsh reads it; 1_000 and the digits of other scripts are numbers in Python only.

    Raises ValueError.
    """
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


def parsed(text: str) -> ast.expr:
    """The expression of a text, with ^ for powers. Raises ValueError."""
    if re.search(PYTHON_ONLY, text) or not text.isascii():
        raise ValueError(text)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # Python warns of 1if 1else 2
            return ast.parse(text.strip().replace("^", "**"), mode="eval").body
    except (SyntaxError, Warning, RecursionError, MemoryError):
        raise ValueError(text) from None


def value_of(node: ast.expr, known: Mapping[str, float]) -> float:
    """The value of numbers, + - * / ^ ( ) and known names.

    Raises ValueError if it is anything else, or no finite real number.
    """

    def value(node: ast.expr) -> float:
        if isinstance(node, ast.Constant) and not isinstance(node.value, bool):
            if isinstance(node.value, (int, float)):
                return float(node.value)
            raise ValueError(node.value)
        if isinstance(node, ast.Name):
            if node.id not in known:
                raise UnknownName(node.id, known)
            return known[node.id]
        if isinstance(node, ast.BinOp) and type(node.op) in BINARY:
            return BINARY[type(node.op)](value(node.left), value(node.right))
        if isinstance(node, ast.UnaryOp) and type(node.op) in UNARY:
            return UNARY[type(node.op)](value(node.operand))
        raise ValueError(type(node).__name__)

    try:
        number = value(node)
    except (ArithmeticError, RecursionError, MemoryError) as error:
        raise ValueError(str(error)) from None
    if not isinstance(number, float) or not math.isfinite(number):  # complex: a root of -1
        raise ValueError(number)
    return number


def check_units(setting: str, texts: Sequence[str]) -> None:
    """Raise InputError if a number in a list has no unit and another one a unit that is not of the
    SI, as MPa. Zero needs none, and texts that are no arithmetic do not count.
    """
    scaled, plain = False, list[str]()
    for text in texts if len(texts) > 1 else ():
        with contextlib.suppress(ValueError):
            node = parsed(text)
            names = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
            scaled |= any(units().get(name, 1.0) != 1.0 for name in names)
            if not names and value_of(node, {}):
                plain.append(text.strip())
    if scaled and plain:
        raise InputError(f"{setting}: {plain[0]} must have a unit, as the others have")


def arguments_of(text: str) -> tuple[list[str], dict[str, str]]:
    """Texts of the arguments and of the named arguments of a call, see `parsed_call`."""
    node = parsed(text)
    assert isinstance(node, ast.Call)
    named = {word.arg: ast.unparse(word.value) for word in node.keywords if word.arg}
    return [ast.unparse(argument) for argument in node.args], named


def parsed_call(text: str, unit: str) -> tuple[str, list[float], dict[str, float]]:
    """Name, arguments and named arguments of 'name(1, 2, scale=3)', all of them numbers or
    arithmetic in the unit of a label.

    Raises ValueError.
    """
    node = parsed(text)
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
        raise ValueError(text)
    known = PI | units()
    if not all(
        fits(value, unit) for value in [*node.args, *(word.value for word in node.keywords)]
    ):
        raise WrongUnit(unit)
    named = {word.arg: value_of(word.value, known) for word in node.keywords if word.arg}
    if len(named) < len(node.keywords):
        raise ValueError(text)
    return node.func.id, [value_of(argument, known) for argument in node.args], named
