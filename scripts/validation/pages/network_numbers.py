"""The numbers in the prose on the studies of the network, each from the table of its study."""

import math
import re
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np

from fdnet.names import DEFAULT_LAW
from validation.accuracy import ARCHIE, FINEST, PAIRS
from validation.engine.study import DONE
from validation.network import laws, linear_solver, solver_peers
from validation.pages.lookup import (
    Lookup,
    between,
    lookup,
    percent,
    percents,
    rounded_up,
    significant,
)
from validation.truth import LOOSE

FEW_PORES = linear_solver.SMALL
OWN_SERIES = re.compile(rf"{solver_peers.FDNET}, \d")


def network_numbers(validation: Path) -> dict[str, str]:
    """Every number by its name in docs/validation.md.in."""
    return {
        **_laws(lookup(validation, "laws")),
        **_linear_solver(lookup(validation, "linear-solver")),
    }


def _laws(table: Lookup) -> dict[str, str]:
    intact, damaged = (f"{pack}: networks" for pack in (laws.INTACT, laws.DAMAGED))
    one, two = laws.GRID, laws.TWO_GRIDS
    times = [level.cost for level in table.levels(intact, "k")]
    errors = [level.bound for level in table.levels(intact, "k")]
    own = table.cost(intact, "k", DEFAULT_LAW)
    with_fines = table.cost(damaged, "k", FINEST)
    fifth, tenth = laws.FINES["_r5_"], laws.FINES["_r10_"]
    size = laws.SIZE.format("k/k0")
    thesis = [
        1 + row.error
        for name in PAIRS[:2]
        for series in (fifth, tenth)
        for row in table.runs(series, "k/k0", name)
    ]
    cost = {level.value: level.cost for level in table.levels(fifth, size)}
    groups = laws.GROUPS[:3]
    left = [table.error(group, laws.SIZE.format("k"), DEFAULT_LAW) for group in groups]
    loose = [row.error for row in table.runs(LOOSE, "k", DEFAULT_LAW)]

    def grid(pack: str, series: str, cells: float, network: float) -> tuple[str, str]:
        level = table.level(f"{pack}: {series}", "k", cells)
        return percent(level.error, 0 if level.size > 0.02 else 1), significant(
            level.cost / network
        )

    numbers = {
        "law_times": f"{max(times) / min(times):.1f}",
        "law_errors": f"{max(errors) / min(errors):.0f}",
        "law_left": percents(left, 1),
        "law_loose": percent(max(map(abs, loose))),
        "thesis_damage": between(thesis),
        "archie_errors": _both(table, size, ARCHIE),
        "spheres_errors": _both(table, size, FINEST),
        "spheres_times": f"{cost[FINEST] / cost[ARCHIE]:.0f}",
    }
    for name, (pack, series, cells, network) in {
        "one_64": (laws.INTACT, one, 64.0, own),
        "two_48": (laws.INTACT, two, 48.0, own),
        "two_72": (laws.INTACT, two, 72.0, own),
        "fines_64": (laws.DAMAGED, one, 64.0, with_fines),
        "fines_72": (laws.DAMAGED, two, 72.0, with_fines),
    }.items():
        numbers[f"{name}_error"], numbers[f"{name}_times"] = grid(pack, series, cells, network)
    return numbers


def _both(table: Lookup, quantity: str, value: str) -> str:
    """Errors with fines of 1/5 and of 1/10, with their bands."""
    of = [table.level(series, quantity, value) for series in laws.SIZES]
    return " and ".join(f"{percent(one.size, 1)} ± {percent(one.half_width, 1)}" for one in of)


def _linear_solver(table: Lookup) -> dict[str, str]:
    names = linear_solver.series_of
    fdnet, bare = solver_peers.FDNET, solver_peers.DIRECT
    spreads, large = linear_solver.DECADES, 100_000
    own = [row for row in table.rows if OWN_SERIES.match(row.series) and row.status == DONE]
    small = [row for row in own if f" {FEW_PORES} pores" in row.series]
    sizes = {float(row.value) for row in table.rows if row.quantity == linear_solver.CORE}
    tight = [
        row.error
        for method in (solver_peers.RUGE_STUBEN, solver_peers.AGGREGATION, solver_peers.JACOBI)
        for spread in spreads
        for row in table.runs(names(method, FEW_PORES, spread), "worst throat", 1e-8)
    ]
    return {
        "nominal_sizes": ", ".join(f"{pores:,.0f}" for pores in sorted(sizes)),
        "own_throat": significant(_most(small, "worst throat")),
        "own_residual": rounded_up(_most(own, "residual")),
        "own_small": between(
            table.cost(names(fdnet, FEW_PORES, d), "residual", "own")
            / table.cost(names(bare, FEW_PORES, d), "residual", "own")
            for d in spreads
        ),
        "own_large": between(
            table.cost(names(fdnet, large, d), "residual", "own")
            / table.cost(names(solver_peers.RUGE_STUBEN, large, d), "residual", 1e-8)
            for d in spreads
        ),
        "million": ", ".join(
            f"{table.cost(names(fdnet, 1_000_000, d), 'residual', 'own'):.0f}"
            for d in (0.0, 8.0, 16.0)
        ),
        "million_memory": f"{_largest_memory(table, fdnet):.2f}",
        "tight_throat": between(tight, 1),
        **_solver_steps(table),
        **_solver_limits(table),
    }


