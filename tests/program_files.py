"""Packings written as other programs write them, sound and spoilt, and what `import` says."""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import packings
import pytest

import modal
from modal.__main__ import main
from modal.exchange.registry import import_packing
from modal.packing.network import Network, read_network
from modal.system.assembly import assembled
from modal.tools.errors import InputError

PAIR = "granular hertz/material 6e10 0 0.2 tangential mindlin/force NULL 0 0.3"
"""Young's modulus and Poisson's ratio of `packings.polydisperse`."""


def lines(rows: Iterable[Iterable[float]], digits: int = 17, by: str = " ") -> str:
    """Return a line of each row, with numbers of this many digits."""
    return "".join(by.join(f"{number:.{digits}g}" for number in row) + "\n" for row in rows)


def lammps(network: Network, folder: Path, digits: int = 17) -> tuple[Path, Path, Path]:
    """Write dump custom, dump local and log of a packing, with numbers of this many digits.

    Ids begin at 1, in falling order, so that a reader who takes rows for numbers is found out.
    """
    atoms = folder / "x.atoms"
    contacts = folder / "x.contacts"
    log = folder / "log.lammps"
    n = network.n_particles
    wall = network.with_wall
    walled = bool(wall.any())
    low = np.where(network.cell_periodic, 0.0, [0, 0, network.wall_position[0]])
    flags = " ".join("pp" if axis else "ff" for axis in network.cell_periodic)
    bounds = lines(zip(low, low + network.cell_size, strict=True))

    def head(what: str, count: int, item: str) -> str:
        title = f"ITEM: TIMESTEP\n7\nITEM: NUMBER OF {what}\n{count}\n"
        return f"{title}ITEM: BOX BOUNDS {flags}\n{bounds}ITEM: {item}\n"

    on_wall = np.zeros((n, 4))
    force = network.force_tangential - network.force_normal[:, None] * network.normal
    on_wall[network.particle_i[wall], 0] = 1
    on_wall[network.particle_i[wall], 1:] = force[wall]
    spheres = (network.position, network.radius, network.mass, on_wall[:, : 4 * walled])
    rows = np.column_stack([np.arange(1, n + 1), np.ones(n), *spheres])[::-1]
    columns = "id type x y z radius mass" + " f_w[1] f_w[2] f_w[3] f_w[4]" * walled
    atoms.write_text(head("ATOMS", n, f"ATOMS {columns}") + lines(rows, digits))
    i = network.particle_i[~wall]
    j = network.particle_j[~wall]
    fn = network.force_normal[~wall]
    forces = (fn, network.force_tangential[~wall], -fn[:, None] * network.normal[~wall])
    rows = np.column_stack([np.arange(len(i)) + 1, i + 1, j + 1, *forces])
    columns = "index c_p[1] c_p[2] " + " ".join(f"c_f[{k}]" for k in range(1, 8))
    contacts.write_text(head("ENTRIES", len(i), f"ENTRIES {columns}") + lines(rows, digits))
    low_wall, high_wall = network.wall_position
    log.write_text(
        "LAMMPS (22 Jul 2025)\nunits si # metres\npair_style ${STYLE}\npair_style granular\n"
        f"pair_coeff * * {PAIR.removeprefix('granular ')}\n"
        + f"fix w all wall/gran {PAIR} zplane {low_wall:.17g} {high_wall:.17g} contacts\n"
        * walled
        + "compute p all property/local patom1 patom2 cutoff &\nradius\n"
        "compute f all pair/local force p1 p2 p3 fx fy fz cutoff radius\n"
    )
    return atoms, contacts, log


ONE_SAFE_LINE = r"[^\x00-\x1f\x7f]{,700}\n"
"""A line of moderate length, without the bytes that a terminal obeys."""
COLUMN_PAIR = "granular hooke 1e5 0 tangential linear_history 8e4 0 0.5"
"""Springs of the column, N/m."""
COLUMN_WALL = f"{COLUMN_PAIR} zplane 0 2.99994"
"""The walls of the column: overlaps of 1e-5 m there and 2e-5 m between spheres."""


