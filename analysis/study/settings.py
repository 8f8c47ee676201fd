"""Define what each setting of a study may be: one table of its words and ranges."""

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


class ContactModel:
    """Kind of a contact model that exists, with the numbers that it takes."""

    told = f"{', '.join(MODELS)}, with its numbers, as rough 1e-6"

    def holds(self, value: Any) -> bool:
        """Return whether a value names such a contact model."""
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
BETWEEN = Number(above=0, below=1)
COUNT = Number(least=1, most=1e8, whole=True)
PLAIN = "letters, digits and _ . - +, the first no . - or +"
FILE_NAME = Text(f"a name of {PLAIN}", r"\w[\w.+-]*", 150, refused="..")
"""Kind of the names of cases, tables, figures and studies: names of files contain them."""
PATH = Text("a path of letters, digits and _ . - + /", r"[\w./+][\w./+-]*|", 1000)
SENTENCE = Text()
EXPRESSION = Text("an expression of the cases' columns")
BAND = Several(Number(least=0), "two frequencies, Hz", 2, 2)
MADE = Several(Word(PRODUCTS), "kinds of product")
NUMBERED = Text(f"{PLAIN}, and one {{}} or {{:02d}}", r"[\w.+-]*(\{(:(0\d)?d?)?\})?[\w.+-]*", 100)
"""Names of cases by their number."""

CASE: dict[str, Kind] = {
    "kind": Word(("fcc", "random")),
    "friction": Number(least=0, most=1),
    "wave_friction": Number(least=0),
    "stress": POSITIVE,
    "width": POSITIVE,
    "spheres": COUNT,
    "layers": COUNT,
    "seed": Number(least=0, most=2**31 - 1, whole=True),
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
    "inertial_number": BETWEEN,
    "hot_stress": Number(least=100, most=1e8),
    "damping": BETWEEN,
    "residual": BETWEEN,
    "time_step_fraction": SHARE,
    "dilate": Number(least=0, most=0.1),
    "periodic": Truth(),
    "oedometric": Truth(),
    "stress_ratio": POSITIVE,
    "contact_model": ContactModel(),
    "sizes": Text("lognormal SPREAD, or two RATIO SHARE", rf"(lognormal|two {NUMBER}) {NUMBER}"),
    "densities": Either(POSITIVE, Text("several densities", rf"{NUMBER}( {NUMBER})*", 200)),
}
"""Settings of a case; stresses in Pa, the width in diameters, times in s, the amplitude in m."""
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
    "seed": CASE["seed"],
    "amplitude": POSITIVE,
    "lowest_modes": COUNT,
    "band": BAND,
    "make": Lines(known=dict.fromkeys(("fcc", "random"), MADE)),
    "forget": Truth(),
}
"""Settings of a study."""
TEXTS = Lines(SENTENCE)
NAMED = Lines(EXPRESSION)
ANY_NUMBER = Number(finite=False)
WITHIN = Either(Number(least=0), Text("a number, or as 2 %", rf"{NUMBER} %"))
RULE: dict[str, Kind] = {
    **dict.fromkeys(("select", "quantity", "x", "y"), EXPRESSION),
    **dict.fromkeys(("stated", "plateau", "unsettled"), SENTENCE),
    **dict.fromkeys(("value", "low", "high", "aim"), ANY_NUMBER),
    **dict.fromkeys(("complete", "grows"), Truth()),
    "errors": Number(least=0),
    "within": WITHIN,
    "also": Lines(WITHIN),
    "others": NAMED,
    "mention": Several(SENTENCE, "sentences"),
}
"""A target's rule, as `analysis.study.targets` follows it."""
VERDICT = dict.fromkeys(("near", "inside", "power", "apart"), Lines(known=RULE))
FIT: dict[str, Kind] = {
    **dict.fromkeys(("by", "over", "x"), SENTENCE),
    "select": EXPRESSION,
    "of": NAMED,
}
PARTS: dict[str, Lines] = {
    "tables": Lines(
        needed=("name", "title"),
        known={
            "name": FILE_NAME,
            "title": SENTENCE,
            "page": Truth(),
            "select": EXPRESSION,
            "require": EXPRESSION,
            "columns": NAMED,
            "means": Several(SENTENCE, "columns", 1),
            "limit": Lines(
                needed=("x", "own", "by"),
                known={"x": EXPRESSION, "own": Number(), "by": Several(SENTENCE, "columns", 1)},
            ),
            "laws": Lines(
                needed=("quantities", "fits"),
                known={"quantities": NAMED, "fits": Several(Lines(known=FIT), "fits")},
            ),
            "checks": Lines(
                needed=("names", "rows", "columns"),
                known={
                    "names": TEXTS,
                    "rows": Several(Lines(SENTENCE, needed=("title",)), "rows"),
                    "columns": Lines(Lines(known=VERDICT)),
                },
            ),
            "side_by_side": SENTENCE,
            "says": TEXTS,
        },
    ),
    "figures": Lines(
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
            "plot": Lines(
                needed=("x", "y", "by"),
                known={
                    "x": SENTENCE,
                    "y": Several(EXPRESSION, "quantities", 1, 12),
                    "by": SENTENCE,
                },
            ),
        },
    ),
    "targets": Lines(
        needed=("id", "stated", "rule"),
        known={
            **dict.fromkeys(("id", "stated", "rule", "calibrated"), SENTENCE),
            **VERDICT,
            "second": Lines(known={"rule": SENTENCE, **VERDICT}, needed=("rule",)),
        },
    ),
}
"""Parts of a study that are lists, and what each of their entries is."""
