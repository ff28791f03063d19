"""Where the vehicle should be, as functions of time.

Importing the package registers every reference, so that the registry is complete.
"""

from rotorfault.reference.sources import REFERENCE, ReferenceSource, ReferenceTable

__all__ = ["REFERENCE", "ReferenceSource", "ReferenceTable"]
