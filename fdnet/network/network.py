"""The network of a grain pack: one pore in each tetrahedron, one throat per shared facet."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np

from fdnet.errors import NetworkError
from fdnet.network.compiled import say_compiling
from fdnet.network.tessellation.delaunay import place_grains
from fdnet.network.tessellation.facets import join_polyhedra, tessellate
from fdnet.network.tessellation.pores import LENGTH_FLOOR, measure_pores, measure_throats
from fdnet.spheres.snapshot import Array, Directions, Kind, Snapshot, sides_of

__all__ = ["LENGTH_FLOOR", "WALLS", "Network", "build_network"]

WALLS = ("slip", "no-slip")
"""What the side walls do to the fluid: let it slip along them, or hold it."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Network:
    """Pores (P) and throats (T) of a pack of grains, SI units; x is the axis of the flow.

    The grains and their images beyond the faces of the box are the M points on which the
    tetrahedra stand. A pore that mirrored faces cut lies on these faces and describes the whole
    tetrahedron, the mirrored part included.

    Attributes:
        box: (3, 2) m, lower and upper bound of the specimen.
        periodic: whether the sides x, y and z are periodic; the other faces are mirror planes.
        walls: "slip" or "no-slip": what the y and z faces that are not periodic do to the fluid.
        grain_radius: m, mean.
        area: m2, cross-section of the box.
        image_grain: (M,) index of the grain.
        image_fine: (M,) whether the image is one of a fine (`Snapshot.kind`), where grains and
            fines are tessellated alike, or of a grain with its centre inside another one.
        image_position: (M, 3) m.
        image_radius: (M,) m.
        image_own_radius: (M,) m, of the grain itself where the image is a half sphere that stands
            for the cap of a grain centred beyond an x face; else the radius.
        image_outward: (M,) m, from the place of such an image along x to the centre of its grain,
            which lies beyond the face; 0 for all others.
        pore_images: (P, 4) images at the corners of the tetrahedron.
        pore_wrap: (P, 3) whole periods by which these images lie beyond the place of the pore.
        pore_position: (P, 3) m, centre of the sphere that touches the four grains; the centroid
            where that centre is outside the tetrahedron (Shi 2011, section 3.1.2).
        pore_radius: (P,) m, radius of that sphere; 0 where the grains close the pore.
        pore_power_centre: (P, 3) m, vertex of the power tessellation, for equal grains the
            circumcentre.
        pore_tetra_volume: (P,) m3, volume of the tetrahedron.
        pore_volume: (P,) m3, void in the tetrahedron.
        pore_wall_surface: (P,) m2, grain surface in the tetrahedron.
        pore_group: (P,) number of the polyhedron; pores of one power centre are parts of one
            polyhedron (the cell of a lattice, a prism cut by a face) which the tessellation
            splits arbitrarily, so they have one place and one pressure.
        pore_share: (P,) part of the tetrahedron inside the box, 1/2 for each face that cuts it.
        throat_pores: (T, 2) indices of the two pores that a throat joins.
        throat_shift: (T, 3) whole periods from the position of the second pore to its place next
            to the first.
        throat_images: (T, 3) images at the corners of the facet.
        throat_share: (T,) part of the section inside the box, 1/2 for each side wall in which
            both pores lie.
        throat_heights: (T, 2) m, distances of the two power centres from the facet, positive on
            their own side of it.
        throat_radius: (T,) m, radius of the inscribed circle; 0 where grains close the facet.
        throat_radius_effective: (T,) m, radius of the circle of equal area, sqrt(area / pi).
        throat_area: (T,) m2, open area of the facet.
        throat_length: (T,) m, between the positions of the pores, at least 1e-3 mean grain radii.
        counts: how many grains, pores and throats were closed, shortened, left out or replaced.
    """

    box: Array
    periodic: tuple[bool, bool, bool]
    grain_radius: float
    area: float
    image_grain: Array
    image_fine: Array
    image_position: Array
    image_radius: Array
    image_own_radius: Array
    image_outward: Array
    pore_images: Array
    pore_wrap: Array
    pore_position: Array
    pore_radius: Array
    pore_power_centre: Array
    pore_tetra_volume: Array
    pore_volume: Array
    pore_wall_surface: Array
    pore_group: Array
    pore_share: Array
    throat_pores: Array
    throat_shift: Array
    throat_images: Array
    throat_share: Array
    throat_heights: Array
    throat_radius: Array
    throat_radius_effective: Array
    throat_area: Array
    throat_length: Array
    counts: Mapping[str, int]
    walls: str = "slip"

    def __repr__(self) -> str:
        size = " x ".join(f"{1e3 * side:.4g}" for side in np.ptp(self.box, axis=1))
        sides = "".join(axis for axis, on in zip("xyz", self.periodic, strict=True) if on)
        return (
            f"Network({len(self.pore_radius)} pores, {len(self.throat_radius)} throats, "
            f"box {size} mm, periodic {sides or 'nowhere'}, walls {self.walls})"
        )

    @property
    def pore_grains(self) -> Array:
        """Indices (P, 4) of the grains at the corners."""
        return self.image_grain[self.pore_images]

    @property
    def pore_corner(self) -> Array:
        """Corners (P, 4, 3) m of the tetrahedron at the place of the pore."""
        return (
            self.image_position[self.pore_images]
            - (self.pore_wrap * np.ptp(self.box, axis=1))[:, None]
        )

    @property
    def pore_corner_radius(self) -> Array:
        """Radii (P, 4) m of the grains at the corners."""
        return self.image_radius[self.pore_images]

    @property
    def throat_grains(self) -> Array:
        """Indices (T, 3) of the grains at the corners of the facet."""
        return self.image_grain[self.throat_images]

    @property
    def throat_corner(self) -> Array:
        """Corners (T, 3, 3) m of the facet at the place of the first pore."""
        return self.corners_of(slice(None))

    def corners_of(self, throats: Array | slice) -> Array:
        """Corners (K, 3, 3) m of the facets of some `throats`, as in `throat_corner`."""
        wrap = self.pore_wrap[self.throat_pores[throats, 0]] * np.ptp(self.box, axis=1)
        return self.image_position[self.throat_images[throats]] - wrap[:, None]

    @property
    def throat_ends(self) -> Array:
        """Places (T, 2, 3) m of the first pore and of the second next to it."""
        ends = self.pore_position[self.throat_pores]
        ends[:, 1] += self.throat_shift * np.ptp(self.box, axis=1)
        return ends


