"""Drag on a sphere in a crowd of others: Beetstra, van der Hoef and Kuipers.

Monodisperse law F(phi, Re): R. Beetstra, M. A. van der Hoef, J. A. M. Kuipers, AIChE J. 53 (2007)
489-501, from lattice-Boltzmann flow through random arrays of spheres (solid fractions 0.1 to 0.6,
Reynolds numbers up to 1000). Mixtures: the same authors, Chem. Eng. Sci. 62 (2007) 246-255, and
van der Hoef, Beetstra and Kuipers, J. Fluid Mech. 528 (2005) 233-254.

In their papers F is the drag without the force of the pressure gradient ("model A"), over Stokes's
drag 3 pi mu d U at the superficial velocity U = phi u of the slip u. The total force of the fluid
is F / phi: with it a bed of solid fraction s obeys Carman and Kozeny's law, 10 s / phi^3. Here the
porosity is phi, and every factor is over Stokes's drag 6 pi mu r u at the interstitial slip u. So

- the drag part is phi Y F where V (-grad p) acts as a force of its own,
- the total force, where no gradient acts apart, is Y F,

with the size factor Y, which is 1 for spheres of one size.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdnet.errors import CaseError

Array = NDArray[np.float64]
CUBIC_TERM = 0.064
"""Coefficient of the published third term of the size factor, a fit to mixtures."""
MOST_REYNOLDS = 1000.0
"""Reynolds number (superficial slip, Sauter mean diameter) up to which the law was fitted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Crowd:
    """What surrounds a sphere. Each value is a number or an array (N,) with one entry a sphere.

    Attributes:
        porosity: volume fraction of the fluid around it, above 0 and at most 1.
        size_ratio: its diameter over the Sauter mean diameter of all spheres around it.
        reynolds: rho_f phi |u - v| d / mu with the slip u - v and the Sauter mean diameter d.
    """

    porosity: Array | float
    size_ratio: Array | float = 1.0
    reynolds: Array | float = 0.0


def bed_factor(porosity: Array | float, reynolds: Array | float = 0.0) -> Array:
    """F of spheres of one size: drag without the gradient's force over 3 pi mu d U.

    F = 10 s / phi^2 + phi^2 (1 + 1.5 sqrt(s))
      + 0.413 Re / (24 phi^2) (1/phi + 3 s phi + 8.4 Re^-0.343) / (1 + 10^(3 s) Re^-(1 + 4 s)/2),
    phi the porosity, s = 1 - phi (Beetstra and others 2007, AIChE J. 53, 489). F is 1 for a lone
    sphere that creeps. Raises CaseError for a porosity outside of (0, 1] or a Reynolds number
    below 0 or above `MOST_REYNOLDS`.
    """
    phi, moving = np.asarray(porosity, float), np.asarray(reynolds, float)
    _refuse_outside(phi, moving)
    solid = 1 - phi
    creeping = 10 * solid / phi**2 + phi**2 * (1 + 1.5 * np.sqrt(solid))
    speed = np.where(moving > 0, moving, 1.0)
    shape = 1 / phi + 3 * solid * phi + 8.4 * speed**-0.343
    damped = 1 + 10 ** (3 * solid) * speed ** (-(1 + 4 * solid) / 2)
    return creeping + np.where(moving > 0, 0.413 * moving / (24 * phi**2) * shape / damped, 0.0)


def _refuse_outside(porosity: Array, reynolds: Array) -> None:
    for name, value, good, expected in (
        ("porosity", porosity, (porosity > 0) & (porosity <= 1), "above 0 and at most 1"),
        (
            "Reynolds number",
            reynolds,
            (reynolds >= 0) & (reynolds <= MOST_REYNOLDS),
            f"0 to {MOST_REYNOLDS:g}, the range of the law",
        ),
    ):
        if not np.all(good):
            raise CaseError(
                f"drag in a crowd: {name} {value[~good].flat[0]:.4g}, expected {expected}; take "
                "another law of drag"
            )


def size_factor(
    porosity: Array | float, size_ratio: Array | float, *, cubic: float = 0.0
) -> Array:
    """Y = phi y + (1 - phi) y^2 + c phi y^3 of a sphere of size ratio y in a mixture.

    The first two terms are derived (van der Hoef and others 2005): summed over any mixture they
    give the pressure drop of the bed of the Sauter mean diameter. The published law adds a fitted
    term with c = `CUBIC_TERM`. It breaks that sum, and for a lone sphere, by 6.4 %; c is 0 here
    unless it is given.
    """
    phi, ratio = np.asarray(porosity, float), np.asarray(size_ratio, float)
    return np.asarray(phi * ratio + (1 - phi) * ratio**2 + cubic * phi * ratio**3)


def drag_factor(crowd: Crowd, *, gradient_apart: bool) -> Array:
    """Drag coefficient C over that of a lone sphere, 6 pi mu r, for the force C (u - v).

    u is the interstitial velocity of the fluid at the sphere.

    Args:
        crowd: what surrounds each sphere.
        gradient_apart: True where V (-grad p) acts on the sphere as a force of its own (model A);
            False where this force is all that the fluid does to it.

    Returns:
        The factor, (N,); 1 for a lone sphere that creeps. Raises CaseError as `bed_factor` does.
    """
    total = size_factor(crowd.porosity, crowd.size_ratio) * bed_factor(
        crowd.porosity, crowd.reynolds
    )
    return total * np.asarray(crowd.porosity, float) if gradient_apart else total
