"""What a specimen is, before any law: its network, where its fines sit, its porosity by depth."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fdnet.case.analysis import AnalysisChoices
from fdnet.errors import CaseError, NetworkError
from fdnet.network.fines.invaded import Invaded, measure_invaded
from fdnet.network.fines.occupancy import Occupancy, measure_occupancy
from fdnet.network.flow.sections import profile_edges, section_edges
from fdnet.network.network import Network, build_network
from fdnet.network.specimen.validity import (
    doubts,
    fines_outside_sides,
    packing_doubts,
    wide_fines,
)
from fdnet.network.tessellation.placed_grains import check_lengths
from fdnet.network.tessellation.tessellation import LARGE_CELL, copies_of_cell
from fdnet.spheres.arrays import one_line
from fdnet.spheres.contacts import inside_others
from fdnet.spheres.images import repeated
from fdnet.spheres.porosity import Porosity, measure_porosity
from fdnet.spheres.snapshot import Array, Snapshot

MOVED = 1e-9
"""A grain that is displaced by more than this, m, has moved."""


MANY_CENTRED = 0.1
"""Share of the grains with their centre inside another one, from which a warning says so."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner:
    """How many grains and fines lie wholly inside other spheres; they were left out.

    `centred` is the number of grains with their centre inside another one of about their size.
    """

    grains: int
    fines: int
    centred: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Specimen:
    """The parts of an analysis that depend on no law, in SI units.

    A periodic cell of a few grains is repeated for its networks; everything else is of the cell.

    Attributes:
        grains: the grains as they were, and where they ended; those of all copies.
        fines: all fines, those beyond the box among them; None without fines.
        copies: of the cell along x, y and z.
        inner: how many spheres lie inside others, and were left out for it.
        first: network of the grains as they were.
        network: network of the grains where they ended, the same one unless they moved.
        moved: whether any grain moved by more than 1 nm.
        occupancy: what the fines fill of `network`; None without fines.
        edges: (S+1,) edges of the sections, m.
        bins: (B+1,) edges of the profile's bins, m.
        porosity: porosity before and after, by depth.
        depth: (F,) depth of the fines centred in the box, m.
        invaded: number, volume and depths of these fines, and the cake.
        outside_sides: number of fines centred beyond a side wall.
    """

    grains: tuple[Snapshot, Snapshot]
    fines: Snapshot | None
    copies: tuple[int, int, int]
    inner: Inner
    first: Network
    network: Network
    moved: bool
    occupancy: Occupancy | None
    edges: Array
    bins: Array
    porosity: tuple[Porosity, Porosity]
    depth: Array
    invaded: Invaded
    outside_sides: int

    __repr__ = one_line

    def empty_sections(self) -> Array:
        """Whether no fine reaches into a section (S,), also none across a period along x."""
        edges = self.edges
        if self.fines is None:
            return np.ones(len(edges) - 1, bool)
        length = float(edges[-1] - edges[0])
        shifts = (-length, 0.0, length) if self.network.periodic[0] else (0.0,)
        x = np.concatenate([self.fines.position[:, 0] + shift for shift in shifts])
        radius = np.tile(self.fines.radius, len(shifts))
        return np.array(
            [not np.any((x + radius > low) & (x - radius < high)) for low, high in pairwise(edges)]
        )


def measure_specimen(
    initial: Snapshot,
    damaged: Snapshot | None,
    *,
    periodic: tuple[bool, bool, bool],
    choices: AnalysisChoices,
    timed: Callable[[str], AbstractContextManager[None]],
) -> Specimen:
    """The specimen of the grains of `initial` and, unless it is None, of all spheres of `damaged`.

    `timed` takes the name of the stage that its block belongs to. Raises NetworkError and
    CaseError as `analyse` does.
    """
    before = initial.grains()
    after = before if damaged is None else _same_grains(before, damaged.grains())
    box, fines = before.box, None if damaged is None else damaged.fines()
    edges = section_edges(choices.sections, box)
    if fines is not None and (why := wide_fines(before, fines)):
        raise NetworkError(why)
    if len(before):
        check_lengths(before, periodic)
    before, after, fines, inner = _without_inner(before, after, fines, periodic)
    with timed("tessellate"):
        moved = _displaced(before, after, periodic)
        packs = [before, *([after] if moved else [])]
        if fines is not None and len(after) + len(fines) < LARGE_CELL:
            packs.append(after.joined(fines))
        copies = copies_of_cell(packs, periodic)
        grains = repeated(before, copies), repeated(after, copies)
        first = build_network(grains[0], periodic=periodic, walls=choices.walls)
        network = (
            build_network(grains[1], periodic=periodic, walls=choices.walls) if moved else first
        )
    occupancy = None
    if fines is not None:
        with timed("occupancy"):
            occupancy = measure_occupancy(
                network, repeated(fines, copies), overlap=choices.throat_overlap
            )
    width = choices.profile_bin_m
    bins = profile_edges(first.grain_radius if width is None else width, box)
    cuts = np.unique(np.concatenate([edges, bins]))
    spheres = before if fines is None else after.joined(fines)
    with timed("porosity"):
        clean = measure_porosity(before, periodic=periodic, edges=cuts)
        filled = (
            clean if fines is None else measure_porosity(spheres, periodic=periodic, edges=cuts)
        )
    x = spheres.fines().position[:, 0]
    return Specimen(
        grains=grains,
        fines=None if fines is None else repeated(fines, copies),
        copies=copies,
        inner=inner,
        first=first,
        network=network,
        moved=moved,
        occupancy=occupancy,
        edges=edges,
        bins=bins,
        porosity=(clean, filled),
        depth=x[(x >= box[0, 0]) & (x < box[0, 1])],
        invaded=measure_invaded(spheres, periodic=periodic),
        outside_sides=fines_outside_sides(spheres.fines(), periodic),
    )


