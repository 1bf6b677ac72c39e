"""Array aliases, and the letters used for axes in every docstring.

N particles, L library entries, C channels, D descriptor length, M movements in one frame,
H x W picture rows and columns. A pose is (x_m, y_m, heading_rad), heading counter-clockwise from +x.
"""

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]
U8 = NDArray[np.uint8]
Bool = NDArray[np.bool_]
