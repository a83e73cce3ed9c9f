"""Pressures and fluxes of links whose conductances differ by any number of decades.

A link between the nodes a and b carries the flux g (p_a - p_b + jump); jumps are whole numbers.
Node 0 and the first node of every further group have the pressure 0.

The critical conductance of a node is that of the weakest link in the best closed loop with a jump
through it. Links far more conductive than that are stiff: their pressure difference is smaller
than a number can hold. Their nodes are contracted into one, and their fluxes follow from the
balance within the contracted group, where the same is done again.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network.flow.solver import Balances
from fdnet.network.flow.winding import groups, heights, winding_groups
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

CONTRASTS = (1e8, 1e6, 1e10)
"""Ratios of conductance between levels of stiffness, in the order in which they are tried."""
STEP = 10.0
"""Factor within which the critical conductance is determined."""
SETTLED = 1e-9
"""A balance of less defect is accepted."""
MOST_SWEEPS = 30


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Balance:
    """Pressures of n nodes and fluxes of K links.

    Attributes:
        pressure: (n,) over the unit of the jumps.
        flux: (K,) from the first to the second end, in units of conductance times jump.
        defect: sum of the imbalances of the nodes and of the errors of the links' own equations,
            over the throughput; it bounds the relative error of the throughput.
        method: how the system was solved.
    """

    pressure: Array
    flux: Array
    defect: float
    method: str

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Stage:
    """The links of one level of stiffness; the nodes that higher levels join are one node.

    Attributes:
        links: (L,) indices of the links.
        label: (n,) number of the contracted node of each node.
        free: (m,) whether the pressure of each contracted node is unknown; else it is 0.
        balances: the system of equations of the free nodes.
    """

    links: Array
    label: Array
    free: Array
    balances: Balances


def balance_links(
    ends: Array, conductance: Array, jump: Array, count: int, *, direct_up_to: int | None = None
) -> Balance:
    """Balance of all nodes, every one of which must be in a group that winds.

    The levels of stiffness differ by a contrast of 1e8. Where links of like conductance fall on
    both sides of that border and the sweeps do not settle, another contrast is tried. The best
    balance is returned, and the caller judges its `defect`.

    Args:
        ends: (K, 2) nodes that the links join.
        conductance: (K,) above 0.
        jump: (K,) of the links.
        count: number of nodes.
        direct_up_to: number of nodes up to which a direct solver is used, see `Balances`.
    """
    tried = []
    for contrast in CONTRASTS:
        level = stiffness(ends, conductance, jump, count, contrast=contrast)
        tried.append(_balance(ends, conductance, jump, (level, count), direct_up_to))
        if tried[-1].defect <= SETTLED or not level.any():
            break
    return min(tried, key=lambda one: one.defect)


def _balance(
    ends: Array,
    conductance: Array,
    jump: Array,
    levels: tuple[Array, int],
    direct_up_to: int | None,
) -> Balance:
    """Balance level by level, repeated for what is left over.

    Left over are the imbalances, and the pressure differences within the contracted groups, which
    the links next to them did not see. Fluxes add up by increments, never as differences of nearly
    equal pressures. `levels` holds the level (K,) of each link and the number of nodes.
    """
    level, count = levels
    stiff = level > 0
    height = (
        heights(ends[stiff], jump[stiff], groups(ends[stiff], count))
        if stiff.any()
        else np.zeros(count)
    )
    drive = jump + _difference(height, ends)
    level = _with_inner_links(ends, level, count)
    parts = [_contracted(ends, level, at, count) for at in range(int(level.max(initial=0)) + 1)]
    stages = [_stage(ends, conductance, part, direct_up_to) for part in parts]
    pressure, flux, defect, allowed = height, np.zeros(len(ends)), np.inf, None
    for _ in range(MOST_SWEEPS):
        step, gain, drive = _sweep(
            stages, ends, conductance, drive, (_net(ends, flux, count), allowed)
        )
        pressure, flux = pressure + step, flux + gain
        before, defect = (
            defect,
            _defect(_net(ends, flux, count), conductance * drive, float(flux @ jump)),
        )
        allowed = 0.3 * SETTLED * abs(float(flux @ jump))
        if defect <= SETTLED or not defect < 0.7 * before:
            break
    return Balance(
        pressure=pressure - pressure[0], flux=flux, defect=defect, method=stages[0].balances.method
    )


def stiffness(
    ends: Array, conductance: Array, jump: Array, count: int, *, contrast: float = CONTRASTS[0]
) -> Array:
    """Level (K,) of stiffness of each link.

    It is 0 up to `contrast` times the critical conductance of the nodes, 1 up to its square times
    that, and so on. The critical conductance of a node is the greatest at which the links that are
    as good or better still join it to a closed loop with a jump (Ambegaokar, Halperin and Langer
    1971); it is determined within a factor of 10. No more than a few times that flows through the
    node per unit of drive, so a link of level 1 takes at most some 1 / contrast of the drive.
    """
    level = np.zeros(len(ends), int)
    if not len(ends):
        return level
    lowest, highest = float(conductance.min()), float(conductance.max())
    if highest <= contrast * lowest:
        return level
    critical, bound = np.zeros(count), highest / contrast
    while True:
        strong = conductance >= bound
        winds = winding_groups(ends[strong], jump[strong], count)[1]
        critical[winds & (critical == 0)] = bound
        if bound <= lowest or np.all(critical > 0):
            break
        bound = max(min(bound / STEP, float(conductance[~strong].max())), lowest)
    ratio = conductance / np.maximum(critical[ends[:, 0]], critical[ends[:, 1]])
    return np.maximum(np.ceil(np.log(ratio) / np.log(contrast)).astype(int) - 1, 0)


def _with_inner_links(ends: Array, level: Array, count: int) -> Array:
    """The levels (K,), raised for links between nodes that higher levels contract into one."""
    level = level.copy()
    for at in range(int(level.max(initial=0))):
        label = groups(ends[level > at], count)
        level[(level == at) & (label[ends[:, 0]] == label[ends[:, 1]])] = at + 1
    return level


def _contracted(ends: Array, level: Array, at: int, count: int) -> tuple[Array, Array]:
    """Links of level `at`, and labels (n,) of the nodes with all higher levels contracted."""
    return np.flatnonzero(level == at), groups(ends[level > at], count)


def _stage(
    ends: Array, conductance: Array, contracted: tuple[Array, Array], direct_up_to: int | None
) -> _Stage:
    """The stage of links and labels as `_contracted` gives them."""
    links, label = contracted
    pair, size = label[ends[links]], int(label.max(initial=-1)) + 1
    free = np.ones(size, bool)
    free[np.unique(groups(pair, size), return_index=True)[1]] = False
    index = np.cumsum(free) - 1
    own = conductance[links]
    tied = np.zeros(int(free.sum()))
    for side in (0, 1):
        held = free[pair[:, side]] & ~free[pair[:, 1 - side]]
        tied += np.bincount(index[pair[held, side]], weights=own[held], minlength=len(tied))
    inner = np.all(free[pair], axis=1)
    balances = Balances(index[pair[inner]], own[inner], tied, direct_up_to=direct_up_to)
    return _Stage(links=links, label=label, free=free, balances=balances)


def _sweep(
    stages: list[_Stage],
    ends: Array,
    conductance: Array,
    drive: Array,
    state: tuple[Array, float | None],
) -> tuple[Array, Array, Array]:
    """Increments of pressure (n,) and flux (K,), and the drive (K,) left for the next sweep.

    The increments balance what drives the links, `drive` (K,), and what the nodes lack. The drive
    that is left is what the lower stages have since set up for the stiffer links. `state` holds
    the net flux (n,) out of each node, and the sum of imbalances that may stay.
    """
    net, allowed = state
    flux, late, steps = np.zeros(len(ends)), np.zeros(len(ends)), []
    for stage in stages:
        own, pushed = conductance[stage.links], drive[stage.links]
        net = net + _net(ends[stage.links], own * pushed, len(net))
        lack = np.bincount(stage.label, weights=-net, minlength=len(stage.free))
        pressure = np.zeros(len(stage.free))
        pressure[stage.free] = stage.balances.solve(lack[stage.free], imbalance=allowed)
        steps.append(pressure[stage.label])
        gain = own * _difference(steps[-1], ends[stage.links])
        net = net + _net(ends[stage.links], gain, len(net))
        flux[stage.links] = gain + own * pushed
    for at, stage in enumerate(stages):
        for step in steps[at + 1 :]:
            late[stage.links] += _difference(step, ends[stage.links])
    return np.sum(steps, axis=0), flux, late


def _difference(pressure: Array, ends: Array) -> Array:
    """Pressure difference (K,) along each link."""
    return pressure[ends[:, 0]] - pressure[ends[:, 1]]


def _net(ends: Array, flux: Array, count: int) -> Array:
    """Net flux (n,) out of each node."""
    return np.bincount(ends[:, 0], weights=flux, minlength=count) - np.bincount(
        ends[:, 1], weights=flux, minlength=count
    )


def _defect(net: Array, late: Array, throughput: float) -> float:
    """Imbalances of nodes `net` (n,) and of links `late` (K,) over the throughput."""
    off = float(np.abs(net).sum() + np.abs(late).sum())
    return off / throughput if throughput > 0 else np.inf
