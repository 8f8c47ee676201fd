"""Scripts that run inside YADE."""
