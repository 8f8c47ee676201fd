"""Mutants of files, by a random generator: JSON, the CSV of a figure, the structure of HDF5.

By hand, many of them: `python tests/fuzz.py KIND COUNT [SEED]`, which prints how they ended.
"""

import json
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from modal.tools.errors import InputError

ODD = (
    *(None, True, False, 0, -1, 3, 1e308, 2**70, 0.5, -7.5, float("nan"), float("inf")),
    *("", "much", "\x1b[2J", "\ud800", "a\0b", "$x$", r"$\frac{$", "None", "1e5", "x" * 2000),
    *([], [[]], [1], [None], {}, {"": 1}, {"a": {"b": []}}, [[1], [1, 2]], ["a", 1]),
)
"""Values in place of others."""


def odd(random: np.random.Generator) -> Any:
    """Return one of the odd values."""
    return ODD[int(random.integers(len(ODD)))]


def mangled_tree(tree: Any, random: np.random.Generator) -> Any:
    """Return a copy of a JSON tree with one value replaced, removed, repeated or renamed."""
    tree = json.loads(json.dumps(tree))
    node: Any = tree
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        if not keys:
            return tree
        key = keys[int(random.integers(len(keys)))]
        inner = node[key]
        if not (isinstance(inner, dict | list) and len(inner) and random.random() < 0.7):
            break
        node = inner
    change = int(random.integers(4))
    if change == 0:
        node.pop(key)
    elif change == 1 and isinstance(node, dict):
        node[str(odd(random))] = node.pop(key)
    elif change == 1:
        node.insert(key, node[key])
    else:
        node[key] = odd(random)
    return tree


def mangled_text(text: str, random: np.random.Generator) -> str:
    """Return a copy of a text with a line removed, repeated, cut, or a few letters replaced."""
    lines = text.splitlines(keepends=True)
    index = int(random.integers(len(lines)))
    line = lines[index]
    change = int(random.integers(5))
    if change == 0:
        lines.pop(index)
    elif change == 1:
        lines.insert(int(random.integers(len(lines))), line)
    elif change == 2:
        lines[index] = line[: int(random.integers(len(line)))] + "\n"
    else:
        place = int(random.integers(len(line)))
        word = ("-", "9", ",", '"', "{", "\0", "nan", "inf", "1e400", "$", "\x1b", "\ufeff")
        lines[index] = (
            line[:place] + word[int(random.integers(len(word)))] + line[place + change - 3 :]
        )
    return "".join(lines)


def mangled_figure(text: str, random: np.random.Generator) -> str:
    """Return a copy of a figure's CSV, in half of the cases with a mangled head of JSON."""
    lines = text.splitlines(keepends=True)
    heads = [k for k, line in enumerate(lines) if line.startswith("# ")]
    if random.random() < 0.5 or not heads:
        return mangled_text(text, random)
    index = heads[int(random.integers(len(heads)))]
    lines[index] = f"# {json.dumps(mangled_tree(json.loads(lines[index][2:]), random))}\n"
    return "".join(lines)


def mangle_h5(path: Path, random: np.random.Generator) -> None:
    """Change the structure of an HDF5 file once: an attribute, a dataset, a link."""
    with h5py.File(path, "r+", libver="latest") as file:
        names: list[str] = []
        file.visit(names.append)
        name = names[int(random.integers(len(names)))]
        nodes = [file, file[name]]
        change = int(random.integers(6))
        if change < 3:
            _mangle_attribute(nodes[int(random.integers(2))], random)
        elif change == 3:
            del file[name]
        else:
            old = file[name]
            data = old[()] if isinstance(old, h5py.Dataset) else np.zeros(3)
            del file[name]
            _put_odd(file, name, np.asarray(data), random)


def _mangle_attribute(node: Any, random: np.random.Generator) -> None:
    """Change, add or remove an attribute."""
    names = [*node.attrs, "units", "UNIT", "stress", "seed", "scale_factor", "_FillValue"]
    name = names[int(random.integers(len(names)))]
    values = [
        *(h5py.Empty("f8"), node.ref, np.zeros(2, "f8,i4"), np.bytes_(b"m"), b"\xff\xfe"),
        *(np.nan, np.inf, -1, 0, 1e308, 2**62, True, "", "mm", "m", "\x1b[2J", "much", "[1", "[]"),
        *([1.0, 2.0], ["a", "b"], np.zeros((2, 2)), '{"a": 1}', "[" * 100_000, '[{"role": 1}]'),
    ]
    node.attrs.pop(name, None)
    k = int(random.integers(len(values) + 1))
    if k < len(values):
        node.attrs[name] = values[k]


def _put_odd(file: h5py.File, name: str, data: np.ndarray, random: np.random.Generator) -> None:
    """Put something else in the place of a dataset."""
    makers: list[Callable[[], Any]] = [
        lambda: data[:-1] if data.ndim else data,
        lambda: np.concatenate([data, data]) if data.ndim else data,
        lambda: data[..., None],
        lambda: data.astype("f4"),
        lambda: data.astype(">i2", casting="unsafe"),
        lambda: data.astype(complex),
        lambda: data * np.nan,
        lambda: data * 0,
        lambda: -1.0 * data,
        lambda: data.astype("S"),
        lambda: h5py.Empty("f8"),
        lambda: h5py.SoftLink("/nowhere"),
        lambda: h5py.SoftLink(f"/{name}"),
        lambda: h5py.ExternalLink("other.h5", "/x"),
        lambda: file["/"],
        lambda: np.dtype("f8"),
        lambda: np.zeros(len(data) if data.ndim else 1, "f8,i4"),
        lambda: "text",
    ]
    k = int(random.integers(len(makers) + 2))
    if k < len(makers):
        with np.errstate(all="ignore"):
            file[name] = makers[k]()
    elif k == len(makers):
        file.create_dataset(name, shape=data.shape, dtype="f8", chunks=bool(data.ndim) or None)
    else:
        file.create_dataset(name, shape=(2**40,), dtype="f8", chunks=(2**20,), compression=1)


def ended(work: Callable[[], object]) -> str:
    """Return how work ended: "read", "refused", or the last line of a traceback."""
    try:
        work()
    except InputError as error:
        text = str(error)
        return "refused" if text.isprintable() else f"control characters: {text!r}"
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return f"{type(error).__name__} at {Path(last.filename).name}:{last.lineno}: {error}"[:150]
    return "read"


def run_by_hand() -> None:
    """Print how this many mutants of a kind ended."""
    from test_fuzzed_files import KINDS

    kind = sys.argv[1]
    count = int(sys.argv[2])
    seed = int((*sys.argv[3:], 1)[0])
    with tempfile.TemporaryDirectory() as folder:
        work = KINDS[kind](Path(folder))
        endings = Counter(work(np.random.default_rng([seed, k])) for k in range(count))
    for ending, number in endings.most_common():
        print(number, ending)


if __name__ == "__main__":
    run_by_hand()
