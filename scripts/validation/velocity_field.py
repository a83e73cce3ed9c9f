"""How close the velocity field is to a fine one, by cells across a grain and by run time.

Around deposits that LIGGGHTS made, the fields that fines might feel are compared: the one that
they do (`share`), and others (`local_flow`).
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network.field.field import VelocityField, velocity_field
from fdnet.network.network import Network, build_network
from fdnet.network.stokes import Walled
from fdnet.run.network_flow import SLIP, PackFlow, Renewal, pack_flow, placed
from fdnet.spheres.geometry import make_images
from fdnet.spheres.snapshot import Array, Snapshot
from validation.local_flow import SIDES, faces, local_flow, sampled
from validation.study import Point, least_time
from validation.truth import read_pack, read_table

PACKS = {
    "C, porosity 0.40": "packC_80_eps40",
    "C, fines 1/5": "packC_r5_d5",
    "E, porosity 0.30, put aside": "packE_80_eps30",
    "E, fines 1/5, put aside": "packE_r5_d4",
}
COARSEST = 5.0
POINTS, SEED = 10_000, 5
BEHIND = 0.6e-3
"""Length of a specimen behind the slab where its velocity is compared, m."""
PARTS = 12
"""Parts of each side of a throat's facet, for its flux."""


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Rms error of the velocity over the mean speed, 1 - R2 of the fluxes, and the seconds."""
    if point.knob == "field":
        return _among_fines(str(point.value), str(point.seed), float(point.settings["fine"]), work)
    name, fine = PACKS[str(point.settings["pack"])], float(point.settings["fine"])
    pack, cells = read_pack(name), float(point.value)
    places, throats = pore_points(pack, POINTS, SEED), build_network(pack.grains(), periodic="xyz")
    expected, fluxes = _reference(name, fine, work)
    velocity_field(pack, periodic="xyz", cells=COARSEST)  # compiles
    field, seconds = least_time(lambda: velocity_field(pack, periodic="xyz", cells=cells))
    speed = np.linalg.norm(expected, axis=1).mean()
    off = np.sqrt(np.mean(np.sum((field.at(places) - expected) ** 2, axis=1)))
    own = throat_fluxes(throats, field)
    lost = np.sum((own - fluxes) ** 2) / np.sum((fluxes - fluxes.mean()) ** 2)
    return {"velocity": float(off / speed), "throat fluxes": float(lost), "core_s": seconds}


def _among_fines(way: str, name: str, fine: float, work: Path) -> Mapping[str, float]:
    """The same at points of a slab, of all of them and of those where a fine's centre may be."""
    flow, solid, places, fits = _slab(name)
    kept = work / f"{name}-{fine:g}.npy"
    if not kept.exists():
        np.save(kept, velocity_field(solid, periodic="yz", cells=fine).at(places))
    expected, (kind, _, cells) = np.load(kept), way.partition(" ")
    velocity, seconds = least_time(lambda: WAYS[kind](cells, flow, solid, places))
    result = {"core_s": seconds}
    for quantity, among in (("among fines", fits | True), ("where a fine fits", fits)):
        speed = np.linalg.norm(expected[among], axis=1).mean()
        off = np.sqrt(np.mean(np.sum((velocity - expected)[among] ** 2, axis=1)))
        mean = np.linalg.norm(velocity[among], axis=1).mean()
        result |= {quantity: float(off / speed), f"mean {quantity}": float(mean / speed - 1.0)}
    return result


@cache
def _slab(name: str) -> tuple[PackFlow, Snapshot, Array, Array]:
    """A pack, its spheres that reach in, points (N, 3) m, and where (N,) a fine's centre may be.

    The pack is the first part of a specimen, the points lie in a slab, and half a grain and more
    is behind it.
    """
    (row,) = (row for row in read_table("slabs") if row["slab"] == name)
    end, whole = 1e-3 * float(row["x_hi_mm"]), read_pack(row["specimen"])
    pack = whole.where(whole.position[:, 0] < end + BEHIND)
    pack = replace(pack, box=np.array([[0.0, end + BEHIND], *pack.box[1:]]))
    solid = pack.where(pack.position[:, 0] + pack.radius > 0)
    slab = replace(pack, box=np.array([[0.0, end], *pack.box[1:]]))
    places, wide = pore_points(slab, POINTS, SEED, periodic=SIDES), solid.fines().radius.mean()
    fits = _distance(slab, places, SIDES, 2.0 * float(wide)) >= wide
    return pack_flow(pack.grains(), SIDES, "no-slip"), solid, places, fits


