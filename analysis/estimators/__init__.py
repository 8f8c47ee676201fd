"""Compute numbers from signals, modes and networks: one module for each rule, without files."""
