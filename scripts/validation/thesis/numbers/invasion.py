"""How deep the fines of a state went, and the porosity that they took."""

import math

import numpy as np

from fdnet.network.permeability import Analysis
from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Array
from validation.thesis.runs.state import State

FIRST, FIRST_BIN, SHALLOW = 1e-3, 0.25e-3, 0.5e-3
"""Depths in m: the first millimetre, the first bin of the figures, and the half millimetre."""


def invaded_depth(state: State) -> Array:
    """(F,) m, depth of each fine centred in the specimen."""
    low, high = state.damaged.box[0]
    x = state.damaged.fines().position[:, 0]
    return x[(x >= low) & (x < high)] - low


def deep_near_wall(state: State) -> float:
    """Share of the fines beyond 1 mm centred within a mean grain radius of a side wall.

    It is nan without fines there or without side walls.
    """
    fines, reach = state.damaged.fines(), state.case.grains.mean_radius_m
    (low, high), *sides = state.damaged.box
    deep = (fines.position[:, 0] >= low + FIRST) & (fines.position[:, 0] < high)
    if any(state.case.periodic) or not deep.any():
        return math.nan
    to_wall = [
        np.minimum(fines.position[deep, i] - a, b - fines.position[deep, i])
        for i, (a, b) in enumerate(sides, 1)
    ]
    return float(np.mean(np.minimum(*to_wall) < reach))


def porosity_loss(state: State, analysis: Analysis, depth: float) -> float:
    """Loss of porosity between the face and `depth` (m), or the outlet if that is nearer.

    It is pooled from the profile's bins, or from the sections, when one of them ends at that
    depth; otherwise it is measured anew.
    """
    low, high = state.damaged.box[0]
    end = min(float(low) + depth, float(high))
    profile, sections = analysis.profile, analysis.sections
    cuts = np.array([sections[0].x_lo, *(one.x_hi for one in sections)])
    losses = np.array([one.porosity_initial - one.porosity_damaged for one in sections])
    for edges, loss in (
        (profile.edges, profile.porosity_initial - profile.porosity_damaged),
        (cuts, losses),
    ):
        count = int(np.argmin(np.abs(edges - end)))
        if abs(edges[count] - end) <= 1e-9 * (high - low):
            return float(np.average(loss[:count], weights=np.diff(edges)[:count]))
    span = np.array([low, end])
    before, after = (
        measure_porosity(spheres, periodic=state.case.periodic, edges=span).profile[0]
        for spheres in (state.grains, state.damaged)
    )
    return float(before - after)
