"""Flights in the formats of other tools, a file for each."""
