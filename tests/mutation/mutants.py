"""Small wrong changes of a module's source, listed by its syntax tree.

Every change is a replaced stretch of text, so that comments and line numbers stay: another
operator, another side of a comparison, a constant one more or of the other sign, a statement left
out, indices swapped, a slice shifted, a function's counterpart called. Annotations, imports,
decorators, texts and what draws or prints are left alone: they do not change what is computed.
"""

import ast
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

OPERATORS = {
    **{ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*")},
    **{ast.Pow: ("**", "*"), ast.FloorDiv: ("//", "*"), ast.Mod: ("%", "*")},
    **{ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&"), ast.And: ("and", "or")},
    **{ast.Or: ("or", "and"), ast.USub: ("-", ""), ast.Invert: ("~", ""), ast.Not: ("not", "")},
}
COMPARISONS = {
    **{ast.Lt: ("<", "<=", ">="), ast.LtE: ("<=", "<", ">"), ast.Eq: ("==", "!=")},
    **{ast.Gt: (">", ">=", "<="), ast.GtE: (">=", ">", "<"), ast.NotEq: ("!=", "==")},
    **{ast.Is: ("is", "is not"), ast.IsNot: ("is not", "is")},
    **{ast.In: ("in", "not in"), ast.NotIn: ("not in", "in")},
}
COUNTERPARTS = {
    **{"cos": "sin", "sin": "cos", "tan": "sin", "arccos": "arcsin", "sqrt": "abs", "abs": ""},
    **{"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "ceil": "floor"},
    **{"any": "all", "all": "any", "zeros": "ones", "ones": "zeros", "zeros_like": "ones_like"},
    **{"full": "zeros", "eye": "ones", "inf": "nan", "sum": "max", "mean": "sum", "std": "var"},
    **{"triu": "tril", "argsort": "argmax", "cumsum": "array", "flatnonzero": "unique"},
}


SHOWN = ("plot", "__str__", "__repr__")
"""Functions that show results only."""


@dataclass(frozen=True)
class Mutant:
    """One change of the module at `path`: the bytes from `start` to `end` become `text`."""

    path: str
    line: int
    start: int
    end: int
    text: str
    before: str
    after: str

    @property
    def module(self) -> str:
        """The module's name in the list of tests."""
        return self.path.removeprefix("modal/").removesuffix(".py")

    def __str__(self) -> str:
        """The same wherever the line stands in its module."""
        return f"{self.path}: {self.before} -> {self.after}"

    def apply(self, source: bytes) -> bytes:
        """The changed module."""
        return source[: self.start] + self.text.encode() + source[self.end :]


class Changes:
    """Walks over a module and yields (start, end, text) for all changes, in bytes."""

    def __init__(self, source: bytes) -> None:
        self.source = source
        self.line_start = [0]
        for line in source.splitlines(keepends=True):
            self.line_start.append(self.line_start[-1] + len(line))

    def start(self, node: ast.AST) -> int:
        """First byte of a node."""
        return self.line_start[node.lineno - 1] + node.col_offset

    def end(self, node: ast.AST) -> int:
        """The byte after a node."""
        return self.line_start[node.end_lineno - 1] + node.end_col_offset

    def text(self, node: ast.AST) -> str:
        """Source of a node."""
        return self.source[self.start(node) : self.end(node)].decode()

    def below(self, node: ast.AST) -> Iterator[tuple[int, int, str]]:
        """The changes of a node and of all its parts."""
        if isinstance(node, ast.FunctionDef) and node.name in SHOWN:
            return
        yield from self.of(node)
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list"):
                continue
            for part in value if isinstance(value, list) else [value]:
                if isinstance(part, ast.AST) and not isinstance(part, ast.JoinedStr):
                    yield from self.below(part)

    def between(self, low: int, high: int, old: str, new: str) -> Iterator[tuple[int, int, str]]:
        """Replace an operator that stands between two operands."""
        at = self.source.index(old.encode(), low, high)
        yield at, at + len(old), new

    def of(self, node: ast.AST) -> Iterator[tuple[int, int, str]]:
        """The changes of one node."""
        here = (self.start(node), self.end(node)) if hasattr(node, "lineno") else (0, 0)
        match node:
            case ast.BinOp(left, op, right) if type(op) in OPERATORS:
                yield from self.between(self.end(left), self.start(right), *OPERATORS[type(op)])
            case ast.BoolOp(op, values):
                for left, right in zip(values, values[1:], strict=False):
                    yield from self.between(self.end(left), self.start(right), *OPERATORS[type(op)])
            case ast.UnaryOp(op, operand) if type(op) in OPERATORS:
                yield from self.between(here[0], self.start(operand), *OPERATORS[type(op)])
            case ast.Compare(left, ops, right):
                for op, a, b in zip(ops, [left, *right], right, strict=False):
                    old, *others = COMPARISONS[type(op)]
                    for new in others:
                        yield from self.between(self.end(a), self.start(b), old, new)
            case ast.Constant(bool() as value):
                yield *here, str(not value)
            case ast.Constant(int() as value):
                yield *here, str(value + 1)
                yield *here, str(value - 1)
            case ast.Constant(float() as value):
                yield *here, f"-{self.text(node)}" if value else "1.0"
            case ast.Slice(lower, upper):
                for bound in (lower, upper):
                    if bound is not None and not isinstance(bound, ast.Constant):
                        yield self.end(bound), self.end(bound), " + 1"
            case ast.Subscript(slice=ast.Tuple([first, second, *_])):
                yield from self.swapped(first, second)
            case ast.Call(func=ast.Attribute(attr="cross"), args=[first, second]):
                yield from self.swapped(first, second)
            case ast.Name(id=name) if name in COUNTERPARTS:
                yield *here, COUNTERPARTS[name]
            case ast.Attribute(attr=name) if name in COUNTERPARTS:
                yield here[1] - len(name), here[1], COUNTERPARTS[name] or "real"
            case ast.If(test) | ast.While(test) | ast.IfExp(test):
                yield self.start(test), self.end(test), f"not ({self.text(test)})"
            case ast.AugAssign(op=op) if type(op) in OPERATORS:
                low, high = self.end(node.target), self.start(node.value)
                old, new = OPERATORS[type(op)]
                yield from self.between(low, high, old + "=", new + "=")
                yield *here, "pass"
            case ast.Raise() | ast.Break() | ast.Continue():
                yield *here, "pass"
            case ast.Expr(ast.Call() | ast.Yield() as call):
                yield self.start(call), self.end(call), "pass"
            case ast.Assign([ast.Subscript() | ast.Attribute()]):
                yield *here, "pass"

    def swapped(self, first: ast.AST, second: ast.AST) -> Iterator[tuple[int, int, str]]:
        """Two neighbours the other way round."""
        middle = self.source[self.end(first) : self.start(second)].decode()
        if self.text(first) != self.text(second):
            text = self.text(second) + middle + self.text(first)
            yield self.start(first), self.end(second), text


def mutants_of(root: Path, path: str) -> list[Mutant]:
    """All mutants of a module that Python compiles, in the order of the source."""
    source = (root / path).read_bytes()
    tree = ast.parse(source)
    found = []
    for start, end, text in sorted(set(Changes(source).below(tree))):
        first = source.rfind(b"\n", 0, start) + 1
        last = source.find(b"\n", end)
        changed = source[first:start] + text.encode() + source[end:last]
        before, after = (" ".join(part.decode().split()) for part in (source[first:last], changed))
        line = source.count(b"\n", 0, start) + 1
        mutant = Mutant(path, line, start, end, text, before, after)
        try:
            other = ast.parse(mutant.apply(source))
        except SyntaxError:
            continue
        if ast.dump(other) != ast.dump(tree):
            found.append(mutant)
    return found


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
