"""Arguments of public functions: one of a wrong kind is refused in one line that names it."""

import types
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from functools import cache, wraps
from inspect import signature
from numbers import Real
from typing import Any, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.units import plain_numbers

P = ParamSpec("P")
R = TypeVar("R")
NUMBERS = int, float, np.integer, np.floating
WORDS: dict[Any, str] = {
    **{float: "a number", int: "a whole number", bool: "True or False"},
    **{str: "a text", Sequence: "a list", type(None): "None"},
}
"""What a kind of argument is called; others by the name of their class."""
MAKES = {
    "Network": "; modal.read makes one from a file",
    "Motion": "; modal.waves.motions has Pulse, chirp, step, SampledMotion and read_motion",
}
"""What makes an argument of this class."""


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The function, which raises InputError where an argument is not of its annotated kind.

    Numbers of all kinds arrive as Python's own: whole ones do not overflow, others are doubles.

    >>> import modal
    >>> modal.eigenmodes("mine.network.h5")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    modal.tools.errors.InputError: eigenmodes: network is 'mine.network.h5', not a Network; ...
    """

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            bound = signature(function).bind(*args, **kwargs)
        except TypeError:  # missing or unknown: Python's own message names the function
            return function(*args, **kwargs)
        given = bound.arguments
        refuse_other_kinds(function, function.__name__, given)
        for name, kind in _kinds(function).items():
            number = given.get(name)
            if isinstance(number, NUMBERS) and (own := {int, float} & {*_alternatives(kind)}):
                given[name] = own.pop()(number)
        return function(*bound.args, **bound.kwargs)

    return call


def refuse_other_kinds(owner: Callable[..., Any], name: str, given: Mapping[str, object]) -> None:
    """InputError for the first of the `given` arguments that its owner's annotation does not allow.

    `owner` is a function, or a class whose fields are given; `name` begins the message.
    """
    kinds = _kinds(owner)
    for argument, value in given.items():
        kind = kinds.get(argument, Any)
        if not _fits(value, kind):
            wanted = " or ".join(_words(one) for one in _alternatives(kind))
            shown = repr(value) if len(repr(value)) < 60 else f"a {type(value).__name__}"
            made = "".join(text for cls, text in MAKES.items() if f"a {cls}" in wanted)
            message = f"{name}: {argument} is {shown}, not {wanted}{made}"
            raise InputError("argument", message)


@cache
def _kinds(owner: Callable[..., Any]) -> dict[str, Any]:
    kinds = get_type_hints(owner)
    for name, one in signature(owner).parameters.items():
        if one.kind is one.VAR_POSITIONAL:
            kinds[name] = types.GenericAlias(Sequence, kinds[name])
    return kinds


def _alternatives(kind: Any) -> tuple[Any, ...]:
    return get_args(kind) if get_origin(kind) in (Union, types.UnionType) else (kind,)


def _words(kind: Any) -> str:
    if get_origin(kind) is tuple:
        return f"{len(get_args(kind))} numbers"
    return WORDS.get(get_origin(kind) or kind) or f"a {kind.__name__}"


def _fits(value: object, kind: Any) -> bool:
    """Whether a value is of a kind; kinds that no class stands for allow everything."""
    parts = _alternatives(kind)
    if len(parts) > 1:
        return any(_fits(value, part) for part in parts)
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    if kind in (float, int):
        if not isinstance(value, Real) or isinstance(value, bool | np.bool_):
            return False
        return kind is float or float(value).is_integer()
    if get_origin(kind) in (tuple, Sequence):
        each = float if get_origin(kind) is tuple else get_args(kind)[0]
        text = isinstance(value, str | bytes)
        return isinstance(value, Collection) and not text and all(_fits(x, each) for x in value)
    with suppress(TypeError):  # what is no class, or none that can be asked, allows everything
        return isinstance(value, kind)
    return True


HIGHEST = 1e30
"""Hz: no body of a size that numbers hold vibrates so fast, and powers of it are numbers."""


def frequencies(given: ArrayLike) -> Floats:
    """The frequencies as an array, Hz; InputError where one is no number from 0 to `HIGHEST`."""
    given = plain_numbers(given, "frequency", "Hz")
    try:
        asked = np.asarray(given, float)
    except (TypeError, ValueError) as error:
        raise InputError(
            "input", f"frequency is {given!r}, not numbers from 0 on", remedy="give Hz"
        ) from error
    wrong = ~((asked >= 0) & (asked <= HIGHEST))
    if wrong.any():
        what = f"{asked[wrong][0]:g} Hz is no frequency"
        raise InputError("input", f"{what}", remedy=f"give a number from 0 to {HIGHEST:g} Hz")
    return asked
