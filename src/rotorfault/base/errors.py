"""The one exception that is meant for users."""

from __future__ import annotations


class InputError(ValueError):
    """Something that the user gave cannot be used.

    The message says what came, what is allowed and how to mend it, with file and key where there are any. The
    command line prints it alone and exits with code 2.
    """
