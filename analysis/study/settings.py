"""Define the allowed values of each setting of a study, in one table."""

import re
from dataclasses import replace
from functools import cache
from typing import Any

from analysis.case import KINDS as PRODUCTS
from analysis.study.kinds import (
    Anything,
    Either,
    Kind,
    Lines,
    Number,
    Several,
    Text,
    Truth,
    Word,
)
from modal.packing.contact_law import GLASS
from modal.packing.contact_models import MODELS, laws_of
from modal.tools.errors import InputError

NUMBER = r"\d+\.?\d*(?:e[+-]?\d+)?"
"""Pattern of a decimal number without sign."""


class ContactModel:
    """Kind of value that names an existing contact model, with its numbers."""

    description = f"{', '.join(MODELS)}, with its numbers, as rough 1e-6"

    def holds(self, value: Any) -> bool:
        """Return whether a value names an existing contact model, with its numbers."""
        return isinstance(value, str) and _is_model(value)


@cache
def _is_model(text: str) -> bool:
    """Return whether a text is the name of a contact model with its numbers."""
    if not re.fullmatch(rf"[a-z-]+( {NUMBER})*", text):
        return False
    try:
        laws_of(replace(GLASS, contact_model=text))
    except InputError:
        return False
    return True


POSITIVE = Number(above=0)
SHARE = Number(above=0, most=1)
"""A part of a whole, or the whole."""
PROPER_FRACTION = Number(above=0, below=1)
COUNT = Number(least=1, most=1e8, whole=True)
SEED = Number(least=0, most=2**31 - 1, whole=True)
ALLOWED_CHARACTERS = "letters, digits and _ . - +, the first no . - or +"
FILE_NAME = Text(f"a name of {ALLOWED_CHARACTERS}", r"\w[\w.+-]*", 150, refused="..")
"""Kind of the names of cases, tables, figures and studies: names of files contain them."""
PATH = Text("a path of letters, digits and _ . - + /", r"[\w./+][\w./+-]*|", 1000)
SENTENCE = Text()
EXPRESSION = Text("an expression of the cases' columns")
BAND = Several(Number(least=0), "two frequencies, Hz", 2, 2)
PRODUCT_KINDS = Several(Word(PRODUCTS), "kinds of product")
NUMBERED = Text(
    f"{ALLOWED_CHARACTERS}, and one {{}} or {{:02d}}",
    r"[\w.+-]*(\{(:(0\d)?d?)?\})?[\w.+-]*",
    100,
)
"""Pattern of the names of cases, with the place of their number."""

