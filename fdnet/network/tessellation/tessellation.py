"""The tessellation of placed grains: tetrahedra that fill the box, and the facets they share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fdnet.errors import NetworkError
from fdnet.network.tessellation.delaunay import Tetrahedra, make_tetrahedra
from fdnet.network.tessellation.facets import Facets, share_facets
from fdnet.network.tessellation.placed_grains import PlacedGrains, place_grains
from fdnet.spheres.arrays import one_line
from fdnet.spheres.images import repeated
from fdnet.spheres.snapshot import Array, Snapshot

FIRST_MARGIN = 3.5
"""Images of grains are first made within this many radii of the largest grain of the box."""
ROUNDS = 8
UNMATCHED_FEW = 1e-5
"""Share of facets without partner that more images are not expected to help."""
UNMATCHED_SHARE = 1e-3
"""Share of facets without partner above which the tessellation is refused."""
LARGE_CELL = 200
"""Grains from which on a periodic cell is taken as it is."""
SIDES_OF_CELLS = (0.0, 3.0, 4.0, 5.0, 6.0)
"""Least sides of the cells that are tried, in sides of the cube that one grain has to itself."""
GRAINS_A_FLAW = 27
"""A repeated cell may have one facet without partner for so many grains."""
MOST_PERIODS, MOST_IMAGES, IMAGES_A_GRAIN = 64, 50_000, 30
"""Beyond these numbers grains or voids are far larger than the periodic sides, and Qhull would
take hours. (Dense packs need 1 to 2 periods, a unit cell 125 images.)"""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tessellation:
    """Tetrahedra (P) of placed grains and the facets (T) between them.

    Attributes:
        tetrahedra: the P unique tetrahedra.
        facets: the T facets that two tetrahedra share.
        box: (3, 2) m, lower and upper bound of the specimen.
        size: (3,) m, sides of the box.
        periodic: whether the sides x, y and z are periodic; the other faces are mirror planes.
        scale: m, mean radius of the grains.
    """

    tetrahedra: Tetrahedra
    facets: Facets
    box: Array
    size: Array
    periodic: tuple[bool, bool, bool]
    scale: float

    __repr__ = one_line


def tessellate(placed: PlacedGrains) -> Tessellation:
    """Unique tetrahedra of the grains in their box, and the facets they share.

    Images of grains are added until every sphere that must be empty lies within them and every
    facet has its partner. Both together mean that no tetrahedron is wrong or missing. A few facets
    of flat tetrahedra may keep no partner, because rounding splits them otherwise on the two sides
    of a period; more images do not help them, and they are counted.

    Raises NetworkError on coplanar grains, on voids larger than the images reach, on more than
    1e-3 of the facets without partner away from the mirrored faces, and when no facet is shared.
    """
    grains, periodic = placed.grains, placed.periodic
    count, size = len(grains), grains.box[:, 1] - grains.box[:, 0]
    margin = np.full(3, FIRST_MARGIN * float(grains.radius.max()))
    for _ in range(ROUNDS):
        margin = np.where(periodic, margin, np.minimum(margin, size))
        _refuse_crowd(count, np.where(periodic, margin, 0.0), size)
        widest = ~np.array(periodic) & (margin >= size)
        tetrahedra = make_tetrahedra(grains, periodic=periodic, margin=margin)
        needed = tetrahedra.margin
        empty = len(tetrahedra.vertex) > 0 and bool(np.all((margin >= needed) | widest))
        facets = share_facets(tetrahedra, grains.box, periodic=periodic) if empty else None
        if facets is not None and (
            facets.unmatched <= UNMATCHED_FEW * len(facets.pore) or widest.all()
        ):
            break
        margin = np.maximum(1.5 * margin, np.minimum(1.02 * needed, 4.0 * margin))
    if facets is None:
        raise NetworkError(
            f"tessellation of {count} grains: voids reach {needed.max():.3g} m beyond the box of "
            f"{size.tolist()} m, further than the images around it; give more grains or a smaller "
            "box"
        )
    _check_facets(facets, count)
    return Tessellation(
        tetrahedra=tetrahedra,
        facets=facets,
        box=grains.box,
        size=size,
        periodic=periodic,
        scale=placed.scale,
    )


def copies_of_cell(
    packs: Sequence[Snapshot], periodic: tuple[bool, bool, bool]
) -> tuple[int, int, int]:
    """How often a periodic cell is repeated along each axis, so that it can be tessellated.

    In a cell of a few grains images of one grain lie on one sphere, and a tessellation splits them
    in another way on the two sides of a period. The first of `packs` are the grains; the others
    share their cell and are repeated with them. One copy where a larger cell does not help.
    """
    count = len(packs[0])
    if not any(periodic) or not 0 < count < LARGE_CELL:
        return 1, 1, 1
    side = np.ptp(packs[0].box, axis=1)
    spacing = np.cbrt(np.prod(side) / count)
    for least in SIDES_OF_CELLS:
        wanted = np.where(periodic, np.maximum(np.ceil(least * spacing / side), 1.0), 1.0)
        if np.prod(wanted) * count > MOST_IMAGES / IMAGES_A_GRAIN:
            break
        times = int(wanted[0]), int(wanted[1]), int(wanted[2])
        if all(_tiles(repeated(pack, times), periodic) for pack in packs):
            return times
    return 1, 1, 1


def _tiles(grains: Snapshot, periodic: tuple[bool, bool, bool]) -> bool:
    """Whether the tetrahedra of the grains fill their box, next to all facets with a partner."""
    try:
        made = tessellate(place_grains(grains, periodic=periodic))
    except NetworkError:
        return False
    return made.facets.unmatched <= len(grains) // GRAINS_A_FLAW


def _refuse_crowd(count: int, margin: Array, size: Array) -> None:
    """Raise NetworkError when the images of `count` grains in `margin` (3,) m are too many."""
    images = count * float(np.prod(1.0 + 2.0 * margin / size))
    axis = int(np.argmax(margin / size))
    most = MOST_IMAGES + IMAGES_A_GRAIN * count
    if images > most or margin[axis] > MOST_PERIODS * size[axis]:
        raise NetworkError(
            f"tessellation of {count} grains: {images:.3g} images up to {margin[axis]:.3g} m "
            f"beyond the periodic side {'xyz'[axis]} of {size[axis]:.3g} m are needed, expected "
            f"at most {most} and {MOST_PERIODS} periods; grains or voids are far larger than the "
            "box (check units and box), or a periodic cell of few grains is to be repeated"
        )


def _check_facets(facets: Facets, count: int) -> None:
    """Raise NetworkError when the tetrahedra of `count` grains do not fill the box or touch."""
    if facets.unmatched > max(4, UNMATCHED_SHARE * len(facets.pore)):
        raise NetworkError(
            f"tessellation: {facets.unmatched} of {len(facets.pore)} facets have no partner; the "
            "grains do not tile the box, check the box and the periodic sides"
        )
    if not len(facets.pore):
        raise NetworkError(
            f"tessellation: no throat joins two pores of these {count} grains; the box is too "
            "narrow for its side walls, give more grains or periodic sides"
        )
