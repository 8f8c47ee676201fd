"""Make text from files and names safe to show on a terminal."""

import unicodedata

HIDDEN_CATEGORIES = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Control characters, marks that change the order of letters, halves of characters, line ends:
a terminal acts on them, or shows another text than the one that is there."""


def visible(text: str, keep: str = "") -> str:
    r"""Return the text with every invisible or control character written as an escape.

    Characters in `keep` stay as they are.

    >>> visible("a\x1b[2Jb\nc"), visible("two\nlines", keep="\n")
    ('a\\x1b[2Jb\\nc', 'two\nlines')
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        letter if letter in keep or not is_hidden(letter) else escaped(letter) for letter in text
    )


def is_hidden(letter: str) -> bool:
    """Return whether a terminal would act on the character instead of showing it."""
    return unicodedata.category(letter) in HIDDEN_CATEGORIES


def escaped(letter: str) -> str:
    r"""Return the character as Python writes it in a text, such as \n, \x1b or \u202e."""
    return letter.encode("unicode_escape", "backslashreplace").decode("ascii")
