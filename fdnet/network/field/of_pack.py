"""The velocity field of a pack, from its spheres."""

from dataclasses import replace

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.field.field import VelocityField, on_grid, solved_field
from fdnet.network.field.lattice import build_lattice
from fdnet.network.field.solved import Skeleton, build_skeleton
from fdnet.spheres.directions import Directions, periodic_axes
from fdnet.spheres.snapshot import Kind, Snapshot

COARSEST, FINEST, AFFORDED = 10.0, 18.0, 1_000_000
"""Cells across a mean grain where none is given: as many between the first two as keep the grid
below the third number of cells (`fdnet study velocity-field`)."""
TOLERANCE = 0.05
"""Rms velocity left at the walls over the superficial velocity."""
UPSTREAM, DOWNSTREAM = 1.0, 0.5
"""Clear fluid before and beyond a specimen that is not periodic along x, in grain diameters."""


def velocity_field(
    grains: Snapshot,
    *,
    periodic: Directions = "",
    fines: Snapshot | None = None,
    cells: float | None = None,
    upstream: float | None = None,
    tolerance: float = TOLERANCE,
) -> VelocityField:
    """The velocity of a slow fluid in the pores of a pack, over the superficial one along x.

    Stokes flow is solved on a grid of `cells` cells across a mean grain. Fines are resolved as the
    grains are. The sides y and z that are not periodic are walls that hold the fluid. A specimen
    that is not periodic along x has clear fluid before and beyond it, which moves evenly.

    Args:
        grains: the skeleton, m; `box` is the specimen. Fines among them are the deposit where
            `fines` is not given.
        periodic: sides that repeat, letters such as "yz" or three truth values (x, y, z).
        fines: the deposit; its spheres of kind grain are ignored where it has any of kind fine.
        cells: across a mean grain diameter; without it 10 to 18, as a million cells allow.
        upstream: m of grid before the specimen; without it, a grain diameter more than the fines
            reach. Without meaning where x is periodic.
        tolerance: rms velocity over the superficial one that may be left at the walls.

    Raises:
        CaseError: there is no grain, or a value is outside its range.
        NetworkError: the box has no extent, or no grain reaches into the grid.
        FlowError: the iterations run out, as in a closed pore space.

    Examples:
        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((2, 2, 2)).reshape(3, -1).T + 0.5)
        >>> grains = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> field = fdnet.velocity_field(grains, periodic="xyz")
        >>> print(f"{field.at([[1e-3, 1e-3, 1e-3]])[0, 0]:.0f}")
        4
    """
    if not len(grains.grains()):
        raise CaseError("velocity field: no grain among the spheres, expected at least one")
    if not ((cells is None or 1.0 <= cells < np.inf) and 0.0 < tolerance < 1.0):
        raise CaseError(
            f"velocity field: {cells!r} cells across a grain and a tolerance of {tolerance!r}, "
            "expected at least 1 cell and a tolerance between 0 and 1"
        )
    deposit = _deposit(grains if fines is None else fines, fines is not None)
    skeleton = _skeleton(
        grains, periodic_axes(periodic), (cells, _upstream(grains, deposit, upstream))
    )
    return solved_field(skeleton, (deposit.position, deposit.radius), tolerance)


def _upstream(grains: Snapshot, deposit: Snapshot, wanted: float | None) -> float:
    """Metres of grid before the specimen."""
    if wanted is not None:
        return wanted
    reach = grains.box[0, 0] - (deposit.position[:, 0] - deposit.radius)
    clear = UPSTREAM * 2.0 * float(grains.grains().radius.mean())
    return clear + float(max(0.0, reach.max(initial=0.0)))


def _skeleton(
    spheres: Snapshot, sides: tuple[bool, bool, bool], grid: tuple[float | None, float]
) -> Skeleton:
    """The grains on a grid of so many cells across a grain and so many metres upstream."""
    grains, (cells, upstream) = spheres.grains(), grid
    diameter = 2.0 * float(grains.radius.mean())
    if cells is None:
        edges = np.ptp(spheres.box, axis=1)
        edges[0] += 0.0 if sides[0] else upstream + DOWNSTREAM * diameter
        affordable = diameter * (AFFORDED / np.prod(edges)) ** (1.0 / 3.0)
        cells = float(np.clip(affordable, COARSEST, FINEST))
    lattice = build_lattice(
        spheres.box,
        sides,
        spacing=diameter / cells,
        upstream=upstream,
        downstream=DOWNSTREAM * diameter,
    )
    kept = grains.where(on_grid(lattice, grains.position, grains.radius))
    return build_skeleton(lattice, (kept.position, kept.radius))


def _deposit(spheres: Snapshot, given: bool) -> Snapshot:
    """The spheres of kind fine; all of them where they were given as fines and none is."""
    fines = spheres.fines()
    if given and not len(fines):
        return replace(spheres, kind=np.full(len(spheres), Kind.FINE))
    return fines
