"""Types of arrays, and the names of the elements that vectors have in arrays and tables."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]

AXES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "yaw")
