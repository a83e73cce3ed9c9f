"""How much mud plugs a face, and how many fines are in the simulation until then."""

from fdnet.case.case import InvasionCase

PLUG_SOLIDS = 0.6
"""Volume of fines a unit of face, over the median diameter of the grains, that is ample to plug
it: the shipped specimens and the well took 0.1 to 0.25 until they did, and go on a plug time."""
TAKEN_SOLIDS = 0.25
"""The same, of what has come when the face plugs."""
FIRST_BATCHES = 0.3
"""Share of the slab that is there before it is needed, where it comes in batches."""


def supplied_solids(case: InvasionCase, slab: float) -> float:
    """Fines of a slab of `slab` m a unit of face, over the median diameter of the grains."""
    return slab * case.fines.placed_fraction / case.grains.curve.size_at(0.5)


def present_share(case: InvasionCase, *, duration: float, feeding: float) -> float:
    """Mean number of fines in the simulation over the number supplied.

    The slab arrives evenly over `feeding` s of a simulation of `duration` s, in batches that come
    ahead of what arrives.
    """
    if case.fines.supply == "slab":
        return 1.0
    full = (1 - FIRST_BATCHES) * feeding
    if duration <= full:
        return FIRST_BATCHES + 0.5 * (1 - FIRST_BATCHES) * duration / full
    return 1 - 0.5 * (1 - FIRST_BATCHES) * full / duration
