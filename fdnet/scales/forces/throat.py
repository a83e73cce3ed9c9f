"""Drag on a sphere between the walls of a throat: on the axis of a straight tube.

The problem is that of W. L. Haberman and R. M. Sayre, David Taylor Model Basin Report 1143 (1958).
Their approximate formula is up to 1.3 % too low at a ratio of 0.5 and 13 % at 0.7. The values here
are solved anew by boundary collocation (tests/forces/test_throat.py does it again) and agree with
the formula where that is good. All factors are over 6 pi mu a V.
"""

import math

import numpy as np

from fdnet.errors import CaseError

SOLVED = (
    (0.0, 1.0, 1.0),
    (0.1, 1.254795, 1.263214),
    (0.2, 1.634786, 1.679479),
    (0.3, 2.228977, 2.370095),
    (0.4, 3.215737, 3.591373),
    (0.5, 4.995339, 5.947374),
    (0.6, 8.613007, 11.091897),
    (0.7, 17.474034, 24.675984),
    (0.8, 47.620235, 74.669966),
    (0.9, 266.433063, 469.224391),
)
"""Diameter of the sphere over that of the tube; force on a sphere at rest, V the velocity of the
undisturbed flow on the axis; force on a sphere that moves with V through a liquid at rest."""
MOST_RATIO = SOLVED[-1][0]
"""Ratio of diameters up to which the factors are known."""
_GAP_POWER = 2.5
"""Both factors grow with this power of 1 / (1 - ratio) in a narrow gap."""


def held_factor(ratio: float) -> float:
    """Force of the flow on a sphere at rest on the axis over 6 pi mu a V, V the axis velocity.

    `ratio` is that of the diameters of sphere and tube. Raises CaseError outside of 0 to
    `MOST_RATIO`.
    """
    return _factor(ratio, 1)


def moving_factor(ratio: float) -> float:
    """Drag on a sphere that moves along the axis through a liquid at rest, over 6 pi mu a V.

    Arguments and errors are those of `held_factor`.
    """
    return _factor(ratio, 2)


def free_speed(ratio: float) -> float:
    """Speed of a sphere that the flow carries freely along the axis, over the axis velocity.

    Arguments and errors are those of `held_factor`.
    """
    return held_factor(ratio) / moving_factor(ratio)


def _factor(ratio: float, column: int) -> float:
    """By a cubic spline of the logarithm of K (1 - ratio)^2.5, exact to 3e-5."""
    from scipy.interpolate import CubicSpline

    if not 0 <= ratio <= MOST_RATIO:
        raise CaseError(
            f"walls of a throat: a sphere of {ratio:.4g} of its diameter, expected 0 to "
            f"{MOST_RATIO:g}; a wider one closes the throat"
        )
    table = np.array(SOLVED)
    smooth = np.log(table[:, column]) + _GAP_POWER * np.log1p(-table[:, 0])
    return math.exp(float(CubicSpline(table[:, 0], smooth)(ratio))) / (1 - ratio) ** _GAP_POWER


def throat_width(porosity: float, permeability: float) -> float:
    """Diameter, m, of straight tubes with the pack's porosity and permeability, sqrt(32 k / phi).

    By Poiseuille's law. It stands for the median throat: in packs of equal grains of 0.5 mm at a
    porosity of 0.40 it is 0.141 mm, and the median of the throats' inscribed circles 0.157 mm.
    """
    return math.sqrt(32 * permeability / porosity)
