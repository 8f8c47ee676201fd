"""A study's YAML as plain data: texts, numbers, true and false, lists, and lines NAME: VALUE.

It may come from someone else, so what YAML can do beyond that is refused: tags that make objects, a
name that stands twice (the first would be lost), references that grow without end. Numbers are
decimal: 1e5 is one, 010 is ten, 1:30 is a text.
"""

import math
import re
from pathlib import Path
from typing import Any

import yaml

from analysis.expressions import short
from modal.tools.errors import InputError

MAX_BYTES = 1_000_000
"""Largest size of a file, bytes: the largest study of this project has 20 kB."""
MAX_PARTS = 100_000
"""Largest number of texts, numbers, lists and mappings of a file; those behind references are
counted each time."""
MAX_DEPTH = 20
"""Largest number of nested levels of lists and mappings; a study has 7."""
PREFIX = "tag:yaml.org,2002:"
WHOLE = re.compile(r"[+-]?\d{1,18}")
DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?")
NO_DECIMAL = {".inf": math.inf, "+.inf": math.inf, "-.inf": -math.inf, ".nan": math.nan}
SCALARS = {
    "bool": (r"true|True|TRUE|false|False|FALSE", "tTfF"),
    "int": (WHOLE.pattern, "+-0123456789"),
    "float": (rf"{DECIMAL.pattern}|[+-]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", "+-.0123456789"),
    "null": (r"~|null|Null|NULL|", "~nN\0"),
    "merge": (r"<<", "<"),
}
"""How a text that stands without quotes is read: its pattern, and its first characters."""


def read_yaml(path: Path) -> Any:
    """Return what a YAML file says; InputError, in one line, where it is none or says too much."""
    text = read_small(path)
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())
        raise InputError(
            "yaml", f"{path}: not YAML ({short(reason, 200)})", remedy="mend the line that it names"
        ) from None
    except (ValueError, RecursionError) as error:
        raise InputError("yaml", f"{path}: not YAML ({short(str(error))})") from None


def read_small(path: Path) -> str:
    """Return a text file of a study; InputError where it cannot be read, or is too large."""
    try:
        if not path.is_file():
            raise InputError(
                "no_file", f"{path}: cannot be read (no such file)", remedy="name a study's YAML"
            )
        if path.stat().st_size > MAX_BYTES:
            raise InputError(
                "size",
                f"{path}: more than {MAX_BYTES / 1e6:g} MB",
                remedy="a study's file is smaller",
            )
        return path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        reason = short(str(error))
        raise InputError(
            "no_file", f"{path}: cannot be read ({reason})", remedy="name a study's YAML"
        ) from None


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # PyYAML has no types
    """PyYAML's loader of plain data, with the limits above."""

    yaml_implicit_resolvers: dict[str, Any] = {}
    yaml_constructors = {
        f"{PREFIX}{kind}": yaml.SafeLoader.yaml_constructors[f"{PREFIX}{kind}"]
        for kind in ("map", "seq", "str", "bool", "null")
    } | {None: yaml.SafeLoader.yaml_constructors[None]}

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self.parts = 0
        self.depth = 0
        self.parts_of: dict[str, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Return the next part of the file, once it is counted."""
        event = self.peek_event()
        anchor = event.anchor
        if isinstance(event, yaml.AliasEvent):
            if anchor in self.anchors and anchor not in self.parts_of:
                raise yaml.composer.ComposerError(
                    None, None, f"{short(anchor)} refers to itself", event.start_mark
                )
            self.parts += self.parts_of.get(anchor, 0)
        before = self.parts
        self.parts += 1
        self.depth += 1
        if self.parts > MAX_PARTS or self.depth > MAX_DEPTH:
            raise yaml.composer.ComposerError(
                None,
                None,
                f"more than {MAX_PARTS} parts or {MAX_DEPTH} levels",
                event.start_mark,
            )
        node = super().compose_node(parent, index)
        self.depth -= 1
        if anchor is not None and not isinstance(event, yaml.AliasEvent):
            self.parts_of[anchor] = self.parts - before
        return node

    def compose_mapping_node(self, anchor: Any) -> Any:
        """Return lines NAME: VALUE, of which no two have one name."""
        node = super().compose_mapping_node(anchor)
        names = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag == f"{PREFIX}null":
                raise yaml.composer.ComposerError(
                    None, None, "a name is a text or a number", key.start_mark
                )
            name = key.value
            if key.tag in (f"{PREFIX}int", f"{PREFIX}float"):
                name = _decimal(key.value)
            if name in names:
                raise yaml.composer.ComposerError(
                    None, None, f"{short(key.value)} stands twice", key.start_mark
                )
            names.add(name)
        return node

    def construct_decimal(self, node: Any) -> int | float:
        """Return the number that a scalar of YAML states."""
        return _decimal(self.construct_scalar(node))


def _decimal(text: str) -> int | float:
    """Return a number from its text; ValueError where it is none."""
    if WHOLE.fullmatch(text):
        return int(text)
    if text.lower() in NO_DECIMAL:
        return NO_DECIMAL[text.lower()]
    if not DECIMAL.fullmatch(text):
        raise ValueError(f"{short(text)} is no number")
    return float(text)


for _kind, (_pattern, _first) in SCALARS.items():
    _Loader.add_implicit_resolver(
        f"{PREFIX}{_kind}",
        re.compile(f"(?:{_pattern})$"),
        [char.replace("\0", "") for char in _first],
    )
for _kind in ("int", "float"):
    _Loader.add_constructor(f"{PREFIX}{_kind}", _Loader.construct_decimal)
