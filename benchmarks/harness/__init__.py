"""Shared parts of the benchmarks: measured tasks, tables, diagrams, and other programs."""
