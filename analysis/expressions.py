"""Evaluate expressions in a study's data, which are limited to arithmetic and comparisons.

    friction + 0.1                                     a setting of a case
    100 * (v_p / v_p_theory - 1)                       a column of a table
    kind == 'random' and case in [2, 6]                a selection of cases
    '_width' in name                                   cases whose name has this text in it
    value('case06', 'void_ratio')                      a number in a caption

A study may come from someone else, so its expressions are data: the text is parsed, each part is
compared with the short list of parts that are allowed, and only numbers, texts and truth values are
computed. Every number is a float, so that no power grows beyond the largest float, and an
expression has a largest length and depth. Names have numbers, or columns of numbers with one for
each case.
"""

import ast
import operator
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from modal.tools.errors import InputError

MAX_LENGTH = 2000
"""Largest number of characters of an expression: a selection that names each of a hundred cases has
1,000."""
MAX_DEPTH = 60
"""Largest number of nested levels of an expression, as in a sum of so many terms. Python's parser
allows far more."""
Value = Any
"""The value of an expression: a float, a text, a truth value, or a column (a Series) of these."""
ARITHMETIC: dict[type[ast.operator], Callable[[Value, Value], Value]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
COMPARISONS: dict[type[ast.cmpop], Callable[[Value, Value], Value]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
FUNCTIONS: dict[str, Callable[..., Value]] = {
    "abs": np.abs,
    "exp": np.exp,
    "log": np.log,
    "log10": np.log10,
    "sqrt": np.sqrt,
}
"""Functions that an expression may apply to a number or a column; `log` is the natural
logarithm."""
WORDS_FOR = {"dict": "lines NAME: VALUE", "list": "a list"}
"""Words that stand in an error message in place of a value that has several parts."""


class UnknownNameError(InputError):
    """Raised for a name in an expression that is not defined."""


def evaluate(
    text: object,
    names: Mapping[str, Value],
    functions: Mapping[str, Callable[..., Value]] | None = None,
) -> Value:
    """Return the value of an expression of `names`, which may call `functions`.

    Without `functions` those of `FUNCTIONS` may be called. Raises InputError if the text is not an
    expression, or if its value cannot be computed, and UnknownNameError for a name that is not in
    `names`.

    >>> evaluate("friction + 0.1", {"friction": 0.4})
    0.5
    >>> evaluate("2 < width < 5 and kind == 'fcc'", {"width": 4.0, "kind": "fcc"})
    True
    """
    node = parse(text)
    if functions is None:
        functions = FUNCTIONS
    evaluation = _Evaluation(str(text), names, functions)
    try:
        with np.errstate(all="ignore"):
            return evaluation.value(node)
    except InputError:
        raise
    except (TypeError, ValueError, ArithmeticError) as error:
        problem = f"{short(text)}: cannot be computed ({_first_line(error)})"
        remedy = "write sums of known numbers"
        raise InputError("expression_value", problem, remedy=remedy) from None


def parse(text: object) -> ast.expr:
    """Return the tree of an expression; InputError if it is too long, too deep or invalid."""
    if not isinstance(text, str):
        raise InputError("expression", f"{short(text)}: is no text", remedy="write an expression")
    if len(text) > MAX_LENGTH:
        raise InputError(
            "expression_size",
            f"{short(text)}: {len(text)} characters",
            remedy=f"an expression has {MAX_LENGTH} at most",
        )
    try:
        with warnings.catch_warnings(action="ignore"):
            tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError) as error:
        raise InputError(
            "expression",
            f"{short(text)}: is no expression ({_first_line(error)})",
            remedy="write as friction + 0.1",
        ) from None
    except (RecursionError, MemoryError):
        raise _too_deep(text) from None
    level: list[ast.AST] = [tree.body]
    for _ in range(MAX_DEPTH):
        level = [child for node in level for child in ast.iter_child_nodes(node)]
        if not level:
            return tree.body
    raise _too_deep(text)


def names_in(text: str) -> set[str]:
    """Return the names in an expression."""
    return {node.id for node in ast.walk(parse(text)) if isinstance(node, ast.Name)}


def short(value: object, length: int = 60) -> str:
    """Return a value for one line of an error message: cut, without control characters.

    >>> short("a\\nb"), short("abcdef", 4)
    ('a b', 'abc...')
    """
    if isinstance(value, str):
        start = value[: 4 * length]
    elif isinstance(value, int | float | None):
        start = str(value)[: 4 * length]
    else:
        start = WORDS_FOR.get(type(value).__name__, type(value).__name__)
    line = "".join(char if char.isprintable() else " " for char in start)
    if len(line) <= length:
        return line
    return f"{line[: length - 1]}..."


class _Evaluation:
    """Evaluator of one expression."""

    def __init__(
        self,
        text: str,
        names: Mapping[str, Value],
        functions: Mapping[str, Callable[..., Value]],
    ) -> None:
        self.text = text
        self.names = names
        self.functions = functions

    def value(self, node: ast.expr) -> Value:
        """Return the value of one part of the expression's syntax tree."""
        match node:
            case ast.Constant(value=bool() | str() as value):
                return value
            case ast.Constant(value=int() | float() as value):
                return float(value)
            case ast.Name(id=name):
                return self._named(name)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in ARITHMETIC:
                return self._arithmetic(op, left, right)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return _opposite(self._truth(operand))
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self._number(operand)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self._number(operand)
            case ast.BoolOp(op=op, values=parts):
                truths = [self._truth(part) for part in parts]
                if isinstance(op, ast.And):
                    return self._joined(operator.and_, truths)
                return self._joined(operator.or_, truths)
            case ast.Compare():
                return self._comparison(node)
            case ast.Call():
                return self._call(node)
        raise self._refusal(node)

    def _named(self, name: str) -> Value:
        """Return the value that a name stands for."""
        if name not in self.names:
            raise UnknownNameError(
                "unknown_name",
                f"{short(self.text)}: {short(name)} is not known",
                remedy="name what is there",
            )
        value = self.names[name]
        if isinstance(value, int | float) and not isinstance(value, bool):
            return float(value)
        return value

    def _number(self, node: ast.expr) -> Value:
        """Return the value of a part that must be a number, or a column of numbers, as floats."""
        value = self.value(node)
        if isinstance(value, pd.Series):
            return value.astype(float)
        if isinstance(value, float | bool):
            return float(value)
        raise self._refusal(node, "no number")

    def _truth(self, node: ast.expr) -> Value:
        """Return the truth value of a part, or one for each case; unknown counts as false."""
        value = self.value(node)
        if isinstance(value, bool):
            return value
        if isinstance(value, pd.Series) and pd.api.types.infer_dtype(value) == "boolean":
            return value.eq(True).astype(bool)
        raise self._refusal(node, "neither true nor false")

    def _joined(self, join: Callable[[Value, Value], Value], values: list[Value]) -> Value:
        """Return several truth values combined by the function `join`, for `and` or `or`."""
        first, *others = values
        for value in others:
            first = join(first, value)
        return first

    def _arithmetic(self, op: ast.operator, left: ast.expr, right: ast.expr) -> Value:
        """Return a sum, a difference, a product, a quotient or a power."""
        value = ARITHMETIC[type(op)](self._number(left), self._number(right))
        if isinstance(value, complex):
            raise self._refusal(left, "a root of a negative number")
        return value

    def _comparison(self, node: ast.Compare) -> Value:
        """Return whether all comparisons of a chain such as 1 < x < 2 are true."""
        operands = [node.left, *node.comparators]
        pairs = zip(operands, node.ops, operands[1:], strict=False)
        return self._joined(operator.and_, [self._compared(*pair) for pair in pairs])

    def _compared(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> Value:
        """Return the truth value of one comparison."""
        if isinstance(op, ast.In):
            return self._contained(left, right)
        if isinstance(op, ast.NotIn):
            return _opposite(self._contained(left, right))
        if type(op) not in COMPARISONS:
            raise self._refusal(right, "compared by a word that is not known")
        value = COMPARISONS[type(op)](self.value(left), self.value(right))
        if isinstance(value, pd.Series):
            return value
        return bool(value)

    def _contained(self, left: ast.expr, right: ast.expr) -> Value:
        """Return whether a value is one of a list, or a text is part of another."""
        value = self.value(left)
        if isinstance(right, ast.List | ast.Tuple):
            members = [self.value(member) for member in right.elts]
            if any(isinstance(member, pd.Series) for member in members):
                raise self._refusal(right, "no list of numbers or texts")
            if isinstance(value, pd.Series):
                return value.isin(members)
            return value in members
        return self._has_text(self.value(right), value, right)

    def _has_text(self, whole: Value, part: Value, node: ast.expr) -> Value:
        """Return whether a text, or each text of a column, contains another text."""
        if isinstance(part, str) and isinstance(whole, str):
            return part in whole
        if not isinstance(part, str) or not isinstance(whole, pd.Series):
            raise self._refusal(node, "no list, and no text that has another in it")
        return whole.astype(str).str.contains(part, regex=False)

    def _call(self, node: ast.Call) -> Value:
        """Return the value of a function call; NAME.str.contains(TEXT) means `TEXT in NAME`."""
        match node:
            case ast.Call(
                func=ast.Attribute(value=ast.Attribute(value=whole, attr="str"), attr="contains"),
                args=[part],
                keywords=[],
            ):
                return self._has_text(self.value(whole), self.value(part), node)
            case ast.Call(func=ast.Name(id=name)) if name in self.functions:
                return self._called(name, node)
        raise self._refusal(node)

    def _called(self, name: str, node: ast.Call) -> Value:
        """Return the value of a function in `FUNCTIONS`, or of one with constants in a caption."""
        function = self.functions[name]
        if self.functions is FUNCTIONS:
            if len(node.args) != 1 or node.keywords:
                raise self._refusal(node, f"{name} of one number")
            value = function(self._number(node.args[0]))
            if isinstance(value, pd.Series):
                return value
            return float(value)
        if any(word.arg is None for word in node.keywords):
            raise self._refusal(node)
        words = {str(word.arg): self.value(word.value) for word in node.keywords}
        return function(*map(self.value, node.args), **words)

    def _refusal(
        self, node: ast.expr, reason: str = "may not stand in an expression"
    ) -> InputError:
        """Return the error for a part of the tree that is not allowed in an expression."""
        part = short(ast.get_source_segment(self.text.strip(), node) or type(node).__name__)
        return InputError(
            "expression",
            f"{short(self.text)}: {part}",
            reason,
            "write sums, comparisons, and, or, not, in",
        )


def _opposite(value: Value) -> Value:
    """Return the negation of a truth value, or of each truth value in a column."""
    if isinstance(value, bool):
        return not value
    return ~value


def _too_deep(text: str) -> InputError:
    """Return the error of an expression with too many levels."""
    return InputError(
        "expression_size",
        f"{short(text)}: too many levels",
        remedy=f"an expression has {MAX_DEPTH} at most",
    )


def _first_line(error: BaseException) -> str:
    """Return the first line of an error's text, or its class."""
    return short(str(error).partition("\n")[0]) or type(error).__name__