def column(
    folder: Path,
    *,
    bounds: tuple[str, str, str] = ("0 8", "0 8", "0 16"),
    x: float = 4.123,
    layout: str = ".16e",
    flags: str = "pp pp ff",
    step: int = 0,
    types: tuple[int, ...] = (1, 1, 1),
) -> Path:
    """Write a dump of three spheres of diameter 1 m and 1.3 kg above each other, without types if
    there are none."""
    rows = ""
    for k in range(3):
        height = 0.49999 + 0.99998 * k
        numbers = " ".join(format(number, layout) for number in (x, 4.123, height, 0.5, 1.3))
        kind = f"{types[k]} " if types else ""
        rows += f"{k + 1} {kind}{numbers}\n"
    path = folder / "x.dump"
    named = "type " if types else ""
    path.write_text(
        f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n3\nITEM: BOX BOUNDS {flags}\n"
        + "\n".join(bounds)
        + f"\nITEM: ATOMS id {named}x y z radius mass\n{rows}"
    )
    return path


def of_law() -> Network:
    """Import 60 spheres of radii 1:3 between walls, with shear forces and LAMMPS' law mindlin."""
    with tempfile.TemporaryDirectory() as folder:
        atoms, contacts, log = lammps(packings.polydisperse(False), Path(folder))
        log.write_text(log.read_text().replace("mindlin/force", "mindlin"))
        return modal.read(atoms, contacts=contacts, log=log)


def tables(network: Network, folder: Path) -> tuple[Path, Path]:
    """Write a packing as two tables with named columns, and contacts with their stiffnesses."""
    spheres = folder / "spheres.csv"
    contacts = folder / "contacts.csv"
    low = [0, 0, network.wall_position[0]]
    bounds = np.column_stack([low, low + network.cell_size]).ravel()
    axes = " ".join(axis for axis, on in zip("xyz", network.cell_periodic, strict=True) if on)
    text = f"# cell {lines([bounds])}# periodic {axes}\n"
    if not network.cell_periodic[2]:
        text += f"# walls {lines([network.wall_position])}"
    columns = (network.position, network.radius, network.mass)
    rows = np.column_stack([np.arange(network.n_particles) + 10, *columns])
    spheres.write_text(f"{text}id,x,y,z,radius,mass\n{lines(rows, by=',')}")
    j = network.particle_j
    columns = (network.stiffness_normal, network.stiffness_tangential, network.force_normal)
    ends = (network.particle_i + 10, np.where(j < 0, j, j + 10))
    rows = np.column_stack([*ends, *columns, network.force_tangential])
    contacts.write_text(f"i,j,kn,kt,fn,ftx,fty,ftz\n{lines(rows, by=',')}")
    return spheres, contacts


def sorted_ends(network: Network) -> np.ndarray:
    """Return the order of contacts by their ends, to compare two networks row by row."""
    return np.lexsort((network.particle_j, network.particle_i))


