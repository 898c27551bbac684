"""Names for the arrays that everything here is made of."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Real numbers in float64; a public array of n slots is (rows, n), one row a quantity."""
Flags = NDArray[np.bool_]
"""True or false, one a slot."""
State = tuple[float, float, float, float]
"""h in m, theta in rad, h' in m/s, theta' in rad/s."""
