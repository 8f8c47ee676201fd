"""A wave or modes to watch: one page with the packing in three dimensions, without a network."""

from analysis.watch.page import watch_page

__all__ = ["watch_page"]
