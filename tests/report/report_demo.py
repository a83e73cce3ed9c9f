"""A made-up specimen for the report's tests.

It has 200 random grains in 4 x 2 x 2 mm and 800 fines that thin out with depth. The attributes are
those of the classes of fdnet.network; the physics is only plausible, and nothing here checks it.
"""

from functools import cache
from types import SimpleNamespace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial import Delaunay, cKDTree

from fdnet.network.flow.sections import Layers
from fdnet.spheres.snapshot import Kind, Snapshot

BOX = np.array([[0.0, 4e-3], [0.0, 2e-3], [0.0, 2e-3]])
GRAIN_RADIUS = 0.225e-3


def snapshot_of(position, radius, kind, *, first_id=1, velocity=None):
    count = len(position)
    return Snapshot(
        step=0,
        time_s=0.0,
        box=BOX,
        id=np.arange(first_id, first_id + count),
        kind=np.full(count, int(kind)),
        position=position,
        radius=np.broadcast_to(radius, count),
        velocity=np.zeros((count, 3)) if velocity is None else velocity,
    )


@cache
def demo_grains(count=200):
    generator = np.random.default_rng(7)
    low, high = BOX[:, 0] + 0.6 * GRAIN_RADIUS, BOX[:, 1] - 0.6 * GRAIN_RADIUS
    position = generator.uniform(low, high, (count, 3))
    for _ in range(300):
        pairs = cKDTree(position).query_pairs(2 * GRAIN_RADIUS, output_type="ndarray")
        apart = position[pairs[:, 0]] - position[pairs[:, 1]]
        distance = np.linalg.norm(apart, axis=1, keepdims=True)
        push = 0.4 * (2 * GRAIN_RADIUS - distance) * apart / distance
        np.add.at(position, pairs[:, 0], push)
        np.add.at(position, pairs[:, 1], -push)
        position = np.clip(position, low, high)
    return snapshot_of(position, GRAIN_RADIUS, Kind.GRAIN)


@cache
def demo_damaged(count=800):
    grains, generator = demo_grains(), np.random.default_rng(8)
    depth = generator.exponential(0.8e-3, 60 * count) - 0.1e-3
    position = np.column_stack([depth, generator.uniform(0, 2e-3, (60 * count, 2))])
    radius = generator.uniform(30e-6, 65e-6, 60 * count)
    distance, _ = cKDTree(grains.position).query(position)
    free = np.flatnonzero((distance > GRAIN_RADIUS + 0.9 * radius) & (depth < 4e-3))[:count]
    fines = snapshot_of(
        position[free],
        radius[free],
        Kind.FINE,
        first_id=1001,
        velocity=generator.normal(0, 1e-3, (len(free), 3)),
    )
    return grains.joined(fines)


def demo_network(grains):
    mesh = Delaunay(grains.position)
    corner = grains.position[mesh.simplices]
    position = corner.mean(axis=1)
    radius = np.clip(
        np.linalg.norm(corner - position[:, None], axis=2).min(axis=1) - GRAIN_RADIUS, 0, None
    )
    volume = np.abs(np.linalg.det(corner[:, 1:] - corner[:, :1])) / 6
    pores, ends, facets = [], [], []
    for pore, neighbours in enumerate(mesh.neighbors):
        for corner_index, other in enumerate(neighbours):
            facet = np.delete(mesh.simplices[pore], corner_index)
            centre = grains.position[facet].mean(axis=0)
            if other > pore:
                pores.append((pore, other))
                ends.append((position[pore], position[other]))
                facets.append(facet)
            elif other == -1 and (centre[0] < 0.3e-3 or centre[0] > 3.7e-3):
                outside = -1 if centre[0] < 2e-3 else -2
                pores.append((pore, outside))
                ends.append((position[pore], (BOX[0, -1 - outside], *position[pore][1:])))
                facets.append(facet)
    pores, ends, facets = np.array(pores), np.array(ends), np.array(facets)
    corners = grains.position[facets]
    throat_radius = np.clip(
        np.linalg.norm(corners - corners.mean(axis=1, keepdims=True), axis=2).min(axis=1)
        - GRAIN_RADIUS,
        0,
        None,
    )
    return SimpleNamespace(
        box=BOX,
        periodic=(False, False, False),
        image_position=grains.position,
        pore_images=mesh.simplices,
        throat_images=facets,
        pore_grains=mesh.simplices,
        pore_position=position,
        pore_radius=radius,
        pore_volume=0.4 * volume,
        pore_wall_surface=volume ** (2 / 3),
        throat_pores=pores,
        pore_tetra_volume=volume,
        pore_share=np.ones(len(position)),
        throat_share=np.ones(len(pores)),
        throat_shift=np.zeros((len(pores), 3)),
        throat_grains=facets,
        throat_ends=ends,
        throat_radius=throat_radius,
        throat_radius_effective=1.2 * throat_radius,
        throat_area=np.pi * throat_radius**2,
        throat_length=np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), 1e-5),
        counts={"throats_closed": 3},
    )


