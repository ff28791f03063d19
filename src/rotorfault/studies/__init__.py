"""Studies: many flights for one question."""
