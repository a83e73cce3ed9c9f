"""The network of pores and throats of a grain pack: one pore per tetrahedron, one throat per shared facet."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fdnet.errors import NetworkError
from fdnet.network.tessellation.delaunay import Tetrahedra, check_lengths
from fdnet.network.tessellation.facets import (
    Facets,
    Polyhedra,
    facet_vertices,
    make_polyhedra,
    tessellate,
)
from fdnet.network.tessellation.pierced import pierced_facets
from fdnet.network.tessellation.pores import Centres, pore_centres, pore_solids
from fdnet.network.tessellation.throats import (
    LENGTH_FLOOR,
    throat_lengths,
    throat_sections,
    throat_shares,
    without_end_faces,
)
from fdnet.network.tessellation.walls import onto_walls, reaching
from fdnet.spheres.snapshot import Array, Snapshot

__all__ = ["LENGTH_FLOOR", "WALLS", "Network", "build_network"]

WALLS = ("slip", "no-slip")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Network:
    """Pores (P) and throats (T) of a pack of grains; lengths m, areas m2, volumes m3. x is the flow axis.

    `box` (3, 2); `periodic` (3,): the other faces are mirror planes, at the sides with `walls` "slip" or "no-slip".
    `grain_radius` mean; `area` the box's cross-section. `image_grain` (M,) index, `image_position` (M, 3),
    `image_radius` (M,) of the grains and their images; `pore_images` (P, 4), `throat_images` (T, 3) which of them are
    at the corners, `pore_wrap` (P, 3) periods by which these lie beyond the place of the pore.
    A pore cut by mirrored faces lies on them and describes the whole mirrored tetrahedron; `pore_share` (P,) is
    the part inside (1/2 for each such face, else 1), `throat_share` (T,) that of a throat's section.
    `pore_position` (P, 3) centre of the sphere touching the four grains, the centroid where that is outside (Shi
    2011, section 3.1.2); `pore_radius` of that sphere (0 where grains close it); `pore_power_centre` (P, 3) vertex of
    the power tessellation, the circumcentre for equal grains; `pore_tetra_volume`, `pore_volume` (void),
    `pore_wall_surface` (P,); `pore_group` (P,) equal for pores of one power centre, which are parts of one
    polyhedron (a lattice's cell, a prism cut by a face) split at will: one place, one pressure.
    `throat_pores` (T, 2); `throat_shift` (T, 3) periods from the second pore's position to its place beside the first;
    `throat_heights` (T, 2) distances of the power centres from the facet, positive on their own side;
    `throat_radius` inscribed; `throat_area` open; `throat_radius_effective` = sqrt(area / pi); `throat_length` between
    the pore positions (T,). `counts`: what was closed, floored, dropped or replaced.
    """

    box: Array
    periodic: tuple[bool, bool, bool]
    grain_radius: float
    area: float
    image_grain: Array
    image_position: Array
    image_radius: Array
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

    @property
    def pore_grains(self) -> Array:
        """Index (P, 4) of the grains at the corners."""
        return self.image_grain[self.pore_images]

    @property
    def pore_corner(self) -> Array:
        """Corners (P, 4, 3) m about the pore's position, images included."""
        return (
            self.image_position[self.pore_images]
            - (self.pore_wrap * np.ptp(self.box, axis=1))[:, None]
        )

    @property
    def pore_corner_radius(self) -> Array:
        """Grain radii (P, 4) m at the corners."""
        return self.image_radius[self.pore_images]

    @property
    def throat_grains(self) -> Array:
        """Index (T, 3) of the grains at the facet's corners."""
        return self.image_grain[self.throat_images]

    @property
    def throat_corner(self) -> Array:
        """Corners (T, 3, 3) m of the facet beside the first pore, images included."""
        wrap = self.pore_wrap[self.throat_pores[:, 0]] * np.ptp(self.box, axis=1)
        return self.image_position[self.throat_images] - wrap[:, None]

    @property
    def throat_corner_radius(self) -> Array:
        """Grain radii (T, 3) m at the facet's corners."""
        return self.image_radius[self.throat_images]

    @property
    def throat_ends(self) -> Array:
        """Places (T, 2, 3) m of the first pore and of the second beside it."""
        ends = self.pore_position[self.throat_pores]
        ends[:, 1] += self.throat_shift * np.ptp(self.box, axis=1)
        return ends


def build_network(
    grains: Snapshot, *, periodic: tuple[bool, bool, bool], walls: str = "slip"
) -> Network:
    """Network of `grains` alone (Shi 2011, section 3.2.1); unequal radii: of their power tessellation.

    Periodic sides join. The others are mirror planes: with `walls` "slip" the specimen is one half, fourth or eighth of
    the periodic one that its mirror images make up; with "no-slip" the y and z faces also hold the fluid, for laws that
    know it (`lubrication`). Grains that do not reach into the box are left out and counted. Raises NetworkError on
    unknown walls, impossible lengths, too few, coincident or coplanar grains, facets without partner, or no throat.
    """
    if walls not in WALLS:
        raise NetworkError(f"walls: {walls!r} is not known; choose one of {list(WALLS)}")
    periodic = (bool(periodic[0]), bool(periodic[1]), bool(periodic[2]))
    check_lengths(grains, periodic)
    kept = reaching(grains, periodic)
    if len(kept) < 4:
        raise NetworkError(
            f"tessellation: {len(kept)} of {len(grains)} grains reach into the box; a tetrahedron needs at least 4, "
            "give more grains or mend the box"
        )
    given, scale = grains, float(grains.radius[kept].mean())
    grains, beyond = onto_walls(grains.where(kept), periodic)
    tetrahedra, facets = tessellate(grains, periodic=periodic)
    polyhedra = make_polyhedra(tetrahedra, facets, grains.box, scale)
    if not len(facets.pore):
        what = f"no throat joins two pores of these {len(grains)} grains; the box is too narrow for its side walls"
        raise NetworkError(f"tessellation: {what}, give more grains or periodic sides")
    centres = pore_centres(tetrahedra, polyhedra, grains.box, periodic)
    counts = {
        "grains_outside_box": len(given) - len(kept),
        "grains_centred_beyond_walls": beyond,
        "grains_hidden": tetrahedra.hidden,
        "centre_is_centroid": centres.centroids,
        "throats_unmatched": facets.unmatched,
    }
    pores, pore_counts = _pores(tetrahedra, polyhedra, centres, grains.box)
    throats, throat_counts = _throats(tetrahedra, (facets, polyhedra), centres, grains.box, scale)
    found = {
        **pores,
        **throats,
        "image_grain": kept[tetrahedra.images.owner],
        "image_position": tetrahedra.images.position,
        "image_radius": tetrahedra.image_radius,
    }
    for value in found.values():
        value.setflags(write=False)
    size = np.ptp(grains.box, axis=1)
    return Network(
        box=grains.box,
        periodic=periodic,
        grain_radius=scale,
        area=float(size[1] * size[2]),
        counts={**counts, **pore_counts, **throat_counts},
        walls=walls,
        **found,
    )


def _pores(
    tetrahedra: Tetrahedra, polyhedra: Polyhedra, centres: Centres, box: Array
) -> tuple[dict[str, Array], dict[str, int]]:
    volume, void, surface = pore_solids(tetrahedra)
    cut = polyhedra.wall != 0
    found = {
        "pore_images": tetrahedra.vertex,
        "pore_wrap": centres.wrap,
        "pore_position": centres.position,
        "pore_radius": np.nan_to_num(np.maximum(centres.radius, 0.0), nan=0.0),
        "pore_power_centre": polyhedra.centre - centres.wrap * np.ptp(box, axis=1),
        "pore_tetra_volume": volume,
        "pore_volume": void,
        "pore_wall_surface": surface,
        "pore_group": polyhedra.group,
        "pore_share": 0.5 ** cut.sum(axis=1),
    }
    speck = 1e-9 * float(tetrahedra.image_radius.mean()) ** 3
    counts = {
        "pores_closed": int(np.sum(found["pore_radius"] == 0)),
        "slivers": int(np.sum(tetrahedra.flat)),
        "cospherical_groups": int(np.sum(np.bincount(polyhedra.group) > 1)),
        "pores_at_end_faces": int(np.sum(cut[:, 0])),
        "pores_at_side_walls": int(np.sum(cut[:, 1:].any(axis=1))),
        "void_negative": int(np.sum(void < -speck)),
    }
    return found, counts


def _throats(
    tetrahedra: Tetrahedra,
    shared: tuple[Facets, Polyhedra],
    centres: Centres,
    box: Array,
    scale: float,
) -> tuple[dict[str, Array], dict[str, int]]:
    polyhedra = shared[1]
    facets, kept = without_end_faces(*shared)
    one, two = facets.pore.T
    shift = (centres.wrap[two] + facets.shift - centres.wrap[one]).astype(np.int16)
    length = throat_lengths(centres.position, facets.pore, shift * np.ptp(box, axis=1))
    radius, area, counts = throat_sections(tetrahedra, facets)
    found = {
        "throat_pores": facets.pore,
        "throat_shift": shift,
        "throat_images": facet_vertices(tetrahedra, facets, slice(None)),
        "throat_share": throat_shares(facets, polyhedra),
        "throat_heights": polyhedra.heights[kept],
        "throat_radius": radius,
        "throat_area": area,
        "throat_radius_effective": np.sqrt(area / np.pi),
        "throat_length": np.maximum(length, LENGTH_FLOOR * scale),
    }
    counts = {
        **counts,
        "throats_pierced": int(
            np.sum(pierced_facets(tetrahedra, facets, radius > 0, np.ptp(box, axis=1)))
        ),
        "throats_short": int(np.sum(length < LENGTH_FLOOR * scale)),
        "throats_in_polyhedra": int(np.sum(polyhedra.group[one] == polyhedra.group[two])),
        "throats_in_end_faces_dropped": int(np.sum(~kept)),
    }
    return found, counts
