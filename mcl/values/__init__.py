"""The vocabulary: values that all other rooms pass to each other. No algorithm of the filter belongs here.

All of it is imported from this page: `from maurice_mcl.values import F64, Library, Moment`.

- `arrays`, `geometry`, `randomness`: kinds of arrays, poses in the plane, addressed random numbers
- `setting_rules`: what values a setting may have, as annotations of its field
- `laser`: a scan of a planar laser, and the map that it is compared with
- `map`, `session`, `library`: where the robot is, what it measured, the surveyed references, how near is near
- `nearest`: which places are nearest, and where tables of that are kept
- `plain`: results as plain values, which JSON has
- `pose_sensor`: the seam for sensors of other packages
- `records`: the values of one step
- `own_parts`: parts of a filter that users write, by name and hash of their source
"""

from __future__ import annotations

from .arrays import *
from .geometry import *
from .laser import *
from .library import *
from .map import *
from .nearest import *
from .own_parts import *
from .plain import *
from .pose_sensor import *
from .randomness import *
from .records import *
from .session import *
from .setting_rules import *
