"""Compute waves through a packing: sources, time steps, receivers, frequency response."""
