"""Small wrong changes of a module, made in its syntax tree.

A change is another operator, another side of a comparison, a constant one more or of the other
sign, a statement left out, swapped indices, a shifted slice, or the counterpart of a function.
Annotations, imports, decorators, texts, and functions that draw or print do not change what is
computed, and stay as they are.
"""

import ast
import random
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from pathlib import Path

OPERATORS = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
"""Operator that replaces another one."""
COMPARISONS = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Eq: (ast.NotEq,),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
"""Comparisons that replace another one."""
COUNTERPARTS = {
    "cos": "sin",
    "sin": "cos",
    "tan": "sin",
    "arccos": "arcsin",
    "sqrt": "abs",
    "min": "max",
    "max": "min",
    "minimum": "maximum",
    "maximum": "minimum",
    "ceil": "floor",
    "any": "all",
    "all": "any",
    "zeros": "ones",
    "ones": "zeros",
    "zeros_like": "ones_like",
    "full": "zeros",
    "eye": "ones",
    "inf": "nan",
    "sum": "max",
    "mean": "sum",
    "std": "var",
    "triu": "tril",
    "argsort": "argmax",
    "cumsum": "array",
    "flatnonzero": "unique",
}
"""Function that replaces another one."""
UNCHANGED_FIELDS = ("annotation", "returns", "decorator_list")
"""Fields of a node that do not change what is computed."""
DISPLAY_FUNCTIONS = ("plot", "__str__", "__repr__")
"""Functions that show results only."""


@dataclass(frozen=True)
class Mutant:
    """A change of a module.

    Attributes
    ----------
    path : str
        File of the module, in the project.
    number : int
        Number of the change in the order of the syntax tree.
    before, after : str
        First line of the changed statement.
    """

    path: str
    number: int
    before: str
    after: str

    @property
    def module(self) -> str:
        """Name of the module in the list of tests."""
        return self.path.removeprefix("modal/").removesuffix(".py")

    def __str__(self) -> str:
        """Return a name that does not depend on where the statement is in its module."""
        return f"{self.path}: {self.before} -> {self.after}"

    def apply(self, source: str) -> str:
        """Return the changed source of the module."""
        tree = ast.parse(source)
        # The tree has the change while the generator waits at its mutant.
        next(mutant for mutant in find_mutants(tree, self.path) if mutant.number == self.number)
        return ast.unparse(tree)


def replace_fields(node: ast.AST, **fields: object) -> ast.AST:
    """Return a copy of a node with other fields."""
    node = copy(node)
    vars(node).update(fields)
    return node


