"""A specimen: its grains, its fines, what of them has invaded, the cake, and what is doubtful."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import CaseError, Doubt, NetworkError
from fdnet.network.fines.occupancy import Occupancy, measure_occupancy
from fdnet.network.flow.sections import profile_edges, section_edges
from fdnet.network.network import Network, build_network
from fdnet.network.tessellation.delaunay import check_lengths
from fdnet.network.tessellation.facets import LARGE_CELL, copies_of_cell
from fdnet.spheres import geometry
from fdnet.spheres.snapshot import Array, Kind, Snapshot, one_line, sides_of

CONTACT_GAP = 0.01  # Spheres this far apart, in diameters of the smaller one, touch
HELD_BY = 2
"""Fewest contacts of a fine that stands. In cakes that LIGGGHTS made, of one size and of many, it
gives the fines slower than half the velocity of the fluid best: 2 and 6 % more resistance than
theirs, 3 contacts give 5 and 19 % less, for small fines lie caged between others."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Invaded:
    """Fines centred in the box, and the cake. The formation face is the low x face, x = 0."""

    invaded_count: int  # number of fines centred in the specimen
    invaded_volume: float  # their volume, m3, of whole spheres
    invasion_depth: float  # depth of the deepest of them, m; 0 without fines
    invasion_depth_p95: float  # depth above which 95 % of them lie, m; 0 without fines
    cake_thickness: float  # thickness of the cake upstream of the formation face, m


def measure_invaded(spheres: Snapshot, *, periodic: Sequence[bool]) -> Invaded:
    """Invasion by the fines of `spheres`; the sides x, y and z may be `periodic`."""
    fines = spheres.fines()
    low, high = spheres.box[0]
    within = (fines.position[:, 0] >= low) & (fines.position[:, 0] < high)
    depth = fines.position[within, 0] - low
    return Invaded(
        invaded_count=int(within.sum()),
        invaded_volume=float(4.0 / 3.0 * np.pi * np.sum(fines.radius[within] ** 3)),
        invasion_depth=float(depth.max(initial=0.0)),
        invasion_depth_p95=float(np.quantile(depth, 0.95)) if len(depth) else 0.0,
        cake_thickness=cake_thickness(cake_of(spheres, periodic)),
    )


def cake_of(spheres: Snapshot, periodic: Sequence[bool]) -> Snapshot:
    """The fines that stand upstream of the face: each is held by at least `HELD_BY` others.

    The others are grains, fines centred inside the box, and fines that stand too; all hang
    together from the pack on. So a fine that falls on the cake or drifts along it is none of it,
    nor is a chain of them. Contact is a gap of at most 1 % of the smaller diameter.
    """
    low = float(spheres.box[0, 0])
    if not np.any(spheres.fines().position[:, 0] < low):
        return spheres.where(np.zeros(len(spheres), bool))
    reach = float(np.max(spheres.radius)) * (2.0 + 4.0 * CONTACT_GAP)
    everything = spheres.where(spheres.position[:, 0] < low + reach)
    upstream = (everything.position[:, 0] < low) & (everything.kind == Kind.FINE)
    around = (False, bool(periodic[1]), bool(periodic[2]))
    pair, _ = geometry.touching_pairs(everything, around, gap=CONTACT_GAP)
    count, loose = len(everything), upstream
    while loose.any():
        loose = upstream & (np.bincount(pair.ravel(), minlength=count) < HELD_BY)
        pair = pair[~loose[pair].any(axis=1)]
        upstream = upstream & ~loose
    # all spheres of the pack are one group: tie them to an extra node
    pack = np.flatnonzero((everything.position[:, 0] >= low) | (everything.kind != Kind.FINE))
    rows = np.concatenate([pair[:, 0], pack])
    columns = np.concatenate([pair[:, 1], np.full(len(pack), count)])
    graph = sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count + 1, count + 1))
    _, group = connected_components(graph, directed=False)
    return everything.where(upstream & (group[:-1] == group[-1]))


