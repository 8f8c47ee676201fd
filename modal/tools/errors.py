"""The error for what a user can mend."""


class InputError(ValueError):
    """A user's mistake; the message says in one line what is wrong, why, and what to do.

    The command line prints it and ends with status 2.

    Examples
    --------
    >>> import modal
    >>> try:
    ...     modal.fcc(cells=(2, 2, 0))
    ... except modal.InputError as error:
    ...     print(error)
    cells (2, 2, 0): give three whole numbers, along x and y, and layers
    """