def _shares(flow: PackFlow, solid: Snapshot, places: Array, *, pores: int = 1) -> Array:
    """Share (N,) that the pores carry at places (N, 3): of the nearest, or between several."""
    carried, _ = Renewal(flow).of(placed(solid.fines()), anew=True)
    if pores == 1:
        return flow.share_at(places, carried)
    distance, pore = flow.tree.query(places - flow.network.box[:, 0], k=pores)
    weight = 1.0 / np.maximum(distance, 1e-9) ** 2
    inside = (places[:, 0] >= 0) & (places[:, 0] < flow.length)
    return np.where(inside, np.average(carried.ratio[pore], axis=1, weights=weight), 1.0)


def _balanced(cells: str, flow: PackFlow, solid: Snapshot, places: Array) -> Array:
    """The shares at the faces of a grid, with what they lack to keep the volume made up."""
    grains = solid.grains()
    bare = local_flow(grains, 2.0 * float(grains.radius.mean()), float(cells))
    parts = []
    for axis in range(3):
        middle = faces(bare.lattice, axis)
        parts.append(flow.shape.at(middle)[:, axis] * _shares(flow, solid, middle))
    carried = [part.reshape(bare.lattice.shape) for part in parts]
    return sampled(local_flow(grains, 0.0, 0.0, kept=bare, carried=carried), solid).velocity(
        places
    )


def _local(cells: str, flow: PackFlow, solid: Snapshot, places: Array) -> Array:
    diameter = 2.0 * float(solid.grains().radius.mean())
    return sampled(local_flow(solid, diameter, float(cells)), solid).velocity(places)


def _resolved(cells: str, flow: PackFlow, solid: Snapshot, places: Array) -> Array:
    return velocity_field(solid, periodic="yz", cells=float(cells), tolerance=SLIP).at(places)


WAYS: Mapping[str, Callable[[str, PackFlow, Snapshot, Array], Array]] = {
    "intact": lambda cells, flow, solid, places: flow.shape.at(places),
    "share": lambda cells, flow, solid, places: (
        flow.shape.at(places) * _shares(flow, solid, places)[:, None]
    ),
    "between": lambda cells, flow, solid, places: (
        flow.shape.at(places) * _shares(flow, solid, places, pores=4)[:, None]
    ),
    "balanced": _balanced,
    "resolved": _resolved,
    "local": _local,
}
"""The fields: velocity (N, 3) over the superficial one, at places (N, 3) m."""


def pore_points(
    pack: Snapshot, count: int, seed: int, *, periodic: Walled = (True, True, True)
) -> Array:
    """Points (N, 3) m of the pore space of a box, from `count` uniform ones."""
    low, size = pack.box[:, 0], np.ptp(pack.box, axis=1)
    place = low + np.random.default_rng(seed).random((count, 3)) * size
    return place[_distance(pack, place, periodic, 0.0) >= 0.0]


def _distance(pack: Snapshot, place: Array, periodic: Walled, farthest: float) -> Array:
    """Distance (N,) to the nearest sphere; `farthest` where none is so near."""
    reach = float(pack.radius.max()) + farthest
    images = make_images(
        pack.position, pack.box, periodic=periodic, margin=np.full(3, reach), tolerance=0.0
    )
    tree, radius = cKDTree(images.position), pack.radius[images.owner]
    return np.array(
        [
            np.min(
                np.linalg.norm(images.position[near] - point, axis=1) - radius[near],
                initial=farthest,
            )
            for point, near in zip(place, tree.query_ball_point(place, reach), strict=True)
        ]
    )


def throat_fluxes(network: Network, field: VelocityField) -> Array:
    """Flux (T,) m2 through the facets of the throats, over the superficial velocity."""
    corner = network.throat_corner
    ab, ac = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    across = 0.5 * np.cross(ab, ac)
    first, second = np.divmod(np.arange(PARTS**2), PARTS)
    # the facet in PARTS^2 equal triangles, by their centroids
    upper = first + second >= PARTS
    a = np.where(upper, PARTS - first - 1.0 / 3.0, first + 1.0 / 3.0) / PARTS
    b = np.where(upper, PARTS - second - 1.0 / 3.0, second + 1.0 / 3.0) / PARTS
    place = corner[:, :1] + a[:, None] * ab[:, None] + b[:, None] * ac[:, None]
    flow = field.at(place.reshape(-1, 3)).reshape(place.shape).mean(axis=1)
    return np.asarray(np.sum(flow * across, axis=1))


@cache
def _reference(name: str, cells: float, work: Path) -> tuple[Array, Array]:
    """Velocity at the points of the pack, and fluxes of its throats, on the fine grid."""
    kept = work / f"{name}-{cells:g}.npz"
    if not kept.exists():
        pack = read_pack(name)
        field = velocity_field(pack, periodic="xyz", cells=cells, tolerance=0.02)
        network = build_network(pack.grains(), periodic="xyz")
        velocity = field.at(pore_points(pack, POINTS, SEED))
        np.savez(kept, velocity=velocity, fluxes=throat_fluxes(network, field))
    with np.load(kept) as values:
        return values["velocity"], values["fluxes"]