def demo_occupancy(network, fines):
    middle = network.throat_ends.mean(axis=1)
    near = cKDTree(fines.position).query_ball_point(middle, 1.2 * network.throat_radius + 2e-5)
    count = np.array([len(indices) for indices in near])
    mean_radius = np.array([fines.radius[indices].mean() if indices else 0.0 for indices in near])
    porosity = np.clip(1 - 0.18 * count, 0.05, 1.0)
    pore_porosity = np.clip(
        1
        - 0.1
        * np.array(
            [
                len(f)
                for f in cKDTree(fines.position).query_ball_point(network.pore_position, 1.2e-4)
            ]
        ),
        0.1,
        1.0,
    )
    return SimpleNamespace(
        throat_solid_volume=(1 - porosity) * network.throat_area * network.throat_length,
        throat_porosity=porosity,
        throat_fine_radius=mean_radius,
        throat_fines=count,
        blocked=(mean_radius > network.throat_radius) & (count > 0),
        pore_solid_volume=(1 - pore_porosity) * network.pore_volume,
        pore_solid_surface=(1 - pore_porosity) * network.pore_wall_surface,
        pore_porosity=pore_porosity,
        counts={},
    )


def demo_flow(network, conductance):
    count = len(network.pore_radius)
    first, second = network.throat_pores.T
    inner, at_inlet, at_outlet = second >= 0, second == -1, second == -2
    g = conductance + 1e-30
    diagonal = np.bincount(first, g, count) + np.bincount(second[inner], g[inner], count)
    rows = np.concatenate([np.arange(count), first[inner], second[inner]])
    columns = np.concatenate([np.arange(count), second[inner], first[inner]])
    matrix = coo_matrix(
        (np.concatenate([diagonal, -g[inner], -g[inner]]), (rows, columns)), (count, count)
    )
    pressure = spsolve(matrix.tocsc(), np.bincount(first[at_inlet], g[at_inlet], count))
    other = np.where(at_inlet, 1.0, 0.0)
    other[inner] = pressure[second[inner]]
    flux = conductance * (pressure[first] - other)
    return SimpleNamespace(
        pore_pressure=pressure,
        throat_flux=flux,
        method="direct",
        residual=3e-15,
        mass_balance=2e-14,
        inflow=-flux[at_inlet].sum(),
        isolated_pores=0,
        reason="",
        outflow=flux[at_outlet].sum(),
    )


def sampled_porosity(snapshot, edges):
    points = np.random.default_rng(9).uniform(BOX[:, 0], BOX[:, 1], (40_000, 3))
    inside = np.zeros(len(points), bool)
    tree = cKDTree(points)
    for centre, radius in zip(snapshot.position, snapshot.radius, strict=True):
        inside[tree.query_ball_point(centre, radius)] = True
    total, _ = np.histogram(points[:, 0], edges)
    solid, _ = np.histogram(points[inside, 0], edges)
    return 1 - solid / total