def cake_thickness(cake: Snapshot) -> float:
    """Way from the face to the foremost of the fines of a `cake`, m; 0 without fines."""
    low = float(cake.box[0, 0])
    return float(max(low - np.min(cake.position[:, 0] - cake.radius, initial=low), 0.0))


# ---- Whether an answer lies where the method was validated, and whether it can be true at all.
VALIDATED_POROSITY = (0.25, 0.50)
"""Lowest and highest porosity of the packs with a resolved permeability (docs: accuracy)."""
SAND = (1e-6, 1e-2)  # Smallest and largest diameter of a grain, m, that nobody wonders at
CARMAN_KOZENY = (1 / 20, 5.0)
"""Least and most permeability of any packing over that of Carman and Kozeny; packs and lattices
of spheres have 0.5 to 1.2 of it."""
LIKE = 1e-3  # A fine that is smaller than the smallest grain by less than this share is as large
PRESSED = 0.2  # Part of its radius by which a grain may reach across a wall: pressed grains do
MANY = 0.25
"""Part of the spheres that would cross the sides of a periodic pack, above which it is said."""
GAPS, FEWEST, MISSING, LEAST_SIDE = (0.05, 0.5), 5.0, 0.55, 2.5
"""To find walls at periodic sides: gaps between neighbours, in diameters; the number of neighbours
across a side, and its share, below which they are missing (between walls 0.1 to 0.35 of it,
periodic 0.8 and more); the least side, in lengths between neighbours."""
_SERIES = 2 * np.arange(200) + 1.0


def wide_fines(grains: Snapshot, fines: Snapshot) -> str:
    """Why a fine is none: wider than the box or as large as the smallest grain; empty if all are.

    Such a radius is most often a slip of units, or a type of sphere that names a material.
    """
    if not len(fines) or not len(grains):
        return ""
    largest = int(np.argmax(fines.radius))
    radius, number = float(fines.radius[largest]), int(fines.id[largest])
    side, grain = float(np.ptp(fines.box, axis=1).min()), float(grains.radius.min())
    one = f"fines: the fine with id {number} has a radius of {radius:.4g} m, "
    check = "the units of the radii, or which spheres are fines"
    if radius > side / 2:
        half = f"more than half the shortest side of the box ({side / 2:.4g} m)"
        return f"{one}{half}; check {check}"
    if radius >= grain * (1.0 - LIKE):
        return (
            f"{one}the smallest grain one of {grain:.4g} m; expected fines that are clearly "
            f"smaller than grains. Check {check}"
        )
    return ""


def pack_doubts(spheres: Snapshot, axis: str, walls: str) -> Iterator[str]:
    """Doubts about spheres from anywhere, with flow along `axis`: walls crossed, and overlaps."""
    periodic = sides_of(spheres, None)
    if walls == "no-slip":
        yield from _crossing(spheres, periodic, axis)
    seen = spheres.where(~geometry.inside_others(spheres, periodic)[0])
    of_fines = geometry.max_overlap(seen, periodic, only_fines=True)
    yield from geometry.overlap_doubts(geometry.max_overlap(seen.grains(), periodic), of_fines)


def _crossing(spheres: Snapshot, periodic: tuple[bool, bool, bool], axis: str) -> Iterator[str]:
    """A warning where many spheres reach across the side walls, as those of a periodic pack do."""
    walls = np.array([not periodic[k] and "xyz"[k] != axis for k in range(3)])
    reach = spheres.radius[:, None] * (1 - PRESSED)
    low, high = spheres.box.T
    beyond = ((spheres.position - reach < low) | (spheres.position + reach > high)) & walls
    count = int(np.sum(beyond.any(axis=1)))
    expected = 2.0 * reach.mean() * len(spheres) * np.sum(walls / (high - low))
    if count > max(MANY * expected, 3):
        sides = "".join(np.array([*"xyz"])[beyond.any(axis=0) | np.array(periodic)])
        yield Doubt(
            "crossing-walls",
            f"{count} of {len(spheres)} spheres cross the side walls; if the pack is periodic "
            f"give --periodic {sides}",
        )


