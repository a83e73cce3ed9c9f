"""Method and tolerance of the network's solve: error against run time over sizes and spreads of conductance."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from fdnet.spheres.snapshot import Array
from fdnet.studies.engine.runner import forget_peak, peak_memory
from fdnet.studies.engine.study import DONE, Measured, Panel, Point, Row, Study, row_of
from fdnet.studies.engine.timing import least_time
from fdnet.studies.network.circuit import Circuit, circuit_of, exact_fluxes
from fdnet.studies.network.solver_peers import (
    AGGREGATION,
    DIRECT,
    FDNET,
    FDNET_DIRECT,
    FDNET_MULTIGRID,
    ITERATIVE,
    JACOBI,
    METHODS,
    RUGE_STUBEN,
    SPSOLVE,
    UNIT_DIAGONAL,
    Solved,
    solve_by,
)

SMALL = 200
"""Pores up to which the answer is known in 80 digits."""
IN_PROCESS = 5_000
TOLERANCE, TOLERANCES = 1e-8, (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14)
DECADES = (0.0, 4.0, 8.0, 12.0, 16.0)
OWN = "own"
QUANTITIES = ("inflow", "worst throat", "residual", "mass balance")
CORE, MEMORY, STEPS = "core seconds", "peak memory, MB", "steps"
BREAK_EVEN = (1_000, 2_000, 3_000, 5_000, 10_000)
SEEDS = 3


def points(quick: bool) -> list[Point]:
    """Small networks with every method and tolerance, then sizes; fdnet's own first, as the others' reference."""
    found = list(
        _small(
            1 if quick else SEEDS,
            (0.0, 8.0, 16.0) if quick else DECADES,
            TOLERANCES[:: 2 if quick else 1],
        )
    )
    if quick:
        return [*found, *(_point(method, 1_000, 8.0) for method in (FDNET, DIRECT, RUGE_STUBEN))]
    return [*found, *_sizes()]


def _small(seeds: int, decades: Sequence[float], tolerances: Sequence[float]) -> Iterator[Point]:
    for seed in range(seeds):
        for spread in decades:
            yield from (
                _point(method, SMALL, spread, seed=seed) for method in (FDNET, DIRECT, SPSOLVE)
            )
            for method in (RUGE_STUBEN, AGGREGATION, JACOBI):
                yield from (
                    _point(method, SMALL, spread, tolerance, seed=seed) for tolerance in tolerances
                )


def _sizes() -> Iterator[Point]:
    usual = (FDNET, DIRECT, RUGE_STUBEN, JACOBI)
    for pores in BREAK_EVEN:
        for spread in DECADES[::2]:
            yield from (
                _point(method, pores, spread) for method in (FDNET_DIRECT, FDNET_MULTIGRID)
            )
    for pores in (1_000, 3_000, 10_000):
        for spread in DECADES:
            yield from (_point(method, pores, spread) for method in (*usual, AGGREGATION, SPSOLVE))
    for spread in DECADES[::2]:
        yield from (_point(method, 30_000, spread) for method in usual)
    for spread in DECADES:
        yield from (_point(method, 100_000, spread) for method in usual)
    yield from (_point(RUGE_STUBEN, 100_000, 8.0, to) for to in TOLERANCES if to != TOLERANCE)
    yield from (_point(JACOBI, 100_000, 8.0, to) for to in TOLERANCES if to > TOLERANCE)
    yield from (_point(AGGREGATION, 100_000, spread) for spread in (0.0, 8.0))
    yield _point(SPSOLVE, 30_000, 0.0)
    yield _point(UNIT_DIAGONAL, 100_000, 0.0)
    yield from (_point(FDNET, 1_000_000, spread) for spread in DECADES[::2])
    yield from (_point(RUGE_STUBEN, 1_000_000, spread) for spread in (0.0, 8.0))
    yield _point(DIRECT, 1_000_000, 0.0)


def _point(
    method: str, pores: int, decades: float, tolerance: float = TOLERANCE, *, seed: int = 0
) -> Point:
    value = tolerance if method in ITERATIVE else OWN
    return Point(
        series=series_of(method, pores, decades),
        knob="tolerance",
        value=value,
        seed=seed,
        settings={"method": method, "pores": float(pores), "decades": decades},
    )


def series_of(method: str, pores: int, decades: float) -> str:
    """Name of a curve."""
    return f"{method}{suffix(pores, decades)}"


def suffix(pores: int, decades: float) -> str:
    """What the curves of one network and spread have in common."""
    return f", {pores} pores, {decades:g} decades"


def measure(point: Point, work: Path) -> dict[str, float]:
    """Errors of one solve: against 80 digits up to 200 pores, beyond against fdnet's own."""
    method, pores, decades = (
        str(point.settings["method"]),
        int(point.settings["pores"]),
        point.settings["decades"],
    )
    circuit = circuit_of(pores, float(decades), point.seed, work)
    tolerance = TOLERANCE if point.value == OWN else float(point.value)
    solved, costs = _timed(method, circuit, tolerance)
    flux = solved.flux
    inflow = circuit.inflow(flux)
    found = {
        "pores": float(circuit.count),
        "inflow": inflow,
        "residual": circuit.imbalance(flux) / inflow,
        "mass balance": abs(circuit.outflow(flux) / inflow - 1.0),
    }
    known = work / f"fluxes_{pores}_{decades:g}_{point.seed}.npy"
    if pores <= SMALL:
        found |= _against(circuit, flux, _exact(pores, float(decades), point.seed, work))
    elif method == FDNET:
        np.save(known, flux)
    elif known.exists():
        found |= _against(circuit, flux, np.load(known))
    return found | costs | {"steps": solved.steps}


