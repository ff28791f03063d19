"""Version of rotorfault."""

__version__ = "0.1.0"
