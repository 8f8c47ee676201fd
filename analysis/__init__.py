"""Measure, compare, draw: reads network, signal and mode files and says whether they agree."""