def build_network(
    grains: Snapshot, *, periodic: Directions | None = None, walls: str = "no-slip"
) -> Network:
    """The network of pores and throats between grains (Shi 2011, section 3.2.1).

    Periodic sides join. The other faces are mirror planes: with `walls` "slip" the specimen is one
    half, fourth or eighth of the periodic specimen that its mirror images make up; with "no-slip"
    the y and z faces also hold the fluid, for the laws that account for it (`lubrication`).
    Unequal grains are tessellated by their power tessellation. Grains that do not reach into the
    box are left out and counted (`counts`), as are those that lie wholly inside another one.

    Args:
        grains: the spheres that carry the skeleton, m; those of the kind fine are taken as grains
            are, and marked (`image_fine`).
        periodic: the sides that are periodic, letters such as "yz" or three truth values;
            without it those that the file of the grains gives, else none.
        walls: "no-slip", the default as in `analyse`, or "slip".

    Raises:
        NetworkError: unknown walls, impossible lengths, too few or coplanar grains, facets without
            partner, or no throat. A periodic cell that is too small is to be repeated, as
            `analyse` does.

    Examples:
        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        >>> grains = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> network = fdnet.build_network(grains, periodic="yz")
        >>> print(f"widest pore {1e3 * network.pore_radius.max():.3f} mm")
        widest pore 0.366 mm
    """
    if walls not in WALLS:
        raise NetworkError(f"walls: {walls!r} is not known; choose one of {list(WALLS)}")
    sides = sides_of(grains, periodic)
    placed = place_grains(grains, periodic=sides)
    tessellation = tessellate(placed)
    say_compiling()  # only now, so that a pack that is refused has one line
    polyhedra = join_polyhedra(tessellation)
    pores, pore_counts = measure_pores(tessellation, polyhedra)
    throats, throat_counts = measure_throats(tessellation, polyhedra, pores)
    points = tessellation.tetrahedra.points
    outward = placed.outward[points.owner]
    beyond_low = points.position[:, 0] < tessellation.box[0].mean()
    network = Network(
        box=tessellation.box,
        periodic=tessellation.periodic,
        walls=walls,
        grain_radius=tessellation.scale,
        area=float(tessellation.size[1] * tessellation.size[2]),
        image_grain=placed.index[points.owner],
        image_fine=((placed.grains.kind == Kind.FINE) | placed.inside)[points.owner],
        image_position=points.position,
        image_radius=points.radius,
        image_own_radius=placed.own_radius[points.owner],
        image_outward=np.where(beyond_low, -outward, outward),
        counts={
            "grains_outside_box": len(grains) - len(placed.index) - placed.dropped,
            "grains_inside_others": placed.dropped,
            "grains_centred_in_others": int(placed.inside.sum()),
            "grains_centred_beyond_walls": placed.beyond,
            "grains_hidden": tessellation.tetrahedra.hidden,
            **pore_counts,
            **throat_counts,
        },
        **pores,
        **throats,
    )
    for field in fields(network):
        value = getattr(network, field.name)
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return network
