"""The error for what a user can mend."""


class InputError(ValueError):
    """A user's mistake; the message says in one line what is wrong, why, and what to do."""
