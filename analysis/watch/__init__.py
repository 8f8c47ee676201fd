"""A wave or modes to watch: one page with the packing in three dimensions, without a network."""
