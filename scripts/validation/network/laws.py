"""Conductance and damage laws against Stokes truth, and resolved flow on coarse grids."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from fdnet.names import DEFAULT_LAW
from fdnet.network.fines.occupancy import Occupancy, measure_occupancy
from fdnet.network.laws.named import LAWS
from fdnet.network.network import Network
from fdnet.network.stokes import extrapolate, solve_stokes
from validation.accuracy import (
    ALL_PAIRS,
    FINEST,
    by_all_spheres,
    by_law,
    by_pair,
    law_of,
    network_of,
)
from validation.engine.study import DONE, Measured, Panel, Point, Row, Study, row_of
from validation.engine.timing import least_time
from validation.truth import EQUAL, LATTICE, LOOSE, UNEQUAL, Case
from validation.truth import cases as truth_cases

INTACT, DAMAGED = "H_40_eps40", "H_r5_d13"
"""The packs solved on coarse grids too."""
QUICK = (INTACT, "SC_touching", DAMAGED)
FINES = {"_r5_": "fines of 1/5", "_r10_": "fines of 1/10"}
GRID, TWO_GRIDS = "resolved Stokes", "resolved Stokes, two grids"
CELLS = {INTACT: (16.0, 24.0, 32.0, 48.0, 64.0), DAMAGED: (32.0, 48.0, 64.0)}
PAIRED_CELLS = {INTACT: (24.0, 36.0, 48.0, 72.0), DAMAGED: (48.0, 72.0)}
QUICK_CELLS, QUICK_PAIRED = (16.0, 24.0, 32.0), (24.0,)
COARSER = 2.0 / 3.0
"""Cells of the coarser of two grids over those of the finer."""
QUANTITIES, SIZE = ("k", "k/k0"), "{}, size"


@cache
def cases() -> dict[str, Case]:
    """The packs of known permeability by name."""
    return {case.name: case for case in truth_cases()}


def points(quick: bool) -> list[Point]:
    """Every law on every pack, then resolved flow on one pack, coarse grids first."""
    chosen = [case for case in cases().values() if not quick or case.name in QUICK]
    return [*(point for case in chosen for point in _law_points(case)), *_grid_points(quick)]


def _law_points(case: Case) -> Iterator[Point]:
    for name in LAWS if case.ratio is None else ALL_PAIRS:
        yield Point(series=series_of(case), knob="law", value=name, settings={"pack": case.name})


def series_of(case: Case) -> str:
    """The curve a pack belongs to: its group, or with fines their size."""
    if case.ratio is None:
        return case.group
    return next(name for part, name in FINES.items() if part in case.name)


def _grid_points(quick: bool) -> Iterator[Point]:
    for pack in (INTACT,) if quick else (INTACT, DAMAGED):
        grids = {
            GRID: QUICK_CELLS if quick else CELLS[pack],
            TWO_GRIDS: QUICK_PAIRED if quick else PAIRED_CELLS[pack],
        }
        for series, cells in grids.items():
            yield from (
                Point(series=series, knob="cells", value=n, settings={"pack": pack}) for n in cells
            )


def measure(point: Point, work: Path) -> dict[str, float]:
    """k (m2), and with fines k/k0, of one pack by one law or on one grid."""
    case = cases()[str(point.settings["pack"])]
    if point.knob == "cells":
        return _on_grid(case, float(point.value), two=point.series == TWO_GRIDS)
    observed, seconds = _by_law(case, str(point.value))
    return observed | {"core_s": seconds, "peak_memory_bytes": float("nan")}


def _on_grid(case: Case, cells: float, *, two: bool) -> dict[str, float]:
    fine = solve_stokes(case.pack, cells=round(cells))
    steps = {"steps": float(fine.iterations)}
    if not two:
        return {"k": fine.k} | steps
    return {
        "k": extrapolate(solve_stokes(case.pack, cells=round(COARSER * cells)), fine).k
    } | steps


def _by_law(case: Case, name: str) -> tuple[dict[str, float], float]:
    network, build = _network(case.name)
    if case.ratio is None:
        k, seconds = least_time(partial(by_law, network, name))
        return {"k": k}, build + seconds
    k0 = by_law(network, law_of(name))
    if name == FINEST:
        (k, _), seconds = least_time(partial(by_all_spheres, case.pack))
    else:
        occupancy, occupied = _occupancy(case.name)
        k, seconds = least_time(partial(by_pair, network, occupancy, name))
        seconds += build + occupied
    return {"k": k, "k/k0": k / k0}, seconds


@cache
def _network(name: str) -> tuple[Network, float]:
    return least_time(partial(network_of, cases()[name].pack))


@cache
def _occupancy(name: str) -> tuple[Occupancy, float]:
    return least_time(lambda: measure_occupancy(_network(name)[0], cases()[name].pack.fines()))


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Errors of k and k/k0 over the truth, signed and by size.

    The packs that are solved on grids too have a series of their own as well.
    """
    rows = []
    for run in measured:
        case = cases()[str(run.point.settings["pack"])]
        for name, truth in zip(QUANTITIES, (case.k, case.ratio), strict=True):
            if truth is None or (run.status == DONE and name not in run.observed):
                continue
            error = run.observed.get(name, float("nan")) / truth - 1.0
            signed = row_of(run, name, error=error, uncertainty=case.error)
            rows += [signed, replace(signed, quantity=SIZE.format(name), error=abs(error))]
            if case.name in (INTACT, DAMAGED) and name == "k":
                means = run.point.series if run.point.knob == "cells" else "networks"
                rows.append(replace(signed, series=f"{case.name}: {means}"))
    return rows


def _pack_panel(pack: str, title: str) -> Panel:
    series = tuple(f"{pack}: {means}" for means in ("networks", GRID, TWO_GRIDS))
    return Panel(quantity="k", title=title, series=series, label="relative error of k")


GROUPS, SIZES = (EQUAL, UNEQUAL, LATTICE, LOOSE), tuple(FINES.values())
STUDY = Study(
    name="laws",
    title="Laws of the pore network and resolved flow against extrapolated Stokes flow",
    knob_label="law, or cells per edge",
    points=points,
    measure=measure,
    judge=judge,
    panels=(
        _pack_panel(INTACT, "one intact pack: every law, and resolved flow on coarse grids"),
        Panel(
            quantity=SIZE.format("k"),
            title="intact: mean size of the error",
            series=GROUPS,
            label="relative error of k",
        ),
        _pack_panel(DAMAGED, "the same pack with fines, k/k0 = 0.06"),
        Panel(
            quantity=SIZE.format("k/k0"),
            title="with fines: mean size of the error",
            series=SIZES,
            label="relative error of k/k0",
        ),
    ),
    defaults=dict.fromkeys([*GROUPS, f"{INTACT}: networks"], DEFAULT_LAW)
    | dict.fromkeys([*SIZES, f"{DAMAGED}: networks"], FINEST),
    isolated=lambda point: point.knob == "cells",
)
