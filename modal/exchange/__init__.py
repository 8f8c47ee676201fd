"""Other programs' files: packings that come in, pictures that go out."""
