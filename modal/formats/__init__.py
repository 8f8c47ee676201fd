"""HDF5 files that are whole or absent, with checksums, and what a file was made from."""
