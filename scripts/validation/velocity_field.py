"""How close the velocity field is to a fine one, by cells across a grain and by run time."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network.field.field import VelocityField, velocity_field
from fdnet.network.network import Network, build_network
from fdnet.spheres.geometry import make_images
from fdnet.spheres.snapshot import Array, Snapshot
from validation.study import Point, least_time
from validation.truth import read_pack

PACKS = {
    "C, porosity 0.40": "packC_80_eps40",
    "C, fines 1/5": "packC_r5_d5",
    "E, porosity 0.30, put aside": "packE_80_eps30",
    "E, fines 1/5, put aside": "packE_r5_d4",
}
COARSEST = 5.0
POINTS, SEED = 10_000, 5
PARTS = 12
"""Parts of each side of a throat's facet, for its flux."""


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Rms error of the velocity over the mean speed, 1 - R2 of the fluxes, and the seconds."""
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


def pore_points(pack: Snapshot, count: int, seed: int) -> Array:
    """Points (N, 3) m of the pore space of a periodic box, from `count` uniform ones."""
    low, size = pack.box[:, 0], np.ptp(pack.box, axis=1)
    place = low + np.random.default_rng(seed).random((count, 3)) * size
    images = make_images(
        pack.position,
        pack.box,
        periodic=(True,) * 3,
        margin=np.full(3, pack.radius.max()),
        tolerance=0.0,
    )
    tree, radius = cKDTree(images.position), pack.radius[images.owner]
    free = [
        not any(np.linalg.norm(images.position[near] - point, axis=1) < radius[near])
        for point, near in zip(place, tree.query_ball_point(place, pack.radius.max()), strict=True)
    ]
    return place[free]


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
