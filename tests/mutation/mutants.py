"""Small wrong changes of a module, made in its syntax tree.

Another operator, another side of a comparison, a constant one more or of the other sign, a
statement left out, indices swapped, a slice shifted, a function's counterpart called. Annotations,
imports, decorators, texts and what draws or prints are left alone: they do not change what is
computed.
"""

import ast
import random
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from pathlib import Path

OPERATORS = {
    **{ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult},
    **{ast.Pow: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult},
    **{ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.And: ast.Or, ast.Or: ast.And},
}
COMPARISONS = {
    **{ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Eq: (ast.NotEq,)},
    **{ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt), ast.NotEq: (ast.Eq,)},
    **{ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,)},
}
COUNTERPARTS = {
    **{"cos": "sin", "sin": "cos", "tan": "sin", "arccos": "arcsin", "sqrt": "abs"},
    **{"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "ceil": "floor"},
    **{"any": "all", "all": "any", "zeros": "ones", "ones": "zeros", "zeros_like": "ones_like"},
    **{"full": "zeros", "eye": "ones", "inf": "nan", "sum": "max", "mean": "sum", "std": "var"},
    **{"triu": "tril", "argsort": "argmax", "cumsum": "array", "flatnonzero": "unique"},
}
LEFT_ALONE = ("annotation", "returns", "decorator_list")
SHOWN = ("plot", "__str__", "__repr__")
"""Functions that show results only."""


@dataclass(frozen=True)
class Mutant:
    """Change number `number` of the module at `path`, in a statement whose first line it turns."""

    path: str
    number: int
    before: str
    after: str

    @property
    def module(self) -> str:
        """The module's name in the list of tests."""
        return self.path.removeprefix("modal/").removesuffix(".py")

    def __str__(self) -> str:
        """The same wherever the statement stands in its module."""
        return f"{self.path}: {self.before} -> {self.after}"

    def apply(self, source: str) -> str:
        """The changed module."""
        tree = ast.parse(source)
        next(mutant for mutant in mutants(tree, self.path) if mutant.number == self.number)
        return ast.unparse(tree)


def changed(node: ast.AST, **fields: object) -> ast.AST:
    """A copy of a node with other fields."""
    node = copy(node)
    vars(node).update(fields)
    return node


def alternatives(node: ast.AST) -> Iterator[ast.AST]:
    """What may stand in place of a node."""
    match node:
        case ast.BinOp(op=op) | ast.BoolOp(op=op) | ast.AugAssign(op=op) if type(op) in OPERATORS:
            yield changed(node, op=OPERATORS[type(op)]())
        case ast.UnaryOp(ast.USub() | ast.Invert() | ast.Not(), operand):
            yield operand
        case ast.Compare(ops=ops):
            for k, op in enumerate(ops):
                for other in COMPARISONS[type(op)]:
                    yield changed(node, ops=[*ops[:k], other(), *ops[k + 1 :]])
        case ast.Constant(bool() as value):
            yield ast.Constant(not value)
        case ast.Constant(int() as value):
            yield from (ast.parse(str(value + step), mode="eval").body for step in (1, -1))
        case ast.Constant(float() as value):
            yield ast.UnaryOp(ast.USub(), node) if value else ast.Constant(1.0)
        case ast.Slice(lower, upper):
            for name, bound in (("lower", lower), ("upper", upper)):
                if bound is not None and not isinstance(bound, ast.Constant):
                    yield changed(node, **{name: ast.BinOp(bound, ast.Add(), ast.Constant(1))})
        case ast.Subscript(slice=ast.Tuple([first, second, *rest])):
            yield changed(node, slice=changed(node.slice, elts=[second, first, *rest]))
        case ast.Call(func=ast.Attribute(attr="cross"), args=[first, second]):
            yield changed(node, args=[second, first])
        case ast.Call(func=ast.Name("abs"), args=[value]):
            yield value
        case ast.Name(name) if name in COUNTERPARTS:
            yield changed(node, id=COUNTERPARTS[name])
        case ast.Attribute(attr=name) if name in COUNTERPARTS:
            yield changed(node, attr=COUNTERPARTS[name])
        case ast.If(test) | ast.While(test) | ast.IfExp(test):
            yield changed(node, test=ast.UnaryOp(ast.Not(), test))
    match node:
        case (
            ast.AugAssign() | ast.Raise() | ast.Break() | ast.Continue()
            | ast.Expr(ast.Call() | ast.Yield()) | ast.Assign([ast.Subscript() | ast.Attribute()])
        ):  # fmt: skip
            yield ast.Pass()


def mutants(node: ast.AST, path: str, first: int = 0, line: ast.AST | None = None) -> Iterator:
    """The mutants of all that stands below a node, which has the change while each is told."""
    number = first
    for name, value in ast.iter_fields(node):
        of, keys = (value, range(len(value))) if isinstance(value, list) else (vars(node), [name])
        for key in keys if name not in LEFT_ALONE else ():
            part = of[key]
            shown = isinstance(part, ast.FunctionDef) and part.name in SHOWN
            if not isinstance(part, ast.AST) or isinstance(part, ast.JoinedStr) or shown:
                continue
            own = isinstance(part, ast.stmt | ast.match_case)
            statement = part if own else line
            for other in alternatives(part):
                if ast.dump(other) != ast.dump(part):
                    before, of[key] = heading(statement), other
                    yield Mutant(path, number, before, heading(other if own else statement))
                    of[key], number = part, number + 1
            for mutant in mutants(part, path, number, statement):
                yield mutant
                number = mutant.number + 1


def heading(statement: ast.AST) -> str:
    """A statement in one line; of a compound one its first, decorators left out."""
    lines = ast.unparse(statement).splitlines()
    return next(line.strip() for line in lines if line and not line.startswith("@"))


def mutants_of(root: Path, path: str) -> list[Mutant]:
    """All mutants of a module, in the order of its syntax tree."""
    return list(mutants(ast.parse((root / path).read_text()), path))


def drawn(pools: list[list[Mutant]], count: int, seed: int) -> list[Mutant]:
    """A sample of `count` mutants, mixed; half shared out evenly, half by the size of a module.

    A larger sample of the same sources contains a smaller one.
    """
    total = sum(len(pool) for pool in pools)
    sample = []
    for pool in pools:
        mixed = random.Random(f"{seed} {pool[0].path}").sample(pool, len(pool))
        sample += mixed[: round(count * (0.5 / len(pools) + 0.5 * len(pool) / total))]
    return random.Random(seed).sample(sample, len(sample))