def _timed(method: str, circuit: Circuit, tolerance: float) -> tuple[Solved, dict[str, float]]:
    """The solve with its core seconds (the least of three where it is quick) and peak memory (in its own process)."""
    forget_peak()
    solved, seconds = least_time(lambda: solve_by(method, circuit, tolerance))
    memory = peak_memory() if circuit.count > IN_PROCESS else float("nan")
    return solved, {"core_s": seconds, "peak_memory_bytes": memory}


def _against(circuit: Circuit, flux: Array, exact: Array) -> dict[str, float]:
    truth = circuit.inflow(exact)
    worst = float(np.abs(flux - exact).max()) / truth
    return {
        "inflow, reference": truth,
        "worst throat": worst,
        "residual, reference": circuit.imbalance(exact) / truth,
    }


@cache
def _exact(pores: int, decades: float, seed: int, work: Path) -> Array:
    return exact_fluxes(circuit_of(pores, decades, seed, work))


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Relative errors of the inflow, of the worst throat (over the inflow), residual and mass balance; and by size
    what the solves to the usual tolerance cost."""
    rows = [row for run in measured for row in _error_rows(run)]
    done = [run for run in measured if run.status == DONE and run.point.seed == 0]
    usual = [run for run in done if run.point.value in (OWN, TOLERANCE)]
    return rows + [row for run in sorted(usual, key=_pores) for row in _cost_rows(run)]


def _pores(run: Measured) -> float:
    return run.observed.get("pores", float(run.point.settings["pores"]))


def _error_rows(run: Measured) -> Iterator[Row]:
    nan = float("nan")
    if run.status != DONE:
        yield row_of(run, QUANTITIES[0], error=nan, uncertainty=nan)
        return
    sure = run.observed.get("residual, reference", nan)
    truth = run.observed.get("inflow, reference", nan)
    errors = dict(run.observed) | {"inflow": run.observed["inflow"] / truth - 1.0}
    for name in QUANTITIES:
        if name in errors:
            yield row_of(
                run, name, error=errors[name], uncertainty=sure if name in QUANTITIES[:2] else 0.0
            )


def _cost_rows(run: Measured) -> Iterator[Row]:
    method, decades = str(run.point.settings["method"]), run.point.settings["decades"]
    costs = {CORE: run.core_s, MEMORY: run.peak_memory_bytes / 1e6, STEPS: run.steps}
    for name, value in costs.items():
        row = row_of(run, name, error=float("nan"), uncertainty=float("nan"))
        yield replace(
            row,
            series=f"{method}, {decades:g} decades",
            knob="pores",
            value=_pores(run),
            observed=value,
        )


def _error_panel(
    pores: int, decades: float, quantity: str, title: str, methods: Sequence[str] = METHODS
) -> Panel:
    return Panel(
        quantity=quantity,
        title=title,
        series=tuple(series_of(method, pores, decades) for method in methods),
        label="over the inflow",
        common=suffix(pores, decades),
    )


def _cost_panel(quantity: str, decades: float, title: str) -> Panel:
    common = f", {decades:g} decades"
    names = tuple(f"{method}{common}" for method in METHODS if method != UNIT_DIAGONAL)
    return Panel(
        quantity=quantity,
        title=title,
        series=names,
        label=quantity,
        cost="value",
        knob="pores",
        common=common,
    )


REMARKS = """
Networks: pack H tiled and shaken by 2 % of a radius, between planes across x, law `lubrication` (whose conductances
span 6 decades of their own), each divided by a factor log-uniform over so many decades more. Sizes are nominal
(really 189, 757, 1,771, 2,782, 3,969, 8,520, 29,973, 95,995, 954,508 pores). Up to 200 pores errors are against
elimination in 80 digits, three draws each; beyond, against fdnet's own fluxes, whose residual is then the
uncertainty. The tolerance is the norm of the residual over that of the source; cost is set-up and solve, core
seconds. Left out as teaching nothing new: methods at sizes above those where they already failed or took over ten
times the others' time, 4 and 12 decades at 30,000 and a million pores.

