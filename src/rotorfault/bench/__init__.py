"""Measurements of speed and accuracy on the user's machine."""
