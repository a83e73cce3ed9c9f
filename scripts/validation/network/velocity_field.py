"""How close the velocity field is to a fine one, by cells across a grain and by run time."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network.field.field import COARSEST, VelocityField, velocity_field
from fdnet.network.network import Network, build_network
from fdnet.spheres.geometry import make_images
from fdnet.spheres.snapshot import Array, Snapshot
from validation.engine.study import Measured, Panel, Point, Row, Study, row_of
from validation.engine.timing import least_time
from validation.network.interception import happel, intercepted
from validation.truth import read_pack

PACKS = {
    "C, porosity 0.40": "packC_80_eps40",
    "C, fines 1/5": "packC_r5_d5",
    "E, porosity 0.30, put aside": "packE_80_eps30",
    "E, fines 1/5, put aside": "packE_r5_d4",
}
CELLS, QUICK_CELLS = (5.0, 7.0, 10.0, 14.0), (5.0, 7.0)
REFERENCE, QUICK_REFERENCE = 20.0, 12.0
"""Cells across a grain of the field that the others are compared with."""
CAPTURE, RATIO, POROSITY = "C, porosity 0.40", 0.02, 0.40
TRACERS = 1000
POINTS, SEED = 10_000, 5
PARTS = 12
"""Parts of each side of a throat's facet, for its flux."""
VELOCITY, FLUXES, CAUGHT, STUCK = "velocity", "throat fluxes", "interception", "stuck tracers"


def points(quick: bool) -> list[Point]:
    """Every number of cells in every pack."""
    names = list(PACKS)[: 1 if quick else None]
    fine = QUICK_REFERENCE if quick else REFERENCE
    return [
        Point(series=name, knob="cells", value=cells, settings={"reference": fine})
        for name in names
        for cells in (QUICK_CELLS if quick else CELLS)
    ]


def measure(point: Point, work: Path) -> dict[str, float]:
    """Errors of velocity and fluxes, what tracers stick, and the seconds of the field."""
    pack = read_pack(PACKS[point.series])
    cells, fine = float(point.value), float(point.settings["reference"])
    places, throats = pore_points(pack, POINTS, SEED), build_network(pack.grains(), periodic="xyz")
    expected, fluxes = _reference(point.series, fine, work)
    velocity_field(pack, periodic="xyz", cells=QUICK_CELLS[0])
    field, seconds = least_time(lambda: velocity_field(pack, periodic="xyz", cells=cells))
    speed = np.linalg.norm(expected, axis=1).mean()
    off = np.sqrt(np.mean(np.sum((field.at(places) - expected) ** 2, axis=1)))
    own = throat_fluxes(throats, field)
    lost = np.sum((own - fluxes) ** 2) / np.sum((fluxes - fluxes.mean()) ** 2)
    observed = {VELOCITY: float(off / speed), FLUXES: float(lost), "core_s": seconds}
    if point.series == CAPTURE and fine == REFERENCE:
        caught = intercepted(field.at, pack, RATIO, tracers=TRACERS)
        observed |= {CAUGHT: caught.efficiency, STUCK: float(caught.caught)}
    return observed


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
def _reference(series: str, cells: float, work: Path) -> tuple[Array, Array]:
    """Velocity at the points of the pack, and fluxes of its throats, on the fine grid."""
    kept = work / f"{PACKS[series]}-{cells:g}.npz"
    if not kept.exists():
        pack = read_pack(PACKS[series])
        field = velocity_field(pack, periodic="xyz", cells=cells, tolerance=0.02)
        network = build_network(pack.grains(), periodic="xyz")
        velocity = field.at(pore_points(pack, POINTS, SEED))
        np.savez(kept, velocity=velocity, fluxes=throat_fluxes(network, field))
    with np.load(kept) as values:
        return values["velocity"], values["fluxes"]


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Rms error over the mean speed, 1 - R2 of fluxes, and interception relative to Happel's."""
    rows: list[Row] = []
    for run in (one for one in measured if one.observed):
        rows += [
            row_of(run, name, error=run.observed[name], uncertainty=0.0)
            for name in (VELOCITY, FLUXES)
        ]
        if CAUGHT in run.observed:
            over = run.observed[CAUGHT] / happel(POROSITY, RATIO)
            spread = over / np.sqrt(run.observed[STUCK])
            rows.append(row_of(run, CAUGHT, error=over - 1.0, uncertainty=spread))
    return rows


STUDY = Study(
    name="velocity-field",
    title="Velocity between the grains",
    knob_label="cells across a grain",
    points=points,
    measure=measure,
    judge=judge,
    panels=(
        Panel(
            quantity=VELOCITY,
            title="velocity at points of the pores",
            label="rms error over the mean speed",
        ),
        Panel(quantity=FLUXES, title="fluxes of the throats", label="1 - R2"),
        Panel(
            quantity=CAUGHT,
            title="interception of tracers, d/D 0.02",
            label="relative to Happel's cell",
        ),
    ),
    defaults=dict.fromkeys(PACKS, COARSEST),
    isolated=False,
)
