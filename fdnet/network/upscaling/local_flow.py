"""Flow through regions of the network of all spheres, and what it says of the facets in them.

On the pores around a region the pressure changes evenly along x, the direction of the flow, and on
inlet and outlet plane it is what it is there (Durlofsky 1991, Water Resour. Res. 27, 699, with a
border around the part that counts as Wen, Durlofsky and Edwards 2003, Comput. Geosci. 7, 121).
Pressures are in metres: they rise by 1 a metre along x, from 0 at a cell of the region. The mean
pressure of a cell is weighted with the conductances of its pores.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from fdnet.network.upscaling.overlay import Overlay
from fdnet.network.upscaling.regions import (
    RINGS,
    Regions,
    blocks_of,
    cell_keys,
    lists_of,
    pore_keys,
    regions_around,
)
from fdnet.network.upscaling.shifts import looked_up, members_of
from fdnet.network.upscaling.wanted import Wanted
from fdnet.spheres.snapshot import Array


class LocalFlow:
    """Two networks, prepared for the flow through many regions."""

    def __init__(self, overlay: Overlay) -> None:
        whole, cells = overlay.whole, overlay.facets.cells
        self.overlay = overlay
        self.links = lists_of(whole.ends, whole.shift, whole.conductance, len(whole.node) + 2)
        self.total = np.bincount(
            whole.ends.ravel(), np.repeat(whole.conductance, 2), len(whole.node) + 2
        )[: len(whole.node)]
        live = np.flatnonzero(self.total > 0.0)
        cell = overlay.owners.cell[live]
        order = np.argsort(cell, kind="stable")
        self._pores = live[order], np.searchsorted(cell[order], np.arange(cells + 1))

    def parts(self, cells: Array, most: int) -> list[tuple[Array, Array]]:
        """The `cells` in parts whose regions hold at most some `most` pores together.

        Each part is the cells (N,) and the region (N,) of each. A pore is counted once for each
        way that leads to it.
        """
        place, near = self.overlay.coarse.place[cells], self.overlay.near
        held = np.diff(self._pores[1])
        row, which = members_of(near.first, np.arange(len(held)))
        for _ in range(RINGS):
            around = np.bincount(row, held[near.other[which]], len(held))
            held = held + around.astype(np.intp)
        block = blocks_of(place)
        order = np.argsort(block, kind="stable")
        cell, block = cells[order], block[order]
        first = np.unique(block, return_index=True)[1]
        part = (np.cumsum(held[cell[first]]) // most)[block]
        return [
            (cell[own], np.unique(block[own], return_inverse=True)[1])
            for own in (part == number for number in np.unique(part))
        ]

    def across_facets(
        self, part: tuple[Array, Array], wanted: Wanted
    ) -> tuple[Array, Array, Array]:
        """Facets (M,) at the cells of a part, the flux m4 across them and the difference m.

        The difference is that of the mean pressures of its two nodes.
        """
        overlay, (cell, region) = self.overlay, part
        regions = regions_around(part, overlay.near, self._pores, overlay.owners.offset)
        first = np.unique(region, return_index=True)[1]
        solved = _Solved(self, regions, overlay.coarse.place[cell[first], 0])
        seen, which = members_of(wanted.first, cell)
        facet = wanted.facet[which]
        flux = solved.flux(region[seen], wanted.link[which], wanted.image[which])
        keys, at, member = np.unique(
            seen * len(overlay.facets.ends) + facet, return_index=True, return_inverse=True
        )
        total = np.bincount(member.ravel(), wanted.share[which] * flux, len(keys))
        ends, row = overlay.facets.ends[facet[at]], region[seen[at]]
        one, other = (
            solved.mean(row, ends[:, end], wanted.ends[which[at], end]) for end in (0, 1)
        )
        known = np.isfinite(one - other)
        return facet[at][known], total[known], (one - other)[known]


class _Solved:
    """The flow through some regions, whose pressure is 0 at `origin` (B,) m along x."""

    def __init__(self, flow: LocalFlow, regions: Regions, origin: Array) -> None:
        self._flow, self._overlay, self._regions = flow, flow.overlay, regions
        self._origin = origin
        self._pressure = self._solve()
        weight, count = flow.total[regions.pore], len(regions.cell_key)
        total = np.bincount(regions.of_cell, weight, count)
        summed = np.bincount(regions.of_cell, weight * self._pressure, count)
        self._mean = np.divide(summed, total, out=np.full(count, np.nan), where=total > 0.0)

    def flux(self, row: Array, link: Array, image: Array) -> Array:
        """Flux (N,) m4 of links, whose first ends are at `image` (N, 3) in the regions `row`."""
        whole = self._overlay.whole
        pressure = []
        for end in (0, 1):
            pore, shift = whole.ends[link, end], image + end * whole.shift[link]
            place, there = self._placed(row, pore, shift)
            inside = self._pressure[place] if len(self._pressure) else 0.0
            pressure.append(np.where(there, inside, self._outside(row, pore, shift)))
        return whole.conductance[link] * (pressure[0] - pressure[1])

    def mean(self, row: Array, node: Array, shift: Array) -> Array:
        """Mean pressures (N,) m of nodes of grains; those of the neighbours in an empty cell."""
        facets, size = self._overlay.facets, len(self._overlay.near.first)
        plane = node >= facets.cells
        keys = cell_keys(row, np.where(plane, 0, node), shift, size)
        place, there = looked_up(self._regions.cell_key, keys)
        on_plane = self._overlay.planes[np.where(plane, node - facets.cells, 0)]
        value = np.where(there, self._mean[place], np.nan)
        value = np.where(plane, on_plane - self._origin[row], value)
        for k in np.flatnonzero(np.isnan(value)):
            value[k] = self._of_neighbours(row[k], node[k], shift[k])
        return value

    def _of_neighbours(self, row: int, node: int, shift: Array) -> float:
        """Mean of the pressures around a cell, weighted with the throats without fines."""
        facets, size = self._overlay.facets, len(self._overlay.near.first)
        total = weight = 0.0
        for (other, at), (facet, _) in facets.near[node].items():
            if other >= facets.cells:
                value = self._overlay.planes[other - facets.cells] - self._origin[row]
            else:
                key = cell_keys(np.array([row]), np.array([other]), (shift + at)[None], size)
                place, there = looked_up(self._regions.cell_key, key)
                value = self._mean[place[0]] if there[0] else np.nan
            if np.isfinite(value):
                carried = facets.conductance[facet]
                total, weight = total + carried * value, weight + carried
        return float(total / weight) if weight > 0.0 else np.nan

    def _solve(self) -> Array:
        """Pressures (U,) in all pores of the regions."""
        regions, links = self._regions, self._flow.links
        count = len(regions.pore)
        if not count:
            return np.zeros(0)
        pore, which = members_of(links.first, regions.pore)
        region, other = regions.region[pore], links.other[which]
        shift, weight = regions.shift[pore] + links.shift[which], links.weight[which]
        place, there = self._placed(region, other, shift)
        held = weight * np.where(there, 0.0, self._outside(region, other, shift))
        total = self._flow.total[regions.pore]
        inner = (-weight[there], (pore[there], place[there]))
        matrix = sparse.coo_matrix(inner, (count, count)) + sparse.diags(total)
        scale = sparse.diags(1.0 / np.sqrt(total))
        factor = splu(
            (scale @ matrix @ scale).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        return np.asarray(scale @ factor.solve(scale @ np.bincount(pore, held, count)))

    def _placed(self, row: Array, pore: Array, shift: Array) -> tuple[Array, Array]:
        """Places (N,) of pores in the regions, and whether they are in them; planes are not."""
        count = len(self._overlay.whole.node)
        plane = pore >= count
        keys = pore_keys(row, np.where(plane, 0, pore), shift, count)
        place, there = looked_up(self._regions.pore_key, keys)
        return place, there & ~plane

    def _outside(self, row: Array, pore: Array, shift: Array) -> Array:
        """Pressure (N,) m on pores outside the regions, or on planes."""
        whole, planes = self._overlay.whole, self._overlay.planes
        plane = pore >= len(whole.node)
        along = whole.place[np.where(plane, 0, pore), 0] + shift[:, 0] * np.ptp(planes)
        on_plane = planes[np.where(plane, pore - len(whole.node), 0)]
        return np.where(plane, on_plane, along) - self._origin[row]
