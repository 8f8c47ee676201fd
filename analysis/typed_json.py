"""JSON of a file against the types of a class: one schema, which says where a file differs.

Numbers are finite or null, which is NaN; a name stands once. Errors name the place, as in
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
"""What is said of a kind that stands for itself."""
LARGEST_WHOLE = 1 << 53
"""Up to which doubles hold every whole number."""


class MismatchError(ValueError):
    """A value of another kind than its place has."""


def parsed(text: str) -> Any:
    """Return what a JSON text says; `MismatchError` for none, and for what JSON does not know."""
    try:
        return json.loads(text, object_pairs_hook=_named_once, parse_constant=_refuse_constant)
    except MismatchError:
        raise
    except (ValueError, RecursionError) as error:
        raise MismatchError(str(error)) from None


def read_text(path: str | Path) -> str:
    """Return the text of a file; InputError where it cannot be read, or is no text."""
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
    """Return what is said by name; `MismatchError` where a name comes twice."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise MismatchError(f"{twice} stands twice")
    return found


def _refuse_constant(word: str) -> None:
    raise MismatchError(f"{word} is no number of JSON; write null")


def checked(value: Any, kind: Any, place: str) -> Any:
    """Return a value of JSON as a value of this kind; `MismatchError` where it is none.

    Kinds are those of a class's fields: str, bool, int, float, arrays, lists, dictionaries of
    texts, tuples, and several of them, as in `int | None`.
    """
    if kind is Any:
        return value
    outer, inner = get_origin(kind), get_args(kind)
    if outer in (Union, types.UnionType):
        return _any_of(value, inner, place)
    if outer in (list, Sequence):
        return [
            checked(each, inner[0], f"{place}[{k}]") for k, each in enumerate(_list(value, place))
        ]
    if outer is dict:
        return by_name(value, inner[1], place)
    if outer is tuple:
        return _tuple(value, inner, place)
    if kind is np.ndarray or outer is np.ndarray:
        numbers = [_number(each, f"{place}[{k}]") for k, each in enumerate(_list(value, place))]
        return np.array(numbers, float)
    if kind is float:
        return _number(value, place)
    return _itself(value, kind, place)


def by_name(value: Any, kind: Any, place: str) -> dict[str, Any]:
    """Return a dictionary whose values are all of one kind."""
    if not isinstance(value, dict):
        raise MismatchError(f"{place} is no set of names and values")
    return {name: checked(each, kind, f"{place}.{name}") for name, each in value.items()}


def fields_of(value: Any, kinds: dict[str, Any], needed: set[str], place: str) -> dict[str, Any]:
    """Return what a JSON object says of these fields; those that are `needed` must be there."""
    if not isinstance(value, dict):
        raise MismatchError(f"{place or 'it'} is no set of names and values")
    for name in sorted(needed - value.keys()):
        raise MismatchError(f"{place}{'.' * bool(place)}{name} is missing")
    for name in value.keys() - kinds.keys():
        raise MismatchError(f"{place}{'.' * bool(place)}{name} is unknown")
    front = f"{place}." if place else ""
    return {name: checked(each, kinds[name], front + name) for name, each in value.items()}


def _any_of(value: Any, kinds: Sequence[Any], place: str) -> Any:
    """Return the value as the first kind that it is."""
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
    if not isinstance(value, list):
        raise MismatchError(f"{place} is no list")
    return value


def _tuple(value: Any, kinds: Sequence[Any], place: str) -> tuple[Any, ...]:
    """Return a list of so many, or of any number where the kinds end in three dots."""
    members = _list(value, place)
    wanted = list(kinds)
    if wanted[-1] is ...:
        wanted = [wanted[0]] * len(members)
    if len(members) != len(wanted):
        raise MismatchError(f"{place} has {len(members)} members, not {len(wanted)}")
    pairs = zip(members, wanted, strict=True)
    return tuple(checked(each, kind, f"{place}[{k}]") for k, (each, kind) in enumerate(pairs))


def _number(value: Any, place: str) -> float:
    """Return a number, whole ones that doubles hold as they are; NaN for null."""
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
    return value if abs(value) < LARGEST_WHOLE else number


def _itself(value: Any, kind: Any, place: str) -> Any:
    """Return a text, a whole number, or true or false."""
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise MismatchError(f"{place} is {_shown(value)}, not {KINDS[kind]}")
    if kind is str:
        try:
            value.encode()
        except UnicodeEncodeError:
            raise MismatchError(f"{place} has half a character") from None
    return value


def _shown(value: Any) -> str:
    """Return a value as a message says it, cut where it is long."""
    text = str(value)
    return text if len(text) <= 30 else f"{text[:30]}..."
