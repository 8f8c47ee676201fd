"""HDF5 files that are complete or absent, with checksums and provenance."""
