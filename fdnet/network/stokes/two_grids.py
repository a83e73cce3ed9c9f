"""A permeability and its error from two grids whose cells are 1.5 times apart.

The scheme is of second order, and on packs without fines the extrapolation of that order is within
0.3 % (rms; docs/stokes.md). Between fines in contact the fluid is thinner than a cell, so on the
grids that can be afforded a deposit converges more slowly, with orders of 1.3 to 2. Its
permeability is therefore the mean of the extrapolations of order 1.5 and 2, and its error is their
difference.
"""

from dataclasses import dataclass

from fdnet.network.stokes.stokes import StokesFlow, extrapolate

ORDERS = (1.5, 2.0)
LEAST_ERROR = 3e-3
"""Relative error that is always left."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A permeability at zero spacing.

    Attributes:
        k: m2.
        error: share of k.
    """

    k: float
    error: float


def estimate(coarse: StokesFlow, fine: StokesFlow, *, with_fines: bool) -> Estimate:
    """The permeability at zero spacing. Raises CaseError as `extrapolate` does."""
    if not with_fines:
        end = extrapolate(coarse, fine)
        return Estimate(k=end.k, error=max(end.relative_error, LEAST_ERROR))
    low, high = (extrapolate(coarse, fine, order=order).k for order in ORDERS)
    k = 0.5 * (low + high)
    return Estimate(k=k, error=max(abs(high - low) / k, LEAST_ERROR))