def demo_sections(initial, damaged, flows, edges):
    depth = damaged.fines().position[:, 0]
    invaded = int(((depth >= 0) & (depth < edges[-1])).sum())
    whole = {
        "initial": sampled_porosity(initial, edges),
        "damaged": sampled_porosity(damaged, edges),
    }
    k_initial = 9e-11 * (1 + 0.05 * np.sin(np.arange(len(edges) - 1)))
    k_damaged = k_initial * (1 - 0.55 * np.exp(-np.arange(len(edges) - 1) * 1.1))
    return tuple(
        SimpleNamespace(
            section=i + 1,
            x_lo=edges[i],
            x_hi=edges[i + 1],
            porosity_initial=whole["initial"][i],
            porosity_damaged=whole["damaged"][i],
            k_initial=k_initial[i],
            k_damaged=k_damaged[i],
            k_reduction=1 - k_damaged[i] / k_initial[i],
            k_initial_inplace=1.1 * k_initial[i],
            k_damaged_inplace=1.1 * k_damaged[i] * 0.95,
            fines_count=int(np.sum((depth >= edges[i]) & (depth < edges[i + 1]))),
            fines_fraction=float(
                np.sum((depth >= edges[i]) & (depth < edges[i + 1])) / max(invaded, 1)
            ),
        )
        for i in range(len(edges) - 1)
    ), invaded


def demo_layers(inside):
    """Ten layers of the first millimetre, the face less permeable than the rest."""
    edges = np.linspace(0, 1e-3, 11)
    k = 1e-11 * np.linspace(0.05, 1.0, 10)
    drop = 0.25 * (1 / k) / np.sum(1 / k)
    return Layers(
        edges=edges,
        k_initial=np.full(10, 1e-11),
        k_damaged=k,
        drop_initial=np.full(10, 0.02),
        drop_damaged=drop,
        fines_count=np.histogram(inside, edges)[0],
    )


@cache
def demo_analysis():
    initial, damaged = demo_grains(), demo_damaged()
    network = demo_network(initial)
    occupancy = demo_occupancy(network, damaged.fines())
    clean = np.pi * network.throat_radius**4 / (8 * network.throat_length)
    dirty = np.where(occupancy.blocked, 0.0, clean * occupancy.throat_porosity**2)
    flows = demo_flow(network, clean), demo_flow(network, dirty)
    sections, invaded = demo_sections(initial, damaged, flows, np.linspace(0, 4e-3, 5))
    fine_edges = np.linspace(0, 4e-3, 21)
    depth = damaged.fines().position[:, 0]
    inside = depth[(depth >= 0) & (depth < 4e-3)]
    profile = SimpleNamespace(
        edges=fine_edges,
        porosity_initial=sampled_porosity(initial, fine_edges),
        porosity_damaged=sampled_porosity(damaged, fine_edges),
        fines_fraction=np.histogram(inside, fine_edges)[0] / len(inside),
    )
    k_initial, k_damaged = (flow.inflow * 4e-3 / 4e-6 for flow in flows)
    law_used = np.where(
        occupancy.blocked, "blocked", np.where(occupancy.throat_fines > 0, "deposition", "clean")
    )
    return SimpleNamespace(
        network=network,
        occupancy=occupancy,
        law="effective",
        damage_law="thesis",
        damage_law_used="thesis",
        damage_law_other=None,
        k_damaged_other=None,
        layers=demo_layers(inside),
        conductance_initial=clean,
        conductance_damaged=dirty,
        law_used=law_used,
        flow_initial=flows[0],
        flow_damaged=flows[1],
        k_initial=k_initial,
        k_damaged=k_damaged,
        k_moved=None,
        k_reduction=1 - k_damaged / k_initial,
        porosity_initial=profile.porosity_initial.mean(),
        porosity_initial_error=8e-4,
        porosity_initial_sum=0.41,
        porosity_damaged=profile.porosity_damaged.mean(),
        sections=sections,
        profile=profile,
        invaded_count=invaded,
        invaded_volume=float((4 / 3 * np.pi * damaged.fines().radius[depth >= 0] ** 3).sum()),
        invasion_depth=float(inside.max()),
        invasion_depth_p95=float(np.quantile(inside, 0.95)),
        cake_thickness=0.3e-3,
        solver={"method": "direct", "residual": 3e-15, "mass_balance": 2e-14},
        counts={},
        warnings=("section 1 is thinner than three grains <b>&</b>",),
        seconds={"tessellate": 0.1, "solve": 0.05},
    )
