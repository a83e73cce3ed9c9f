"""Regions of cells around a cell, and the pores in them; many are made at once."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.upscaling.owners import Owners
from fdnet.network.upscaling.pore_graph import PoreGraph
from fdnet.network.upscaling.shifts import keys_of, members_of
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

RINGS = 3
"""A region holds a cell and three rings of neighbours around it.

With one ring the permeability of the known slabs would be 19 % (rms) off that of all spheres, with
two rings 2.4 %. With three it is 1.5 %.
"""
FLATTEST = 1e-3
"""Least extent along which a group of cells is divided, over its largest."""
BLOCK = 4
"""Cells that have one region together: fewer regions take less time than smaller ones."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lists:
    """Lists of neighbours, one for each of some nodes.

    Attributes:
        first: (n+1,) where the list of each node begins.
        other: (M,) the neighbour.
        shift: (M, 3) whole periods from the node to it.
        weight: (M,) conductance in between, m3.
    """

    first: Array
    other: Array
    shift: Array
    weight: Array

    __repr__ = one_line


def lists_of(ends: Array, shift: Array, weight: Array, count: int) -> Lists:
    """The lists of `count` nodes that links (K) join: `ends` (K, 2), `shift` (K, 3), `weight`."""
    own = np.concatenate([ends[:, 0], ends[:, 1]])
    other = np.concatenate([ends[:, 1], ends[:, 0]])
    order = np.argsort(own, kind="stable")
    return Lists(
        first=np.searchsorted(own[order], np.arange(count + 1)),
        other=other[order],
        shift=np.concatenate([shift, -shift])[order],
        weight=np.concatenate([weight, weight])[order],
    )


def neighbouring_cells(
    whole: PoreGraph, owners: Owners, throats: tuple[Array, Array], count: int
) -> Lists:
    """The neighbours of `count` cells: those to which a throat between grains or a link leads.

    `throats` are the ends (T, 2) and shifts (T, 3) of the throats between grains, and `whole` is
    the graph of all spheres.
    """
    inner = np.flatnonzero((whole.ends < len(whole.node)).all(axis=1))
    pore = whole.ends[inner]
    shift = whole.shift[inner] + owners.offset[pore[:, 0]] - owners.offset[pore[:, 1]]
    table = np.concatenate([np.column_stack([owners.cell[pore], shift]), np.column_stack(throats)])
    apart = (table[:, 0] != table[:, 1]) | (table[:, 2:] != 0).any(axis=1)
    table = np.unique(table[apart], axis=0)
    return lists_of(table[:, :2], table[:, 2:], np.ones(len(table)), count)


def blocks_of(place: Array) -> Array:
    """Number (N,) of the cubic block in which each place (N, 3) m lies, with some `BLOCK` others.

    Cells of one block have one region.
    """
    size = np.ptp(place, axis=0)
    wide = size > FLATTEST * size.max()
    if not np.any(wide):
        return np.zeros(len(place), np.intp)
    place, size = place[:, wide], size[wide]
    edge = float((np.prod(size) * BLOCK / len(place)) ** (1.0 / len(size)))
    count = np.maximum(np.rint(size / edge), 1).astype(np.intp)
    at = np.minimum((place - place.min(axis=0)) / size * count, count - 1).astype(np.intp)
    return np.unique(np.ravel_multi_index(tuple(at.T), tuple(count)), return_inverse=True)[1]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Regions:
    """The cells (C) of regions (B), and the pores (U) in these that carry flow.

    Attributes:
        cell_key: (C,) sorted, see `cell_keys`.
        pore_key: (U,) sorted, see `pore_keys`.
        region: (U,) in which each pore is.
        pore: (U,) its number.
        shift: (U, 3) whole periods by which it lies beyond its place.
        of_cell: (U,) row of `cell_key` of the cell in which it lies.
    """

    cell_key: Array
    pore_key: Array
    region: Array
    pore: Array
    shift: Array
    of_cell: Array

    __repr__ = one_line


def regions_around(
    centres: tuple[Array, Array], near: Lists, pores: tuple[Array, Array], offset: Array
) -> Regions:
    """The regions around cells: `centres` are these cells (N,) and the region (N,) of each.

    `pores` are those that carry flow, sorted by their cell, and where those of each cell begin;
    `offset` (G, 3) is `Owners.offset`.
    """
    cell, row = centres
    table = np.column_stack([row, cell, np.zeros((len(row), 3), np.intp)])
    for _ in range(RINGS):
        at, which = members_of(near.first, table[:, 1])
        added = np.column_stack(
            [table[at, 0], near.other[which], table[at, 2:] + near.shift[which]]
        )
        table = np.concatenate([table, added])
        key = cell_keys(table[:, 0], table[:, 1], table[:, 2:], len(near.first))
        key, kept = np.unique(key, return_index=True)
        table = table[kept]
    held, first = pores
    cell, which = members_of(first, table[:, 1])
    pore, region = held[which], table[cell, 0]
    shift = table[cell, 2:] + offset[pore]
    pore_key = pore_keys(region, pore, shift, len(offset))
    order = np.argsort(pore_key)
    return Regions(
        cell_key=key,
        pore_key=pore_key[order],
        region=region[order],
        pore=pore[order],
        shift=shift[order],
        of_cell=cell[order],
    )


def cell_keys(region: Array, cell: Array, shift: Array, size: int) -> Array:
    """Numbers (N,) of the cells `cell` (N,) at `shift` (N, 3) in the regions `region` (N,)."""
    return keys_of(region, cell, shift=shift, size=size)


def pore_keys(region: Array, pore: Array, shift: Array, size: int) -> Array:
    """Numbers (N,) of the pores `pore` (N,), likewise."""
    return keys_of(region, pore, shift=shift, size=size)
