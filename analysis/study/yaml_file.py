"""Read a study's YAML as plain data: texts, numbers, true, false, lists, named values.

A study's file may come from someone else. Other features of YAML are therefore refused: tags that
make objects, a name that occurs twice (its first value would be lost), references that multiply the
contents without limit. Numbers are decimal: 1e5 is a number, 010 is ten, 1:30 is a text.
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
MAX_NODES = 100_000
"""Largest number of nodes of a file: texts, numbers, lists and mappings. The nodes that a reference
stands for are counted at every reference."""
MAX_DEPTH = 20
"""Largest number of nested levels of lists and mappings; a study has 7."""
PREFIX = "tag:yaml.org,2002:"
"""Beginning of the names of YAML's own tags, such as tag:yaml.org,2002:int."""
WHOLE = re.compile(r"[+-]?\d{1,18}")
"""Pattern of a whole number, short enough for an integer of 64 bits."""
DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,4})?")
"""Pattern of a decimal number."""
NOT_FINITE = {".inf": math.inf, "+.inf": math.inf, "-.inf": -math.inf, ".nan": math.nan}
"""Numbers that are not finite, by their text in lower case."""
SCALARS = {
    "bool": (r"true|True|TRUE|false|False|FALSE", [*"tTfF"]),
    "int": (WHOLE.pattern, [*"+-0123456789"]),
    "float": (rf"{DECIMAL.pattern}|[+-]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", [*"+-.0123456789"]),
    "null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    "merge": (r"<<", ["<"]),
}
"""Types of a text without quotes, by the last word of their tag: the pattern that the text matches,
and the characters with which it may begin. An empty text, which is null, begins with none."""


def read_yaml(path: Path) -> Any:
    """Return the contents of a YAML file.

    Raises InputError if the file is not YAML, has a refused feature, or is too large.
    """
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
    """Return the text of a study's file; raise InputError if it is unreadable or too large."""
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
        self.nodes = 0
        self.depth = 0
        self.nodes_of_anchor: dict[str, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Return the next node of the file, and count it with all nodes that it contains."""
        event = self.peek_event()
        anchor = event.anchor
        is_reference = isinstance(event, yaml.AliasEvent)
        if is_reference:
            # An anchor whose nodes are not yet counted is still being read.
            if anchor in self.anchors and anchor not in self.nodes_of_anchor:
                raise _fault_at(event, f"{short(anchor)} refers to itself")
            self.nodes += self.nodes_of_anchor.get(anchor, 0)
        nodes_before = self.nodes
        self.nodes += 1
        self.depth += 1
        if self.nodes > MAX_NODES or self.depth > MAX_DEPTH:
            raise _fault_at(event, f"more than {MAX_NODES} parts or {MAX_DEPTH} levels")
        node = super().compose_node(parent, index)
        self.depth -= 1
        if anchor is not None and not is_reference:
            self.nodes_of_anchor[anchor] = self.nodes - nodes_before
        return node

    def compose_mapping_node(self, anchor: Any) -> Any:
        """Return a mapping; refuse a name that occurs twice or is neither text nor number."""
        node = super().compose_mapping_node(anchor)
        names = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag == f"{PREFIX}null":
                raise _fault_at(key, "a name is a text or a number")
            name = key.value
            if key.tag in (f"{PREFIX}int", f"{PREFIX}float"):
                name = _parse_number(key.value)
            if name in names:
                raise _fault_at(key, f"{short(key.value)} stands twice")
            names.add(name)
        return node

    def construct_decimal(self, node: Any) -> int | float:
        """Return the number that a scalar of YAML states."""
        return _parse_number(self.construct_scalar(node))


def _fault_at(place: Any, problem: str) -> yaml.composer.ComposerError:
    """Return the error that names a problem and the place, an event or a node, in the file."""
    return yaml.composer.ComposerError(None, None, problem, place.start_mark)


def _parse_number(text: str) -> int | float:
    """Return the number that a text states; raise ValueError if it is not a number."""
    if WHOLE.fullmatch(text):
        return int(text)
    if text.lower() in NOT_FINITE:
        return NOT_FINITE[text.lower()]
    if not DECIMAL.fullmatch(text):
        raise ValueError(f"{short(text)} is no number")
    return float(text)


for _type, (_pattern, _first_characters) in SCALARS.items():
    _Loader.add_implicit_resolver(
        f"{PREFIX}{_type}", re.compile(f"(?:{_pattern})$"), _first_characters
    )
for _type in ("int", "float"):
    _Loader.add_constructor(f"{PREFIX}{_type}", _Loader.construct_decimal)
