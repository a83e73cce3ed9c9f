"""The slab of suspension that is supplied: how many fines, how long, how often one arrives."""

from dataclasses import dataclass

from fdnet.case.case import InvasionCase


@dataclass(frozen=True, slots=True, kw_only=True)
class Slab:
    """The suspension upstream of the formation face.

    Attributes:
        count: number of fines in it.
        length: m, along the flow; never shorter than the largest fine.
    """

    count: int
    length: float


def slab_of(case: InvasionCase) -> Slab:
    """Number of fines n and length l of the slab, n v = c A l.

    v is the mean volume of a fine, c the share by volume of the fines that are placed, A the
    cross-section of the box. A case gives either n or l.
    """
    fines = case.fines
    area, volume = case.size_m[1] * case.size_m[2], fines.mean_volume_m3
    least = 2 * fines.radius_range_m[1]
    if fines.count is not None:
        length = max(fines.count * volume / (fines.placed_fraction * area), least)
        return Slab(count=fines.count, length=length)
    length = max(fines.slab_m or 0.0, least)
    return Slab(count=max(1, round(fines.placed_fraction * area * length / volume)), length=length)


def arrival_time(case: InvasionCase, upstream: float) -> float:
    """Mean time between two fines that arrive at the face, v / (c A u), s; u = `upstream` m/s."""
    return case.fines.mean_volume_m3 / (
        case.fines.placed_fraction * case.size_m[1] * case.size_m[2] * upstream
    )


def slab_warnings(case: InvasionCase, slab: Slab) -> list[str]:
    """The slab was lengthened to the largest fine; empty when it was not."""
    diameter = 2 * case.fines.radius_range_m[1]
    if slab.length > diameter:
        return []
    return [
        f"the slab is lengthened to one fine's diameter, {1e3 * diameter:.3g} mm, so it is "
        "thinner than fines.concentration"
    ]
