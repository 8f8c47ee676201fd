"""Tests of the lists of the mutation tests: each entry points to files and lines that exist."""

from tests.mutation.lists import find_stale_modules, find_stale_mutants


def test_modules_and_their_test_files_exist():
    assert find_stale_modules() == []


def test_equivalent_mutants_are_mutants_of_the_present_sources():
    assert [str(mutant) for mutant in find_stale_mutants()] == []
