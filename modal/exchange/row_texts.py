"""The texts of the rows of a table, as one text and the places where the rows end."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from modal.tools.arrays import Bools, Ints


@dataclass(frozen=True, eq=False)
class RowTexts(Sequence[str]):
    """The texts of n rows; a million of them as a list would take twice the memory of their text.

    Attributes
    ----------
    data : bytes
        The text in UTF-8; only the last row may lack a line feed.
    ends : ndarray (n,)
        Where each row ends, behind its line feed.
    """

    data: bytes
    ends: Ints

    def __len__(self) -> int:
        return len(self.ends)

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...

    def __getitem__(self, index: int | slice) -> str | Sequence[str]:
        rows = range(len(self))[index]
        if isinstance(rows, range):
            return [self[row] for row in rows]
        start = int(self.ends[rows - 1]) if rows else 0
        return self._text(start, int(self.ends[rows]))

    def __iter__(self) -> Iterator[str]:
        start = 0
        for end in self.ends.tolist():
            yield self._text(start, end)
            start = end

    def _text(self, start: int, end: int) -> str:
        return self.data[start:end].decode("utf-8", "replace")

    def without_blank_end(self) -> "RowTexts":
        """Return the rows without those at the end that have only blanks."""
        count = len(self)
        while count and not self[count - 1].strip():
            count -= 1
        ends = self.ends[:count]
        size = int(ends[-1]) if count else 0
        return RowTexts(self.data[:size], ends)

    def with_separators(self, separator: str, count: int) -> Bools:
        """Return which rows (n,) have at least this many separators."""
        places = np.flatnonzero(np.frombuffer(self.data, np.uint8) == ord(separator))
        return np.diff(np.searchsorted(places, self.ends), prepend=0) >= count
