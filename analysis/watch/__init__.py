"""Make a page that shows a wave or modes of a packing in three dimensions, offline."""
