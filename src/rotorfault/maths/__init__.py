"""Numbers and values: scalars of any number type, vectors and rotations, records."""
