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
from fdnet.network.specimen.validity import doubts, fines_outside_sides, refuse_wide_fines
from fdnet.spheres.arrays import one_line
from fdnet.spheres.porosity import Porosity, measure_porosity
from fdnet.spheres.snapshot import Array, Snapshot

MOVED = 1e-9
"""A grain that is displaced by more than this, m, has moved."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Specimen:
    """The parts of an analysis that depend on no law, in SI units.

    Attributes:
        grains: the grains as they were, and where they ended.
        fines: all fines, those beyond the box among them; None without fines.
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
    box = before.box
    edges = section_edges(choices.sections, box)
    with timed("tessellate"):
        first = build_network(before, periodic=periodic, walls=choices.walls)
        moved = _displaced(before, after, periodic)
        network = build_network(after, periodic=periodic, walls=choices.walls) if moved else first
    occupancy = None
    if damaged is not None:
        with timed("occupancy"):
            occupancy = measure_occupancy(network, damaged.fines(), overlap=choices.throat_overlap)
        refuse_wide_fines(before, damaged.fines())
    width = choices.profile_bin_m
    bins = profile_edges(first.grain_radius if width is None else width, box)
    cuts = np.unique(np.concatenate([edges, bins]))
    spheres = before if damaged is None else after.joined(damaged.fines())
    with timed("porosity"):
        clean = measure_porosity(before, periodic=periodic, edges=cuts)
        filled = (
            clean if damaged is None else measure_porosity(spheres, periodic=periodic, edges=cuts)
        )
    x = spheres.fines().position[:, 0]
    return Specimen(
        grains=(before, after),
        fines=None if damaged is None else damaged.fines(),
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
    yield from doubts(
        porosity=specimen.porosity[0].mean,
        permeability=permeability,
        box=network.box,
        periodic=network.periodic,
        walls=walls,
    )
    if specimen.outside_sides:
        yield (
            f"{specimen.outside_sides} fines are centred beyond the side walls of the box and "
            "block nothing there: check the box, the units and the periodic directions"
        )


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
