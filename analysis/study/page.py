"""Fill the page of a study: plain.html.j2, or the study's own page.html.j2, which extends it.

A study's template may come from someone else. It gets texts and numbers, but no objects. It is
filled in Jinja's sandbox, with few filters and only the function `number`. Parts that could make an
endless text or read another file are refused. Everything that it shows is escaped.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import jinja2
import jinja2.exceptions
import jinja2.nodes
import jinja2.runtime
import jinja2.sandbox

from analysis.expressions import short
from analysis.study.fields import number_format
from analysis.study.yaml_file import read_small
from analysis.table import number
from modal.tools.errors import InputError

OWN = "page.html.j2"
PLAIN = "plain.html.j2"
MAX_LOOPS = 2
"""Largest number of nested loops in a template: rows of a table, and their cells."""
FILTERS = {
    *("abs", "default", "e", "escape", "first", "float", "int", "last", "length", "list", "lower"),
    *("map", "max", "min", "reject", "rejectattr", "round", "select", "selectattr", "sort", "sum"),
    *("trim", "unique", "upper"),
}
"""Those of Jinja's filters whose result is no longer than their input."""
OF_CASES = "items", "keys", "values"
"""Methods that a template may call."""
PARTS: tuple[type[jinja2.nodes.Node], ...] = (
    *(jinja2.nodes.Template, jinja2.nodes.Extends, jinja2.nodes.Block, jinja2.nodes.Output),
    *(jinja2.nodes.TemplateData, jinja2.nodes.If, jinja2.nodes.For, jinja2.nodes.Assign),
    *(jinja2.nodes.Name, jinja2.nodes.Const, jinja2.nodes.Getattr, jinja2.nodes.Getitem),
    *(jinja2.nodes.Call, jinja2.nodes.Filter, jinja2.nodes.Test, jinja2.nodes.Keyword),
    *(jinja2.nodes.Compare, jinja2.nodes.Operand, jinja2.nodes.And, jinja2.nodes.Or),
    *(jinja2.nodes.Not, jinja2.nodes.Neg, jinja2.nodes.CondExpr, jinja2.nodes.Tuple),
    *(jinja2.nodes.Add, jinja2.nodes.Sub, jinja2.nodes.Mul, jinja2.nodes.Div),
)
"""Parts of which a study's template may consist."""


class Sandbox(jinja2.sandbox.ImmutableSandboxedEnvironment):
    """Jinja's sandbox, limited to arithmetic with numbers and without attributes of objects."""

    intercepted_binops = frozenset(["+", "-", "*", "/"])

    def is_safe_attribute(self, obj: Any, attr: str, value: Any) -> bool:
        """Tell whether a template may take an attribute of an object."""
        if isinstance(obj, jinja2.runtime.LoopContext):
            return attr in ("index", "first", "last", "length")
        return isinstance(obj, Mapping) and attr in OF_CASES

    def call_binop(
        self, context: jinja2.runtime.Context, operator: str, left: Any, right: Any
    ) -> Any:
        """Return a sum, difference, product or quotient of two numbers."""
        if not (isinstance(left, int | float) and isinstance(right, int | float)):
            raise jinja2.exceptions.SecurityError("sums are of numbers alone")
        return super().call_binop(context, operator, float(left), float(right))


def page(folder: Path, content: Mapping[str, Any]) -> str:
    """Return the page of a study in `folder`, of texts and numbers by name.

    The page is complete without other files. Raises InputError if the study's own template cannot
    be filled.
    """
    path = folder / OWN
    sources = {PLAIN: Path(__file__).with_name(PLAIN).read_text()}
    if not path.exists():
        return _sandbox(sources).get_template(PLAIN).render(content)
    sources[OWN] = read_small(path)
    sandbox = _sandbox(sources)
    try:
        _refuse_program(sandbox.parse(sources[OWN]))
        return sandbox.get_template(OWN).render(content)
    except (jinja2.TemplateError, TypeError, ValueError, ArithmeticError, RecursionError) as error:
        raise InputError(
            "template",
            f"{path}: cannot be filled ({short(str(error), 200)})",
            remedy="mend it, or leave it out",
        ) from None


def _sandbox(sources: dict[str, str]) -> Sandbox:
    """Return the sandbox in which these templates are filled."""
    sandbox = Sandbox(
        loader=jinja2.DictLoader(sources), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    sandbox.filters = {name: sandbox.filters[name] for name in FILTERS}
    sandbox.filters["anchor"] = anchor
    sandbox.filters["digits"] = lambda value, form: format(value, number_format(form))
    sandbox.globals = {"number": _number}
    return sandbox


def anchor(title: str) -> str:
    """Return the link target of a heading."""
    return "".join(char if char.isalnum() else "-" for char in title.lower())


def _number(value: Any, error: Any = float("nan")) -> str:
    """Return a value with its error; empty if not known."""
    if isinstance(value, jinja2.Undefined):
        return ""
    return number(value, float("nan") if isinstance(error, jinja2.Undefined) else error)


def _refuse_program(template: jinja2.nodes.Template) -> None:
    """Raise InputError if a template contains a part that is not allowed."""
    for node, loops in _with_loops(template, 0):
        allowed = isinstance(node, PARTS) and loops <= MAX_LOOPS
        match node:
            case jinja2.nodes.For(recursive=True):
                allowed = False
            case jinja2.nodes.Extends(template=jinja2.nodes.Const(value=name)):
                allowed = name == PLAIN
            case jinja2.nodes.Extends():
                allowed = False
            case jinja2.nodes.Tuple():
                allowed = all(isinstance(item, jinja2.nodes.Name) for item in node.items)
                allowed = allowed and node.ctx == "store"
            case jinja2.nodes.Call():
                function = node.node
                known = isinstance(function, jinja2.nodes.Name) and function.name == "number"
                method = isinstance(function, jinja2.nodes.Getattr) and function.attr in OF_CASES
                allowed = known or method
        if not allowed:
            kind = type(node).__name__.lower()
            raise InputError(
                "template", f"line {node.lineno}", f"{kind} may not stand in a study's page"
            )


def _with_loops(node: jinja2.nodes.Node, loops: int) -> Iterator[tuple[jinja2.nodes.Node, int]]:
    """Yield each part of a template, and the number of loops around it."""
    loops += isinstance(node, jinja2.nodes.For)
    yield node, loops
    for child in node.iter_child_nodes():
        yield from _with_loops(child, loops)