def require_snapshots(spheres: object, damaged: object) -> None:
    """Raise CaseError unless `spheres` is a Snapshot, and `damaged` a Snapshot or None."""
    for name, value in (("spheres", spheres), ("damaged", damaged)):
        if not isinstance(value, Snapshot) and (name == "spheres" or value is not None):
            text = repr(value)
            raise CaseError(
                f"{name}: {text if len(text) <= 60 else text[:60] + '...'} is a "
                f"{type(value).__name__}, expected a Snapshot; read one with fdnet.read_spheres "
                "from a file, or make one with fdnet.Snapshot.from_arrays"
            )


def specimen_doubts(specimen: Specimen, permeability: float, walls: str) -> Iterator[str]:
    """Warnings on a specimen and its permeability without fines, m2."""
    network, occupancy = specimen.first, specimen.occupancy
    if network.counts["grains_outside_box"]:
        yield f"{network.counts['grains_outside_box']} grains lie outside the box and play no part"
    if (
        occupancy is not None
        and occupancy.counts["fines_outside_box"]
        and not occupancy.pore_solid_volume.any()
    ):
        yield (
            f"none of the {occupancy.counts['fines_outside_box']} fines is centred in the box: "
            "no pore holds any; check the box if some should"
        )
    inner = specimen.inner
    for count, name in ((inner.grains, "grains"), (inner.fines, "fines")):
        if count:
            yield (
                f"{count} {name} lie wholly inside other spheres: they add nothing to the solid "
                "and were left out"
            )
    if inner.centred > MANY_CENTRED * len(specimen.grains[0]) / np.prod(specimen.copies):
        yield (
            f"{inner.centred} grains have their centre inside another one of about their size: "
            "between such clumps the permeability is 4 to 13 % too high by resolved flow"
        )
    porosity = specimen.porosity[0].mean
    yield from doubts(
        porosity=porosity,
        permeability=permeability,
        box=network.box,
        periodic=network.periodic,
        walls=walls,
    )
    yield from packing_doubts(specimen.grains[0], porosity, permeability, network.periodic)
    if specimen.outside_sides:
        yield (
            f"{specimen.outside_sides} fines are centred beyond the side walls of the box and "
            "block nothing there: check the box, the units and the periodic directions"
        )


def _without_inner(
    before: Snapshot,
    after: Snapshot,
    fines: Snapshot | None,
    periodic: tuple[bool, bool, bool],
) -> tuple[Snapshot, Snapshot, Snapshot | None, Inner]:
    """Grains before and after and fines that add to the solid, and how many do not."""
    wholly, _, centred = inside_others(before, periodic)
    if after is not before or fines is not None:
        together = after if fines is None else after.joined(fines)
        later = inside_others(together, periodic)[0]
        wholly, hidden = wholly & later[: len(after)], later[len(after) :]
        fines = fines.where(~hidden) if fines is not None and hidden.any() else fines
    else:
        hidden = np.zeros(0, bool)
    inner = Inner(grains=int(wholly.sum()), fines=int(hidden.sum()), centred=int(centred.sum()))
    if inner.grains:
        before, after = before.where(~wholly), after.where(~wholly)
    return before, after, fines, inner


def _same_grains(before: Snapshot, after: Snapshot) -> Snapshot:
    """`after` in the order of `before`, matched by id."""
    order, wanted = np.argsort(after.id), np.argsort(before.id)
    if len(before) != len(after) or np.any(after.id[order] != before.id[wanted]):
        lost = np.setxor1d(before.id, after.id)
        raise NetworkError(
            f"grains differ before ({len(before)}) and after ({len(after)}) the invasion, for "
            f"example id {lost[:3].tolist()}; give the same pack twice"
        )
    index = np.empty(len(before), int)
    index[wanted] = order
    return after.where(index)


def _displaced(before: Snapshot, after: Snapshot, periodic: tuple[bool, bool, bool]) -> bool:
    """Whether any grain moved; whole periods do not count."""
    size = before.box[:, 1] - before.box[:, 0]
    shift = after.position - before.position
    shift = shift - np.where(periodic, np.round(shift / size) * size, 0.0)
    return bool(np.max(np.linalg.norm(shift, axis=1), initial=0.0) > MOVED)