CASE: dict[str, Kind] = {
    "kind": Word(("fcc", "random")),
    "friction": Number(least=0, most=1),
    "wave_friction": Number(least=0),
    "stress": POSITIVE,
    "width": POSITIVE,
    "spheres": COUNT,
    "layers": COUNT,
    "seed": SEED,
    "amplitude": POSITIVE,
    "input_frequency": POSITIVE,
    "direction": Word(("x", "y", "z")),
    "fraction": SHARE,
    "passage": POSITIVE,
    "duration": POSITIVE,
    "interval": Number(least=0),
    "particles": Number(least=0, most=1, whole=True),
    "approach_rate": POSITIVE,
    "agitated_damping": Number(least=0, below=1),
    "inertial_number": PROPER_FRACTION,
    "hot_stress": Number(least=100, most=1e8),
    "damping": PROPER_FRACTION,
    "residual": PROPER_FRACTION,
    "time_step_fraction": SHARE,
    "dilate": Number(least=0, most=0.1),
    "periodic": Truth(),
    "oedometric": Truth(),
    "stress_ratio": POSITIVE,
    "contact_model": ContactModel(),
    "sizes": Text("lognormal SPREAD, or two RATIO SHARE", rf"(lognormal|two {NUMBER}) {NUMBER}"),
    "densities": Either(POSITIVE, Text("several densities", rf"{NUMBER}( {NUMBER})*", 200)),
}
"""Kinds of the settings of a case: stresses in Pa, the width in diameters, times in s, the
amplitude in m."""
STUDY: dict[str, Kind] = {
    "name": FILE_NAME,
    "title": Text("a title of one line", r"[^\n]*", 300),
    "names": NUMBERED,
    "samples": PATH,
    "groups": Several(Anything(), "groups"),
    "states": Several(POSITIVE, "stresses, Pa"),
    "measure": Several(Text("a quantity", r"\w+"), "quantities"),
    "tables": Several(Anything(), "tables"),
    "figures": Several(Anything(), "figures"),
    "headlines": Several(FILE_NAME, "cases"),
    "cases": Lines(Lines(Anything())),
    "bands": Lines(BAND),
    "prepare": Word(("yade", "modal")),
    "spheres": COUNT,
    "layers": COUNT,
    "seed": SEED,
    "amplitude": POSITIVE,
    "lowest_modes": COUNT,
    "band": BAND,
    "make": Lines(known={"fcc": PRODUCT_KINDS, "random": PRODUCT_KINDS}),
    "forget": Truth(),
}
"""Kinds of the settings of a study."""
SENTENCES = Lines(SENTENCE)
EXPRESSIONS = Lines(EXPRESSION)
ANY_NUMBER = Number(finite=False)
TOLERANCE = Either(Number(least=0), Text("a number, or as 2 %", rf"{NUMBER} %"))
"""Distance from a stated value, in its unit or in per cent of it."""
RULE: dict[str, Kind] = {
    "select": EXPRESSION,
    "quantity": EXPRESSION,
    "x": EXPRESSION,
    "y": EXPRESSION,
    "stated": SENTENCE,
    "plateau": SENTENCE,
    "unsettled": SENTENCE,
    "value": ANY_NUMBER,
    "low": ANY_NUMBER,
    "high": ANY_NUMBER,
    "aim": ANY_NUMBER,
    "complete": Truth(),
    "grows": Truth(),
    "errors": Number(least=0),
    "within": TOLERANCE,
    "also": Lines(TOLERANCE),
    "others": EXPRESSIONS,
    "mention": Several(SENTENCE, "sentences"),
}
"""Kinds of the settings of a target's rule, as `analysis.study.rules` applies it."""
RULES: dict[str, Kind] = {
    "near": Lines(known=RULE),
    "inside": Lines(known=RULE),
    "power": Lines(known=RULE),
    "apart": Lines(known=RULE),
}
"""Rules by their names."""
FIT: dict[str, Kind] = {
    "by": SENTENCE,
    "over": SENTENCE,
    "x": SENTENCE,
    "select": EXPRESSION,
    "of": EXPRESSIONS,
}
"""Kinds of the settings of a fit of powers."""
LIMIT = Lines(
    needed=("x", "own", "by"),
    known={"x": EXPRESSION, "own": Number(), "by": Several(SENTENCE, "columns", 1)},
)
"""Limit of means over cases as x goes to zero, by a straight line."""
LAWS = Lines(
    needed=("quantities", "fits"),
    known={"quantities": EXPRESSIONS, "fits": Several(Lines(known=FIT), "fits")},
)
"""Quantities that are fitted as powers of others."""
CHECKS = Lines(
    needed=("names", "rows", "columns"),
    known={
        "names": SENTENCES,
        "rows": Several(Lines(SENTENCE, needed=("title",)), "rows"),
        "columns": Lines(Lines(known=RULES)),
    },
)
"""A table of verdicts: each row applies the rules of all columns to its own quantities."""
PLOT = Lines(
    needed=("x", "y", "by"),
    known={"x": SENTENCE, "y": Several(EXPRESSION, "quantities", 1, 12), "by": SENTENCE},
)
"""Quantities over a column, a curve for each value of `by`."""
SECOND_RULE = Lines(known={"rule": SENTENCE, **RULES}, needed=("rule",))
TABLE = Lines(
    needed=("name", "title"),
    known={
        "name": FILE_NAME,
        "title": SENTENCE,
        "page": Truth(),
        "select": EXPRESSION,
        "require": EXPRESSION,
        "columns": EXPRESSIONS,
        "means": Several(SENTENCE, "columns", 1),
        "limit": LIMIT,
        "laws": LAWS,
        "checks": CHECKS,
        "side_by_side": SENTENCE,
        "quantities": SENTENCES,
        "says": SENTENCES,
    },
)
FIGURE = Lines(
    needed=("name", "caption"),
    known={
        "name": FILE_NAME,
        "figure": SENTENCE,
        "caption": SENTENCE,
        "cases": EXPRESSION,
        "columns": Number(least=1, most=3, whole=True),
        "height": Number(above=0, most=20),
        "like": Word(("x", "y", "xy", "columns")),
        "together": Truth(),
        "plot": PLOT,
        "picture": PATH,
        "alt": SENTENCE,
    },
)
TARGET = Lines(
    needed=("id", "stated", "rule"),
    known={
        "id": SENTENCE,
        "stated": SENTENCE,
        "rule": SENTENCE,
        "calibrated": SENTENCE,
        **RULES,
        "second": SECOND_RULE,
    },
)
PARTS: dict[str, Lines] = {"tables": TABLE, "figures": FIGURE, "targets": TARGET}
"""Kinds of the entries of those parts of a study that are lists."""