def _most(rows: Iterable, quantity: str) -> float:
    return max(row.error for row in rows if row.quantity == quantity)


def _largest_memory(table: Lookup, method: str) -> float:
    """GB at the largest size, the most over the spreads."""
    name = linear_solver.MEMORY
    rows = [
        row for d in linear_solver.DECADES for row in table.runs(f"{method}, {d:g} decades", name)
    ]
    largest = max(float(row.value) for row in rows)
    return max(row.observed for row in rows if row.value == largest) / 1e3


def _solver_steps(table: Lookup) -> dict[str, str]:
    names, multigrid = linear_solver.series_of, solver_peers.RUGE_STUBEN
    series = names(multigrid, 100_000, 8.0)
    by_tolerance = {row.value: row for row in table.runs(series, "residual")}
    tolerances = sorted(by_tolerance, reverse=True)
    pairs = list(pairwise(tolerances))
    steps = [by_tolerance[b].steps - by_tolerance[a].steps for a, b in pairs]
    times = [by_tolerance[b].core_s / by_tolerance[a].core_s - 1 for a, b in pairs]
    jacobi, aggregation = solver_peers.JACOBI, solver_peers.AGGREGATION
    unit = table.runs(names(solver_peers.UNIT_DIAGONAL, 100_000, 0.0), "residual")[0]
    plain = table.runs(names(multigrid, 100_000, 0.0), "residual")[0]
    off = {
        (pores, spread): table.error(names(jacobi, pores, spread), "inflow", 1e-8)
        for pores, spread in ((3_000, 16.0), (10_000, 16.0))
    }
    return {
        "steps_each": between(steps, 1),
        "steps_time": percents(times),
        "jacobi_steps": f"{table.runs(names(jacobi, 100_000, 0.0), 'residual')[0].steps:,.0f}",
        "aggregation_steps": " and ".join(
            f"{table.runs(names(aggregation, 100_000, d), 'residual')[0].steps:.0f}"
            for d in (0.0, 8.0)
        ),
        "jacobi_off": between((1 + error for error in off.values()), 2),
        "unit_steps": f"{unit.steps:.0f}",
        "plain_steps": f"{plain.steps:.0f}",
    }


def _solver_limits(table: Lookup) -> dict[str, str]:
    names, bare = linear_solver.series_of, solver_peers.DIRECT

    def direct_throat(spread: float) -> str:
        rows = [
            row.error
            for method in (bare, solver_peers.SPSOLVE)
            for row in table.runs(names(method, FEW_PORES, spread), "worst throat")
        ]
        return significant(max(rows), 1)

    def ratio(pores: int) -> str:
        return between(
            table.cost(names(solver_peers.FDNET_DIRECT, pores, d), "residual", "own")
            / table.cost(names(solver_peers.FDNET_MULTIGRID, pores, d), "residual", "own")
            for d in (0.0, 8.0, 16.0)
        )

    spsolve = _costs(table, f"{solver_peers.SPSOLVE}, 0 decades")
    direct = _costs(table, f"{bare}, 0 decades")
    (n, seconds), power = direct[-1], _growth(direct)
    million = max(float(row.value) for row in table.rows if row.quantity == "core seconds")
    memory = table.runs(f"{bare}, 0 decades", linear_solver.MEMORY)[-1].observed
    without = table.runs(f"{solver_peers.JACOBI}, 0 decades", linear_solver.MEMORY)[-1].observed
    return {
        "direct_throat": direct_throat(0.0),
        "direct_throat_wide": direct_throat(16.0),
        "direct_residual": significant(
            table.runs(names(bare, 100_000, 16.0), "residual")[0].error, 1
        ),
        "spsolve_growth": f"{_growth(spsolve):.1f}",
        "direct_1000": ratio(1_000),
        "direct_3000": ratio(3_000),
        "direct_5000": ratio(5_000),
        "direct_memory": f"{(memory - without) / 1e3:.2f}",
        "direct_estimate": f"{55 * n**1.41 / 1e9:.2f}",
        "direct_growth": f"{power:.1f}",
        "direct_million": significant(seconds * (million / n) ** power),
        "direct_million_memory": f"{55 * million**1.41 / 1e9:.0f}",
    }


def _costs(table: Lookup, series: str) -> list[tuple[float, float]]:
    """Pores and core seconds of a method."""
    rows = table.runs(series, linear_solver.CORE)
    return [(float(row.value), row.observed) for row in rows if not np.isnan(row.observed)]


def _growth(costs: list[tuple[float, float]]) -> float:
    """Exponent of the time in the pores, between the two largest sizes."""
    (small, quick), (large, slow) = costs[-2:]
    return math.log(slow / quick) / math.log(large / small)
