"""A flight as data: everything that defines it, checked once."""