def doubts(porosity: float, permeability: float, network: Network) -> Iterator[str]:
    """Why the permeability (m2) of a pack without fines is to be doubted, one sentence each."""
    low, high = VALIDATED_POROSITY
    if not low <= porosity <= high:
        yield Doubt(
            "outside-the-validated-porosity",
            f"the porosity without fines is {porosity:.3f}, outside {low:.2f} to {high:.2f}, "
            "where fdnet was compared with resolved flow: the permeability may be wrong by more "
            "than the documented error; check the box and the units, or use a resolved solver",
        )
    empty = empty_duct_permeability(network.box, network.periodic)
    if network.walls == "no-slip" and permeability > empty:
        yield Doubt(
            "impossible-permeability",
            f"the permeability without fines, {permeability:.3g} m2, is above that of the empty "
            f"box with the same walls, {empty:.3g} m2, which is impossible: do not use it; there "
            "are too few grains for the box, so check the box and the units",
        )


def kozeny(grains: Snapshot, porosity: float) -> float:
    """Permeability m2 by Carman and Kozeny with the constant 180 and the Sauter diameter."""
    sauter = 2.0 * float(np.sum(grains.radius**3) / np.sum(grains.radius**2))
    return porosity**3 * sauter**2 / (180.0 * max(1.0 - porosity, 1e-9) ** 2)


def _walls_at_periodic_sides(grains: Snapshot, periodic: tuple[bool, bool, bool]) -> Iterator[str]:
    """A warning for each periodic axis along which the pack ends as at a wall: no grain crosses
    its sides, and far fewer neighbours meet across them than across any plane within."""
    place = geometry.wrapped(grains.position, grains.box, periodic)
    reach, (low, high) = grains.radius[:, None] * (1.0 - PRESSED), grains.box.T
    clear = np.array(periodic) & np.all((place - reach >= low) & (place + reach <= high), axis=0)
    if not clear.any():
        return
    pairs = np.empty((0, 2), int)
    for gap in GAPS:
        if len(pairs) < len(grains) / 2:
            pairs, _ = geometry.touching_pairs(grains, periodic, gap=gap)
    size = high - low
    apart = place[pairs[:, 0]] - place[pairs[:, 1]]
    inside = np.abs(apart - np.where(periodic, np.rint(apart / size) * size, 0.0))
    for axis in np.flatnonzero(clear):
        expected = float(inside[:, axis].sum() / size[axis])
        meeting = int(np.sum(np.abs(apart[:, axis]) > 0.5 * size[axis]))
        wide = size[axis] > LEAST_SIDE * inside.max(initial=0.0)
        if wide and expected >= FEWEST and meeting < MISSING * expected:
            name = "xyz"[axis]
            yield Doubt(
                "walls-at-periodic-sides",
                f"no grain crosses the periodic sides {name}, and {meeting} neighbours meet "
                f"across them where {expected:.0f} are expected: the pack stands as between "
                f"walls, and the gap there carries flow; leave {name} out of the periodic "
                "directions unless the pack repeats like this",
            )


def empty_duct_permeability(box: Array, periodic: tuple[bool, bool, bool]) -> float:
    """Permeability, m2, of the empty box along x between walls that hold the fluid.

    Infinite without walls, h2/12 between two plates a distance h apart, and for a rectangle of
    sides h <= w the series of Boussinesq (1868; White, Viscous Fluid Flow, equation 3-48).
    """
    sides = [float(np.ptp(box[axis])) for axis in (1, 2) if not periodic[axis]]
    if not sides:
        return np.inf
    height = min(sides)
    if len(sides) == 1:
        return height**2 / 12
    width = max(sides)
    terms = np.tanh(_SERIES * np.pi * width / (2 * height)) / _SERIES**5
    return height**2 / 12 * (1 - 192 * height / (np.pi**5 * width) * float(np.sum(terms)))


