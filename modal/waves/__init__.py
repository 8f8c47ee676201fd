"""Linear waves through a packing: their source, time steps, receivers and frequency response."""
