"""Check arguments of public functions: refuse a wrong type in one line with its name."""

import types
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from functools import cache, wraps
from inspect import signature
from numbers import Real
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from modal.tools.arrays import Floats
from modal.tools.errors import InputError
from modal.tools.units import plain_numbers

P = ParamSpec("P")
R = TypeVar("R")
NUMBER_TYPES = int, float, np.integer, np.floating
KIND_WORDS: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    bool: "True or False",
    str: "a text",
    Literal: "a text",
    Sequence: "a list",
    type(None): "None",
}
"""Words for kinds of arguments in messages; other kinds are called by the name of their class."""
MAKERS = {
    "Network": "modal.read makes one from a file",
    "Motion": "modal.waves.motions has Pulse, chirp, step, SampledMotion and read_motion",
}
"""Texts on how to make an argument of a class, by the name of the class."""
MAX_SHOWN_LENGTH = 60
"""Largest number of characters of a value that a message shows; a longer value is named by its
type."""
MAX_FREQUENCY_HZ = 1e30
"""Largest frequency: no body of a size that numbers hold vibrates so fast, and its powers are still
numbers."""


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Wrap a function so that arguments of another type than annotated raise InputError.

    Numbers of any type are converted to Python's own int and float, so that integers cannot
    overflow and other numbers are doubles.

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
        arguments = bound.arguments
        refuse_other_kinds(function, function.__name__, arguments)
        for name, kind in _kinds(function).items():
            if isinstance(arguments.get(name), NUMBER_TYPES):
                for number_type in (float, int):
                    if number_type in _alternatives(kind):
                        arguments[name] = number_type(arguments[name])
                        break
        return function(*bound.args, **bound.kwargs)

    return call


def refuse_other_kinds(owner: Callable[..., Any], name: str, values: Mapping[str, object]) -> None:
    """Raise InputError for the first of the `values` that its annotation does not allow.

    `owner` is a function, or a class whose fields are given; `name` begins the message.
    """
    kinds = _kinds(owner)
    for argument, value in values.items():
        kind = kinds.get(argument, Any)
        if _fits(value, kind):
            continue
        words = [_words(alternative) for alternative in _alternatives(kind)]
        shown = repr(value)
        if len(shown) >= MAX_SHOWN_LENGTH:
            shown = f"a {type(value).__name__}"
        remedies = [maker for cls, maker in MAKERS.items() if f"a {cls}" in words]
        raise InputError(
            "argument",
            f"{name}: {argument} is {shown}, not {' or '.join(words)}",
            remedy="; ".join(remedies),
        )


@cache
def _kinds(owner: Callable[..., Any]) -> dict[str, Any]:
    """Return the annotations of arguments by name; those of *args as sequences."""
    kinds = get_type_hints(owner)
    for name, parameter in signature(owner).parameters.items():
        if parameter.kind is parameter.VAR_POSITIONAL:
            kinds[name] = types.GenericAlias(Sequence, kinds[name])
    return kinds


def _alternatives(kind: Any) -> tuple[Any, ...]:
    """Return the members of a union; for another kind, this kind alone."""
    if get_origin(kind) in (Union, types.UnionType):
        return get_args(kind)
    return (kind,)


def _words(kind: Any) -> str:
    """Return a description of a kind of argument."""
    origin = get_origin(kind) or kind
    if origin is tuple:
        return f"{len(get_args(kind))} numbers"
    if origin in KIND_WORDS:
        return KIND_WORDS[origin]
    return f"a {kind.__name__}"


def _fits(value: object, kind: Any) -> bool:
    """Return whether a value is of a kind; kinds that are not classes allow every value.

    Any text is a Literal: the function refuses unknown words itself, and names those it knows.
    """
    alternatives = _alternatives(kind)
    if len(alternatives) > 1:
        return any(_fits(value, alternative) for alternative in alternatives)
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    if kind in (float, int):
        return _is_number(value, whole=kind is int)
    origin = get_origin(kind)
    if origin is Literal:
        return isinstance(value, str)
    if origin in (tuple, Sequence):
        member = float
        if origin is Sequence:
            member = get_args(kind)[0]
        if not isinstance(value, Collection) or isinstance(value, str | bytes):
            return False
        return all(_fits(item, member) for item in value)
    with suppress(TypeError):  # what is no class, or one without instances, allows everything
        return isinstance(value, kind)
    return True


def _is_number(value: object, *, whole: bool) -> bool:
    """Return whether a value is a number, or a `whole` number."""
    if not isinstance(value, Real) or isinstance(value, bool | np.bool_):
        return False
    return not whole or float(value).is_integer()


def frequencies(values: ArrayLike) -> Floats:
    """Return frequencies as an array, Hz.

    Raises InputError for values outside 0 to `MAX_FREQUENCY_HZ`.
    """
    values = plain_numbers(values, "frequency", "Hz")
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError) as error:
        raise InputError(
            "frequency", f"frequency is {values!r}, not numbers from 0 on", remedy="give Hz"
        ) from error
    is_wrong = ~((array >= 0) & (array <= MAX_FREQUENCY_HZ))
    if is_wrong.any():
        raise InputError(
            "frequency",
            f"{array[is_wrong][0]:g} Hz is no frequency",
            remedy=f"give a number from 0 to {MAX_FREQUENCY_HZ:g} Hz",
        )
    return array
