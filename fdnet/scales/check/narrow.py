"""By how much a specimen shows another permeability than the bulk, because it is narrow.

The values are those of the study `specimen-size` (docs/validation/specimen-size.md): cubes of
equal grains at a porosity of 0.40, the mean of 5 or 10 packs, against cubes of 16 grains with
periodic sides.
"""

import numpy as np

WIDTHS = (3.0, 4.0, 5.0, 6.0, 8.0, 11.0, 16.0)
"""Width over grain diameter."""
PERIODIC = (-0.366, -0.119, -0.066, -0.053, -0.039, -0.022)
"""Permeability over that of the bulk, less 1, with periodic sides; the widest is the bulk."""
WALLS = (-0.356, -0.267, -0.193, -0.197, -0.152, -0.117, -0.074)
"""The same with walls at the sides."""


def width_error(width: float, *, periodic: bool) -> float:
    """Expected permeability over that of the bulk, less 1, of a specimen.

    `width` is its narrower side over the mean diameter of the grains. Between the widths studied
    it is interpolated over the logarithm; beyond the widest it falls as one over the width.
    """
    errors = PERIODIC if periodic else WALLS
    widths = WIDTHS[: len(errors)]
    if width > widths[-1]:
        return errors[-1] * widths[-1] / width
    return float(np.interp(np.log(width), np.log(widths), errors))