# ---- What a specimen is, before any law: its network, where its fines sit, its porosity by depth.
MOVED = 1e-9  # A grain that is displaced by more than this, m, has moved


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Specimen:
    """The parts of an analysis that depend on no law, in SI units.

    A periodic cell of a few grains is repeated for its networks; everything else is of the cell.
    """

    grains: tuple[Snapshot, Snapshot]
    """The grains as they were, and where they ended; those of all copies."""
    fines: Snapshot | None  # all fines, those beyond the box among them; None without fines
    copies: tuple[int, int, int]  # of the cell along x, y and z
    inner_grains: int  # number of grains wholly inside other spheres; they were left out
    inner_fines: int  # number of fines likewise
    first: Network  # network of the grains as they were
    network: Network  # network of the grains where they ended, the same one unless they moved
    moved: bool  # whether any grain moved by more than 1 nm
    occupancy: Occupancy | None  # what the fines fill of `network`; None without fines
    edges: Array  # (S+1,) edges of the sections, m
    bins: Array  # (B+1,) edges of the profile's bins, m
    porosity: tuple[geometry.Porosity, geometry.Porosity]  # porosity before and after, by depth
    depth: Array  # (F,) depth of the fines centred in the box, m
    invaded: Invaded  # number, volume and depths of these fines, and the cake
    outside_sides: int  # number of fines centred beyond a side wall

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

    `timed` takes the name of the stage that its block belongs to. Raises as `analyse` does.
    """
    before = initial.grains()
    after = before if damaged is None else _same_grains(before, damaged.grains())
    box, fines = before.box, None if damaged is None else damaged.fines()
    edges = section_edges(choices.sections, box)
    if fines is not None and (why := wide_fines(before, fines)):
        raise NetworkError(why)
    if len(before):
        check_lengths(before, periodic)
    given = len(before), 0 if fines is None else len(fines)
    before, after, fines = _without_inner(before, after, fines, periodic)
    size, shift = np.ptp(box, axis=1), after.position - before.position
    shift -= np.where(periodic, np.round(shift / size) * size, 0.0)  # whole periods do not count
    moved = bool(np.max(np.linalg.norm(shift, axis=1), initial=0.0) > MOVED)
    with timed("tessellate"):
        packs = [before, *([after] if moved else [])]
        if fines is not None and len(after) + len(fines) < LARGE_CELL:
            packs.append(after.joined(fines))
        copies = copies_of_cell(packs, periodic)
        grains = geometry.repeated(before, copies), geometry.repeated(after, copies)
        first, *ended = (
            build_network(one, periodic=periodic, walls=choices.walls)
            for one in grains[: 1 + moved]
        )
        network = ended[0] if moved else first
    occupancy = None
    if fines is not None:
        with timed("occupancy"):
            occupancy = measure_occupancy(
                network, geometry.repeated(fines, copies), overlap=choices.throat_overlap
            )
    bins = profile_edges(choices.profile_bin_m or first.grain_radius, box)
    cuts = np.unique(np.concatenate([edges, bins]))
    spheres = before if fines is None else after.joined(fines)
    with timed("porosity"):
        clean = geometry.measure_porosity(before, periodic=periodic, edges=cuts)
        filled = clean
        if fines is not None:
            filled = geometry.measure_porosity(spheres, periodic=periodic, edges=cuts)
    place = spheres.fines().position
    x, beyond = place[:, 0], (place < box[:, 0]) | (place > box[:, 1])
    return Specimen(
        grains=grains,
        fines=None if fines is None else geometry.repeated(fines, copies),
        copies=copies,
        inner_grains=given[0] - len(before),
        inner_fines=0 if fines is None else given[1] - len(fines),
        first=first,
        network=network,
        moved=moved,
        occupancy=occupancy,
        edges=edges,
        bins=bins,
        porosity=(clean, filled),
        depth=x[(x >= box[0, 0]) & (x < box[0, 1])],
        invaded=measure_invaded(spheres, periodic=periodic),
        outside_sides=int(np.sum(np.any(beyond[:, 1:] & ~np.array(periodic[1:]), axis=1))),
    )


def as_snapshot(spheres: object, name: str = "spheres") -> Snapshot:
    """The spheres, from arrays in m where they are no Snapshot. Raises CaseError for all else."""
    if isinstance(spheres, Snapshot):
        return spheres
    if isinstance(spheres, tuple) and len(spheres) in (2, 3):
        return Snapshot.from_arrays(*spheres[:2], box=spheres[2] if len(spheres) > 2 else None)
    raise CaseError(
        f"{name}: {spheres!r:.60} is a {type(spheres).__name__}, expected a Snapshot or (points, "
        "radii, box); read one with fdnet.read_spheres, or make one with "
        "fdnet.Snapshot.from_arrays"
    )


def specimen_doubts(specimen: Specimen, permeability: float) -> Iterator[str]:
    """Warnings on a specimen and its permeability without fines, m2."""
    network, occupancy = specimen.first, specimen.occupancy
    if count := network.counts["grains_outside_box"]:
        yield Doubt("outside-the-box", f"{count} grains lie outside the box and play no part")
    if (
        occupancy is not None
        and (count := occupancy.counts["fines_outside_box"])
        and not occupancy.pore_solid_volume.any()
    ):
        yield Doubt(
            "no-fine-in-the-box",
            f"none of the {count} fines is centred in the box: no pore holds any; check the box "
            "if some should",
        )
        yield Doubt(
            "no-fine-in-the-box",
            f"none of the {occupancy.counts['fines_outside_box']} fines is centred in the box: "
            "no pore holds any; check the box if some should",
        )
    grains = specimen.grains[0]
    for count, name in ((specimen.inner_grains, "grains"), (specimen.inner_fines, "fines")):
        if count:
            yield Doubt(
                "inside-others",
                f"{count} {name} lie wholly inside other spheres: they add nothing to the solid "
                "and were left out",
            )
    porosity = specimen.porosity[0].mean
    yield from doubts(porosity, permeability, network)
    least, most = 2.0 * float(grains.radius.min()), 2.0 * float(grains.radius.max())
    if most > SAND[1] or least < SAND[0]:
        yield Doubt(
            "no-sand",
            f"the grains are {least:.3g} to {most:.3g} m wide, which is no sand ({SAND[0]:g} to "
            f"{SAND[1]:g} m): the unit of length is probably another one, and the permeability "
            "goes with its square",
        )
    likely = kozeny(grains, porosity)
    # spheres that are far apart have the drag of single ones
    volume = float(np.prod(np.ptp(grains.box, axis=1)))
    lone = volume / (6.0 * np.pi * float(grains.radius.sum()))
    high = min(CARMAN_KOZENY[1] * likely, 2.0 * lone)
    low, (dense, sparse) = CARMAN_KOZENY[0] * likely, VALIDATED_POROSITY
    if permeability > high or (0.0 < permeability < low and dense <= porosity <= sparse):
        yield Doubt(
            "no-packing",
            f"the permeability without fines, {permeability:.3g} m2, is "
            f"{permeability / likely:.3g} times what Carman and Kozeny give for these radii and "
            f"this porosity ({likely:.3g} m2), which no packing has: do not use it; check the "
            "box, which sides are periodic, and whether radii and places have one unit",
        )
    yield from _walls_at_periodic_sides(grains, network.periodic)
    if specimen.outside_sides:
        yield Doubt(
            "fines-beyond-the-sides",
            f"{specimen.outside_sides} fines are centred beyond the side walls of the box and "
            "block nothing there: check the box, the units and the periodic directions",
        )


def _without_inner(
    before: Snapshot, after: Snapshot, fines: Snapshot | None, periodic: tuple[bool, bool, bool]
) -> tuple[Snapshot, Snapshot, Snapshot | None]:
    """Grains before and after and fines that add to the solid."""
    wholly = geometry.inside_others(before, periodic)[0]
    if after is not before or fines is not None:
        together = after if fines is None else after.joined(fines)
        later = geometry.inside_others(together, periodic)[0]
        wholly &= later[: len(after)]
        fines = None if fines is None else fines.where(~later[len(after) :])
    return before.where(~wholly), after.where(~wholly), fines


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
