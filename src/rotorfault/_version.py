"""Version of rotorfault."""

__version__ = "0.2.0"