def find_replacements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes that may replace a node."""
    match node:
        case ast.BinOp(op=op) | ast.BoolOp(op=op) | ast.AugAssign(op=op) if type(op) in OPERATORS:
            yield replace_fields(node, op=OPERATORS[type(op)]())
        case ast.UnaryOp(ast.USub() | ast.Invert() | ast.Not(), operand):
            yield operand
        case ast.Compare(ops=operators):
            for k, operator in enumerate(operators):
                for other in COMPARISONS[type(operator)]:
                    yield replace_fields(node, ops=[*operators[:k], other(), *operators[k + 1 :]])
        case ast.Constant(bool() as value):
            yield ast.Constant(not value)
        case ast.Constant(int() as value):
            yield ast.parse(str(value + 1), mode="eval").body
            yield ast.parse(str(value - 1), mode="eval").body
        case ast.Constant(float() as value):
            yield ast.UnaryOp(ast.USub(), node) if value else ast.Constant(1.0)
        case ast.Slice(lower, upper):
            for name, bound in (("lower", lower), ("upper", upper)):
                if bound is not None and not isinstance(bound, ast.Constant):
                    shifted_bound = ast.BinOp(bound, ast.Add(), ast.Constant(1))
                    yield replace_fields(node, **{name: shifted_bound})
        case ast.Subscript(slice=ast.Tuple([first, second, *rest])):
            swapped = replace_fields(node.slice, elts=[second, first, *rest])
            yield replace_fields(node, slice=swapped)
        case ast.Call(func=ast.Attribute(attr="cross"), args=[first, second]):
            yield replace_fields(node, args=[second, first])
        case ast.Call(func=ast.Name("abs"), args=[value]):
            yield value
        case ast.Name(name) if name in COUNTERPARTS:
            yield replace_fields(node, id=COUNTERPARTS[name])
        case ast.Attribute(attr=name) if name in COUNTERPARTS:
            yield replace_fields(node, attr=COUNTERPARTS[name])
        case ast.If(test) | ast.While(test) | ast.IfExp(test):
            yield replace_fields(node, test=ast.UnaryOp(ast.Not(), test))
    if _may_be_left_out(node):
        yield ast.Pass()


def _may_be_left_out(node: ast.AST) -> bool:
    """Return whether a statement may be replaced by `pass`."""
    match node:
        case ast.AugAssign() | ast.Raise() | ast.Break() | ast.Continue():
            return True
        case ast.Expr(ast.Call() | ast.Yield()):
            return True
        case ast.Assign([ast.Subscript() | ast.Attribute()]):
            return True
    return False


def find_mutants(
    node: ast.AST, path: str, first: int = 0, statement: ast.AST | None = None
) -> Iterator[Mutant]:
    """Yield the mutants of all nodes below a node; the tree has the change of the last one yielded.

    Parameters
    ----------
    node : ast.AST
        Root of the tree; it is changed and restored.
    path : str
        File of the module.
    first : int
        Number of the first mutant.
    statement : ast.AST, optional
        Statement that contains the node.
    """
    number = first
    for container, key in _list_children(node):
        child = container[key]
        is_statement = isinstance(child, ast.stmt | ast.match_case)
        child_statement = child if is_statement else statement
        for replacement in find_replacements(child):
            if ast.dump(replacement) == ast.dump(child):
                continue
            before = first_line(child_statement)
            container[key] = replacement
            after = first_line(replacement if is_statement else child_statement)
            yield Mutant(path, number, before, after)
            container[key] = child
            number += 1
        for mutant in find_mutants(child, path, number, child_statement):
            yield mutant
            number = mutant.number + 1


def _list_children(node: ast.AST) -> list[tuple[list | dict, int | str]]:
    """Return where the nodes below a node that may be changed are: a container and a key each."""
    places = []
    for name, value in ast.iter_fields(node):
        if name in UNCHANGED_FIELDS:
            continue
        if isinstance(value, list):
            places += [(value, k) for k in range(len(value))]
        else:
            places.append((vars(node), name))
    return [(container, key) for container, key in places if _may_be_changed(container[key])]


def _may_be_changed(node: object) -> bool:
    """Return whether a change of a node may change what is computed."""
    if not isinstance(node, ast.AST) or isinstance(node, ast.JoinedStr):
        return False
    return not (isinstance(node, ast.FunctionDef) and node.name in DISPLAY_FUNCTIONS)


def first_line(statement: ast.AST) -> str:
    """Return the first line of a statement without its decorators."""
    lines = ast.unparse(statement).splitlines()
    return next(line.strip() for line in lines if line and not line.startswith("@"))


def read_mutants(root: Path, path: str) -> list[Mutant]:
    """Return all mutants of a module, in the order of its syntax tree."""
    return list(find_mutants(ast.parse((root / path).read_text()), path))


def draw_mutants(pools: list[list[Mutant]], count: int, seed: int) -> list[Mutant]:
    """Draw `count` mutants: half shared out evenly, half by the size of a module, in random order.

    A larger sample of the same sources contains a smaller one.
    """
    total = sum(len(pool) for pool in pools)
    sample = []
    for pool in pools:
        mixed = random.Random(f"{seed} {pool[0].path}").sample(pool, len(pool))
        sample += mixed[: round(count * (0.5 / len(pools) + 0.5 * len(pool) / total))]
    return random.Random(seed).sample(sample, len(sample))