@dataclass
class PackingFiles:
    """The files of a packing, and what `import` says of them."""

    capsys: object
    spheres: Path
    options: dict[str, object]

    @property
    def out(self) -> Path:
        """Return the path of the network that `import` writes."""
        return self.spheres.parent / "out.network.h5"

    def __getattr__(self, name: str) -> Path:
        return self.options[name]

    def _import(self, more: dict[str, object]) -> tuple[int, str, str]:
        words = [str(self.spheres)]
        for name, value in (self.options | more).items():
            if value is not None:
                values = value if isinstance(value, tuple) else (value,)
                words += [f"--{name}", *map(str, values)]
        status = main(["import", *words, "-o", str(self.out), "--json"])
        return status, *self.capsys.readouterr()

    def imported(self, **more: object) -> dict:
        """Run `import` and return its JSON; an option that is None is left out."""
        status, out, err = self._import(more)
        assert status == 0, err
        return json.loads(out)

    def code(self, **more: object) -> str:
        """Return the code of the error with which the file is refused."""
        options = self.options | more
        with pytest.raises(InputError) as refused:
            import_packing(self.spheres, **options)
        assert "\n" not in str(refused.value)
        return refused.value.code

    def refused(self, code: str, *names: str, **more: object) -> None:
        """Check that `import` refuses with this code in one line, and writes nothing.

        `names` are what the line must name: file, line, column, numbers.
        """
        self.out.unlink(missing_ok=True)
        status, out, line = self._import(more)
        assert status == 2, line
        assert json.loads(out)["error"]["code"] == code, line
        assert re.fullmatch(ONE_SAFE_LINE, line), line
        for name in names:
            assert name in line
        assert not self.out.exists()

    def network(self, **more: object) -> Network:
        """Run `import` and return the network that it writes."""
        self.imported(**more)
        return read_network(self.out)

    def _path(self, name: str) -> Path:
        return self.spheres if name == "spheres" else self.options[name]

    def spoil(self, name: str, old: str, new: str, count: int = 1) -> None:
        """Replace a pattern in a file, where it must be."""
        path = self._path(name)
        text, count_replaced = re.subn(old, new, path.read_text(), count=count)
        assert count_replaced, (path.name, old)
        path.write_text(text)

    def rewrite(
        self,
        name: str,
        change: Callable[[list[str]], list[str]],
        first: int,
        end: int | None = None,
    ) -> None:
        """Change the words of each row below the `first` lines, down to the line `end`."""
        path = self._path(name)
        rows = slice(first, end)
        separator = "," if ".csv" in path.name else " "
        text = path.read_text().splitlines()
        text[rows] = [separator.join(change(line.split(separator))) for line in text[rows]]
        path.write_text("\n".join(text) + "\n")

    def respell(self, name: str, line: int, column: int | slice, words: object) -> None:
        """Write other words in a line, from 1, from this column, from 0, or over this slice."""

        def change(row: list[str]) -> list[str]:
            row[column] = words
            return row

        self.rewrite(name, change, line - 1, line)


WRITERS = {
    "lammps": (lammps, ("contacts", "log")),
    "tables": (tables, ("contacts",)),
}


def write_packing_files(
    capsys, folder: Path, program: str, packing: Network | bool = True, *more: object
) -> PackingFiles:
    """Write the files of a packing as a program does.

    True and False stand for spheres of radii 1:3, periodic in all directions or between walls.
    """
    write, names = WRITERS[program]
    if isinstance(packing, bool):
        packing = packings.polydisperse(packing)
    spheres, *other_paths = write(packing, folder, *more)
    return PackingFiles(capsys, spheres, dict(zip(names, other_paths, strict=True)))


def misfit(
    network: Network, expected: np.ndarray, columns: np.ndarray, terms: tuple[str, ...] = ()
) -> float:
    """Return the relative error of columns of K by these terms; rotations count as arcs of 1 mm."""
    arc = np.tile([1.0] * 3 + [1e3] * 3, network.n_particles)
    K = assembled(network, terms).tocsr()[:, columns].toarray()
    units = arc[:, None] * arc[columns]
    return float(np.linalg.norm(units * (K - expected)) / np.linalg.norm(units * expected))


def assert_same_contacts(
    network: Network, expected: Network, names: str, rtol: float = 0.0
) -> None:
    """Compare columns of contacts in any order; vectors to `rtol` of their mean size."""
    order = sorted_ends(network)
    expected_order = sorted_ends(expected)
    for name in names.split():
        column = getattr(network, name)[order]
        expected_column = getattr(expected, name)[expected_order]
        tolerance = 0.0
        if expected_column.ndim > 1:
            tolerance = rtol * abs(expected_column).mean()
        np.testing.assert_allclose(column, expected_column, rtol=rtol, atol=tolerance, err_msg=name)
