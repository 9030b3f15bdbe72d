"""Arithmetic in texts of the user, parsed as an expression without ever being executed."""

from __future__ import annotations

import ast
import math
import operator
import warnings
from collections.abc import Callable, Mapping

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


def parsed(text: str) -> ast.expr:
    """The expression of a text, with ^ for powers.

    Raises ValueError.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # Python warns of 1if 1else 2
            return ast.parse(text.strip().replace("^", "**"), mode="eval").body
    except (SyntaxError, Warning, RecursionError, MemoryError):
        raise ValueError(text) from None


def value_of(node: ast.expr, known: Mapping[str, float]) -> float:
    """The value of numbers, + - * / ^ ( ), Pi and known names.

    Raises ValueError if it is anything else, or no finite real number.
    """

    def value(node: ast.expr) -> float:
        if isinstance(node, ast.Constant) and not isinstance(node.value, bool):
            if isinstance(node.value, (int, float)):
                return float(node.value)
            raise ValueError(node.value)
        if isinstance(node, ast.Name) and node.id in known:
            return known[node.id]
        if isinstance(node, ast.Name) and node.id == "Pi":
            return math.pi
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


def call_of(text: str) -> tuple[str, list[float], dict[str, float]]:
    """Name, arguments and named arguments of 'name(1, 2, scale=3)', all of them numbers.

    Raises ValueError.
    """
    node = parsed(text)
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
        raise ValueError(text)
    named = {word.arg: value_of(word.value, {}) for word in node.keywords if word.arg}
    if len(named) < len(node.keywords):
        raise ValueError(text)
    return node.func.id, [value_of(argument, {}) for argument in node.args], named
