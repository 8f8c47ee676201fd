"""Check the JSON of a file against the types of a class, and say where it differs.

Numbers are finite, or null, which stands for NaN; no name comes twice. Errors name the place, as in
`values.v_p.error`.
"""

import json
import math
import types
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Union, get_args, get_origin

import numpy as np

from modal.tools.errors import InputError

KINDS = {str: "a text", bool: "true or false", int: "a whole number"}
"""Names of the types of values, for error messages."""
MAX_WHOLE_NUMBER_OF_DOUBLES = 1 << 53
"""Whole number up to which doubles represent every whole number."""
MAX_SHOWN_LENGTH = 30
"""Number of characters at which a value is cut in an error message."""


class MismatchError(ValueError):
    """Raised for a value of another type than its place in the file requires."""


def parsed(text: str) -> Any:
    """Return the contents of a JSON text; `MismatchError` if it is not JSON."""
    try:
        return json.loads(text, object_pairs_hook=_named_once, parse_constant=_refuse_constant)
    except MismatchError:
        raise
    except (ValueError, RecursionError) as error:
        raise MismatchError(str(error)) from None


def read_text(path: str | Path) -> str:
    """Return the text of a file; InputError if it cannot be read as text."""
    try:
        return Path(path).read_text("utf-8")
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            "no_file", f"{path}: cannot be read ({reason})", remedy="check the name"
        ) from error
    except UnicodeDecodeError as error:
        raise InputError("no_text", f"{path}: no text", remedy="make it again") from error


def _named_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return values by name; `MismatchError` if a name comes twice."""
    values: dict[str, Any] = {}
    for name, value in pairs:
        if name in values:
            raise MismatchError(f"{name} stands twice")
        values[name] = value
    return values


def _refuse_constant(word: str) -> None:
    """Refuse NaN and infinities, which JSON does not know."""
    raise MismatchError(f"{word} is no number of JSON; write null")


def checked(value: Any, kind: Any, place: str) -> Any:
    """Return a value of JSON converted to a kind; `MismatchError` if it is of another kind.

    Kinds are those of a class's fields: str, bool, int, float, arrays, lists, dictionaries of
    texts, tuples, and several of them, as in `int | None`.
    """
    if kind is Any:
        return value
    outer = get_origin(kind)
    inner = get_args(kind)
    if outer in (Union, types.UnionType):
        return _any_of(value, inner, place)
    if outer in (list, Sequence):
        return _checked_members(_list(value, place), inner[0], place)
    if outer is dict:
        return by_name(value, inner[1], place)
    if outer is tuple:
        return _tuple(value, inner, place)
    if kind is np.ndarray or outer is np.ndarray:
        return np.array(_checked_members(_list(value, place), float, place), float)
    if kind is float:
        return _number(value, place)
    return _itself(value, kind, place)


def _checked_members(members: list[Any], kind: Any, place: str) -> list[Any]:
    """Return the members of a list, each checked to be of a kind; `place` is for errors."""
    return [checked(member, kind, f"{place}[{row}]") for row, member in enumerate(members)]


def by_name(value: Any, kind: Any, place: str) -> dict[str, Any]:
    """Return a dictionary whose values are all of one kind."""
    if not isinstance(value, dict):
        raise MismatchError(f"{place} is no set of names and values")
    return {name: checked(each, kind, f"{place}.{name}") for name, each in value.items()}


def fields_of(value: Any, kinds: dict[str, Any], needed: set[str], place: str) -> dict[str, Any]:
    """Return the fields of a JSON object by their kinds.

    Raises `MismatchError` if a `needed` field is missing, and for an unknown field.
    """
    if not isinstance(value, dict):
        raise MismatchError(f"{place or 'it'} is no set of names and values")
    prefix = ""
    if place:
        prefix = f"{place}."
    for name in sorted(needed - value.keys()):
        raise MismatchError(f"{prefix}{name} is missing")
    for name in value.keys() - kinds.keys():
        raise MismatchError(f"{prefix}{name} is unknown")
    return {name: checked(each, kinds[name], prefix + name) for name, each in value.items()}


def _any_of(value: Any, kinds: Sequence[Any], place: str) -> Any:
    """Return the value as one of the first kind that fits."""
    for kind in kinds:
        if kind is type(None):
            if value is None:
                return None
            continue
        try:
            return checked(value, kind, place)
        except MismatchError as error:
            last = error
    raise last


def _list(value: Any, place: str) -> list[Any]:
    """Return a list; `MismatchError` for any other value."""
    if not isinstance(value, list):
        raise MismatchError(f"{place} is no list")
    return value


def _tuple(value: Any, kinds: Sequence[Any], place: str) -> tuple[Any, ...]:
    """Return a list as a tuple with one member of each kind; of any length if they end in `...`."""
    members = _list(value, place)
    wanted = list(kinds)
    if wanted[-1] is ...:
        wanted = [wanted[0]] * len(members)
    if len(members) != len(wanted):
        raise MismatchError(f"{place} has {len(members)} members, not {len(wanted)}")
    pairs = zip(members, wanted, strict=True)
    return tuple(checked(each, kind, f"{place}[{k}]") for k, (each, kind) in enumerate(pairs))


def _number(value: Any, place: str) -> float:
    """Return a number, NaN for null; an integer that a float can represent stays an integer."""
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MismatchError(f"{place} is {_shown(value)}, no number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise MismatchError(f"{place} is {_shown(value)}, larger than numbers are")
    return value if abs(value) < MAX_WHOLE_NUMBER_OF_DOUBLES else number


def _itself(value: Any, kind: Any, place: str) -> Any:
    """Return the value itself if it is a text, a whole number, or true or false."""
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise MismatchError(f"{place} is {_shown(value)}, not {KINDS[kind]}")
    if kind is str:
        try:
            value.encode()
        except UnicodeEncodeError:
            raise MismatchError(f"{place} has half a character") from None
    return value


def _shown(value: Any) -> str:
    """Return a value as text for an error message, cut if it is long."""
    text = str(value)
    if len(text) <= MAX_SHOWN_LENGTH:
        return text
    return f"{text[:MAX_SHOWN_LENGTH]}..."
