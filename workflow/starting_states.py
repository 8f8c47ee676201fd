"""Find the states that random cases start from: their compression, or a committed sample."""

from functools import cache, cached_property
from pathlib import Path

import h5py
from commands import COLUMNS, Commands

from analysis.study.description import part_of_name


class StartingStates(Commands):
    """The states from which the cases of a study are made.

    A compression ("walk") of one friction passes through the states of all stresses. Its subclass
    `Jobs` sets the attributes.

    Attributes
    ----------
    from_scratch : bool
        Whether random cases start from a cloud, not from committed samples.
    """

    from_scratch: bool

    def cases_of_kind(self, kind: str) -> list[str]:
        """Return the names of all cases of a kind, fcc or random."""
        return self._cases_by_kind[kind]

    @cached_property
    def _cases_by_kind(self) -> dict[str, list[str]]:
        """Return the names of all cases of each kind."""
        return {
            kind: [name for name, row in self.rows.items() if row["kind"] == kind]
            for kind in ("fcc", "random")
        }

    def walk_of(self, case: str) -> str:
        """Return the name of the compression that passes through a random case's state."""
        row = self.rows[case]
        parts = [f"mu{row['mu_comp']:g}"]
        for column in self.varied_columns:
            if row.get(column) is not None:
                parts.append(part_of_name(column, row[column]))
        return "_".join(parts)

    @cached_property
    def varied_columns(self) -> list[str]:
        """Return the columns of which the study has several values, friction apart.

        They distinguish compressions of one friction. If cases are numbered there are no such
        columns: compressions differ only in friction.
        """
        if self.study.settings["names"] != "":
            return []
        rows = [self.rows[case] for case in self.cases_of_kind("random")]
        columns = (*COLUMNS["walk"][1:], *COLUMNS["pack"])
        return [name for name in columns if len({str(row.get(name)) for row in rows}) > 1]

    @cached_property
    def walks(self) -> dict[str, list[str]]:
        """Return the cases of each compression."""
        cases_by_walk: dict[str, list[str]] = {}
        for case in self.cases_of_kind("random"):
            cases_by_walk.setdefault(self.walk_of(case), []).append(case)
        return cases_by_walk

    @cached_property
    def stresses(self) -> list[float]:
        """Return the stresses, Pa, of the states of every compression."""
        of_cases = {float(self.rows[case]["stress"]) for case in self.cases_of_kind("random")}
        return sorted(of_cases | set(map(float, self.study.settings["states"])))

    def state(self, walk: str, stress: float) -> str:
        """Return the file of a state."""
        return f"{self.folder}/states/{walk}/{stress:g}Pa.sample.h5"

    def committed_sample(self, case: str) -> str | None:
        """Return the finished sample that a case starts from, if there is one.

        The result is None if the sample has another stress or friction, and for a case with its own
        state.
        """
        row = self.rows[case]
        folder = self.study.settings["samples"]
        path = Path(folder) / f"{case}.sample.h5"
        has_state = Path(self.state(self.walk_of(case), row["stress"])).exists()
        if self.from_scratch or has_state or not folder or not path.exists():
            return None
        for name in ("stress", "mu_comp"):
            if _noted(path, name) not in (None, float(row[name])):
                return None
        return str(path)

    def is_ready(self, case: str) -> bool:
        """Tell whether the finished sample is at rest with the friction of the wave."""
        path = self.committed_sample(case)
        friction = float(self.rows[case]["mu_wave"])
        return path is not None and _noted(Path(path), "mu_wave") in (None, friction)

    def starting_state(self, case: str) -> str:
        """Return the file that the sample of a random case is made from."""
        state = self.state(self.walk_of(case), float(self.rows[case]["stress"]))
        return self.committed_sample(case) or state

    def finished_state(self, walk: str, stress: float) -> str | None:
        """Return the finished sample of a state that is not a case; None if there is none."""
        path = Path(self.study.settings["samples"]) / f"{walk}_{stress / 1e3:g}kPa.sample.h5"
        if path.exists() and not self.from_scratch:
            return str(path)
        return None


@cache
def _noted(path: Path, name: str) -> float | None:
    """Return a number from the group `study` of a sample's file; None if it cannot be read."""
    try:
        with h5py.File(path) as file:
            return float(file["study"].attrs[name])
    except (OSError, KeyError, TypeError, ValueError):
        return None
