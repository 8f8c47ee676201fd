"""Compare refusals by their codes."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from modal.tools.errors import InputError


@contextmanager
def refusal(code: str | None, name: str = "") -> Iterator[pytest.ExceptionInfo[InputError]]:
    """Find an InputError with this code, in one line which has the `name` or number.

    `None` stands for any code.
    """
    with pytest.raises(InputError) as raised:
        yield raised
    error = raised.value
    assert code is None or error.code == code, (error.code, str(error))
    assert name in str(error) and "\n" not in str(error), str(error)
