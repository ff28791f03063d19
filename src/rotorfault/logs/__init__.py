"""Flight logs: readers, one common record, and what they say of the rotors."""