- **fdnet's own choice was never wrong**: worst throat 4e-11 of the inflow in all small networks, imbalances below
  6e-10 of it in all sizes and spreads. It pays for that with finding stiff groups and with a second sweep: 1.3 to 4
  times the time of a bare direct solve at 200 pores, 1.7 (intact) to 6 times (16 decades, where that answer is
  useless) a bare multigrid to 1e-8 at 100,000. A million pores take 6 (intact), 10 (8 decades) and 22 core seconds
  (16), 0.85 GB in all.
- **The norm of the residual says little**: at 1e-8 the worst throat of 200 pores is off by 3e-6 to 4e-2 of the
  inflow, the more the wider the spread, and from 3,000 pores at 16 decades the imbalances add up to more than the
  inflow. With multigrid every factor of 100 costs four steps, some 20 % of the time, and brings a factor of 100:
  there is no knee before rounding. So fdnet stops by the sum of imbalances over the inflow, which bounds the inflow's
  error.
- **Where the error does not fall with cost**: direct solves hold pressures to rounding, so a throat's flux to
  rounding times its conductance over the critical one: 1e-12 (intact), 1e-8 (16 decades) at 200 pores, imbalances of
  1e-5 at 100,000, which fdnet's check would refuse. No tolerance mends that; contracting stiff groups does, to 1e-11
  and less, and is the reason for `stiff.py`. Iterative methods end at the same floor.
- **CG with Jacobi** needs 1,500 steps at 100,000 intact pores and more than 20,000 from 8 decades on; **smoothed
  aggregation** 94 and 884, and does not end within 1,000 from 12 decades on (3,000 pores and more). Where they do
  end, the inflow itself can be off by a factor (3.6: CG with Jacobi, 3,000 pores, 16 decades). **spsolve** is the
  fastest below 2,000 pores and grows as n^2.4 beyond 9,000.
- **fdnet's constants.** Direct and multigrid (with the whole chain around them) break even at 1,800 pores (intact, 8
  decades) to 4,000 (16 decades); at 3,000 either is within a fifth of the other, so direct up to 3,000 (5,000 before:
  up to 1.4 times slower). Scaled to a unit diagonal, multigrid takes 135 steps for 12 at 100,000 pores. A direct
  solve there adds 0.48 GB where fdnet's estimate, 55 n^1.41, says 0.58. At a million pores it was stopped after 300 s
  by the clock, on a machine whose two cores others used too; by its growth (n^1.6) it would take 150 core seconds
  and, by the estimate, 15 GB.
"""

STUDY = Study(
    name="linear-solver",
    title="Solve of the pore network",
    knob_label="tolerance",
    points=points,
    measure=measure,
    judge=judge,
    panels=(
        _error_panel(
            SMALL, 0.0, "worst throat", "worst throat flux, 200 pores, intact (against 80 digits)"
        ),
        _error_panel(
            SMALL,
            8.0,
            "worst throat",
            "worst throat flux, 200 pores, 8 decades (against 80 digits)",
        ),
        _error_panel(
            SMALL,
            16.0,
            "worst throat",
            "worst throat flux, 200 pores, 16 decades (against 80 digits)",
        ),
        _error_panel(100_000, 8.0, "residual", "sum of imbalances, 100,000 pores, 8 decades"),
        _cost_panel(CORE, 0.0, "time by size, intact"),
        _cost_panel(CORE, 8.0, "time by size, 8 decades"),
    ),
    defaults={
        series_of(FDNET, pores, decades): OWN
        for pores in (SMALL, 1_000, 3_000, 10_000, 30_000, 100_000, 1_000_000)
        for decades in DECADES
    },
    remarks=REMARKS,
    isolated=lambda point: float(point.settings["pores"]) > IN_PROCESS,
    seconds=300.0,
)
