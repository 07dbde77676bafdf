"""Array types that signatures share."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Real: TypeAlias = NDArray[np.floating[Any]]
Mask: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]
Mesh: TypeAlias = tuple[Array, Indices]
"""Points, shape (points, 3), and triangles as indices of points, shape (triangles, 3)."""
