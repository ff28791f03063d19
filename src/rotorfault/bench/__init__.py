"""Measurements of speed, as functions that return numbers."""
