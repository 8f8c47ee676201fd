"""Packings at rest, before any wave: their numbers, whether they are settled, tables of them."""
