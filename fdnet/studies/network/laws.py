"""Conductance and damage laws against Stokes truth, and resolved flow on coarse grids as the costly other way."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from fdnet.network.fines.occupancy import Occupancy, measure_occupancy
from fdnet.network.laws.named import DAMAGE_LAWS, DEFAULT_DAMAGE_LAW, DEFAULT_LAW, LAWS
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array
from fdnet.studies.engine.study import DONE, Measured, Panel, Point, Row, Study, row_of
from fdnet.studies.engine.timing import least_time
from fdnet.studies.network.law_models import (
    PAIRS,
    RESOLVED,
    RESOLVED_LIMIT,
    network_of,
    permeability,
    resolved,
)
from fdnet.studies.stokes.stokes import extrapolate, solve_stokes
from fdnet.studies.truth.packs import truth_folder, truth_tables
from fdnet.studies.truth.truth import EQUAL, LATTICE, LOOSE, UNEQUAL, Case, read_cases

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
DEFAULT = f"{DEFAULT_LAW} + {DEFAULT_DAMAGE_LAW}"
QUANTITIES, SIZE = ("k", "k/k0"), "{}, size"


@cache
def cases() -> dict[str, Case]:
    """The packs of known permeability. Raises CaseError without the project."""
    return {case.name: case for case in read_cases(truth_tables(), [truth_folder()])[0]}


def points(quick: bool) -> list[Point]:
    """Every law on every pack, then resolved flow on one pack without and with fines, coarse grids first."""
    chosen = [case for case in cases().values() if not quick or case.name in QUICK]
    return [*(point for case in chosen for point in _law_points(case)), *_grid_points(quick)]


def _law_points(case: Case) -> Iterator[Point]:
    names = list(LAWS)
    if case.ratio is not None:
        names = [" + ".join(pair) for pair in PAIRS] + [RESOLVED] * (
            len(case.pack) <= RESOLVED_LIMIT
        )
    for name in names:
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
    found, seconds = _by_law(case, str(point.value))
    return found | {"core_s": seconds, "peak_memory_bytes": float("nan")}


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
        k, seconds = least_time(lambda: permeability(network, LAWS[name](network)))
        return {"k": k}, build + seconds
    law = DEFAULT_LAW if name == RESOLVED else name.split(" + ", maxsplit=1)[0]
    k0 = permeability(network, LAWS[law](network))
    if name == RESOLVED:
        k, seconds = least_time(partial(resolved, case.pack))
        return {"k": k, "k/k0": k / k0}, seconds
    occupancy, occupied = _occupancy(case.name)
    work = partial(_damaged, network, occupancy, *(known[part] for known, part in _pair(name)))
    k, seconds = least_time(lambda: permeability(network, work()))
    return {"k": k, "k/k0": k / k0}, build + occupied + seconds


def _pair(name: str) -> Iterator[tuple[dict, str]]:
    yield from zip((dict(LAWS), dict(DAMAGE_LAWS)), name.split(" + "), strict=True)


def _damaged(network: Network, occupancy: Occupancy, law: Callable, damage_law: Callable) -> Array:
    return damage_law(network, occupancy, law(network)).conductance


@cache
def _network(name: str) -> tuple[Network, float]:
    return least_time(partial(network_of, cases()[name].pack))


@cache
def _occupancy(name: str) -> tuple[Occupancy, float]:
    return least_time(lambda: measure_occupancy(_network(name)[0], cases()[name].pack.fines()))


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Errors of k and k/k0 over the truth, signed and by size; the packs solved on grids once more as their own."""
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
                way = run.point.series if run.point.knob == "cells" else "networks"
                rows.append(replace(signed, series=f"{case.name}: {way}"))
    return rows


def _pack_panel(pack: str, title: str) -> Panel:
    series = tuple(f"{pack}: {way}" for way in ("networks", GRID, TWO_GRIDS))
    return Panel(quantity="k", title=title, series=series, label="relative error of k")


GROUPS, SIZES = (EQUAL, UNEQUAL, LATTICE, LOOSE), tuple(FINES.values())
REMARKS = """
Truth is resolved Stokes flow extrapolated from two fine grids (its own error is the uncertainty); errors are means
over the packs of a group, by size, with bands of 95 % over packs; cost is the whole way from the grains to k on one
core, in packs of 40 to 200 grains.

- **Laws do not buy accuracy with time.** Tessellation, geometry and solve are the same for all; the laws differ by a
  factor of 1.6 in time and of 100 in error, and no knob makes one of them converge: `thesis` and `effective` take one
  radius for a throat that widens to both sides, `hydraulic` one mean of volume over wall, `series` a fitted radius.
  `lubrication` integrates exact sections at no more cost. What is left (0.5 %, the size of truth's own error) is the
  fluid that does not follow a tube: up to 9 % where grains no longer touch (loose lattices).
- **With fines** the thesis's laws miss the fines' surface: 1.1 to 8 times too high, the more fines the worse; its two
  thresholds differ only where throats clog. `side-kozeny` stays at 4 %, the price of averages over the side of a
  throat. All spheres as grains avoids them at ten times the time and is not clearly better (2.7 ± 1.5 against 3.7 ±
  1.6 %).
- **Resolved flow** does converge: on one grid of N cells its error is 4 % at N = 64 (20 cells across a grain) at 130
  times the network's time, still above the default law's. Two grids and Richardson's rule reach 0.6 % at N = 48 and
  0.2 % at N = 72, at 90 and 270 times. Below 10 cells across a grain (N = 32) the order is not two yet. Fines of 1/5
  need five times as fine a grid: 30 % at N = 64, 10 % from N = 48 and 72, at 170 and 340 times the network's time.
  Where less than 1 % (intact) or 4 % (fines) is asked for, only finer resolved flow helps.
"""

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
    | dict.fromkeys([*SIZES, f"{DAMAGED}: networks"], DEFAULT),
    remarks=REMARKS,
    isolated=lambda point: point.knob == "cells",
)
