"""Name cases: the names they may have, as patterns for Snakemake, and those that are requested."""

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from commands import FURTHER, OF_NETWORK, RULES

from analysis.expressions import short
from modal.tools.errors import InputError

PLAIN_PATH = re.compile(r"[\w./+][\w./+-]*", re.ASCII)
"""Pattern of the paths that rules, commands and Snakemake's patterns can contain as they are."""
WORDS_BEHIND_NAMES = {
    *(kind.split(".")[0] for kinds in RULES["stages"].values() for kind in kinds),
    *(kind.split(".")[0] for rule in OF_NETWORK.values() for kind in rule["makes"]),
    *(*FURTHER, "network", "agreement", "json", "log", "tsv"),
}
"""Words that follow the name of a case in the names of its files."""
RESERVED_END = rf"\.({'|'.join(map(re.escape, sorted(WORDS_BEHIND_NAMES)))})|\dPa"
"""Pattern of ends of names that belong to files of cases, or to states."""
ANY = "[^/]+"
"""Pattern of the name of any case: no name with a reserved end."""
ANY += "".join(rf"(?<!\.{re.escape(word)})" for word in sorted(WORDS_BEHIND_NAMES))
ANY += r"(?<!\dPa)"
NOTHING = "(?!)"
"""Pattern that matches nothing."""


def pattern_of_cases(cases: Iterable[str], all_cases: Collection[str]) -> str:
    """Return a regular expression of the names of some of all cases.

    Snakemake matches it with each file name. To keep it short, it lists the excluded cases if more
    than half of all cases are included.
    """
    wanted = set(cases)
    others = [case for case in all_cases if case not in wanted]
    if not wanted:
        return NOTHING
    if not others:
        return ANY
    if len(wanted) <= len(others):
        return one_of(case for case in all_cases if case in wanted)
    behind = "|".join(map(re.escape, sorted(WORDS_BEHIND_NAMES)))
    return rf"(?!({one_of(others)})\.({behind})\b){ANY}"


def one_of(names: Iterable[str]) -> str:
    """Return the pattern of a wildcard that is one of these names."""
    return "|".join(map(re.escape, names)) or NOTHING


def refuse_reserved_name(case: str) -> None:
    """Raise InputError for a case whose name ends as the name of a case's file does."""
    if re.search(rf"({RESERVED_END})$", case):
        raise InputError("name", f"case {case}", "ends as a file of a case", "rename it")


def refuse_other_path(name: str, path: object) -> None:
    """Raise InputError for a path with characters that rules and commands cannot contain."""
    if not (isinstance(path, str) and PLAIN_PATH.fullmatch(path)):
        raise InputError(
            "path", f"{name} {short(path)}", remedy="give a path of letters, digits and _ . - + /"
        )


def choose_cases(words: Any, rows: Mapping[str, Any]) -> list[str]:
    """Return cases by name, number or kind; without words, all. InputError for an unknown word."""
    cases_by_word: dict[str, list[str]] = {"all": list(rows)}
    for name, row in rows.items():
        for word in dict.fromkeys((name, str(row["case"]), row["kind"])):
            cases_by_word.setdefault(word, []).append(name)
    chosen: dict[str, None] = {}
    for word in words or ["all"]:
        cases = cases_by_word.get(str(word)) or cases_by_word.get(str(word).lstrip("0"))
        if not cases:
            names = list(rows)
            raise InputError(
                "unknown_case",
                f"case {short(word)}",
                f"none of the study's: {names[0]} to {names[-1]}",
            )
        chosen |= dict.fromkeys(cases)
    return list(chosen)
