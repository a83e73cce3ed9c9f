"""Method and tolerance of the network's solve, by size and spread of the conductances."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from fdnet.spheres.snapshot import Array
from validation.engine.runner import forget_peak, peak_memory
from validation.engine.study import DONE, Measured, Panel, Point, Row, Study, row_of
from validation.engine.timing import least_time
from validation.network.circuit import Circuit, circuit_of, exact_fluxes
from validation.network.solver_peers import (
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
    """Small networks with every method and tolerance, then sizes; fdnet's own method first.

    It is the reference of the others.
    """
    chosen = list(
        _small(
            1 if quick else SEEDS,
            (0.0, 8.0, 16.0) if quick else DECADES,
            TOLERANCES[:: 2 if quick else 1],
        )
    )
    if quick:
        return [*chosen, *(_point(method, 1_000, 8.0) for method in (FDNET, DIRECT, RUGE_STUBEN))]
    return [*chosen, *_sizes()]


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
    observed = {
        "pores": float(circuit.count),
        "inflow": inflow,
        "residual": circuit.imbalance(flux) / inflow,
        "mass balance": abs(circuit.outflow(flux) / inflow - 1.0),
    }
    known = work / f"fluxes_{pores}_{decades:g}_{point.seed}.npy"
    if pores <= SMALL:
        observed |= _against(circuit, flux, _exact(pores, float(decades), point.seed, work))
    elif method == FDNET:
        np.save(known, flux)
    elif known.exists():
        observed |= _against(circuit, flux, np.load(known))
    return observed | costs | {"steps": solved.steps}


def _timed(method: str, circuit: Circuit, tolerance: float) -> tuple[Solved, dict[str, float]]:
    """The solve with its core seconds, the least of three where it is quick, and peak memory."""
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
    """Relative errors of the inflow, the worst throat, the residual and the mass balance.

    The last three are over the inflow. Further rows hold the costs of solves to the usual
    tolerance, by size.
    """
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
    uncertainty = run.observed.get("residual, reference", nan)
    truth = run.observed.get("inflow, reference", nan)
    errors = dict(run.observed) | {"inflow": run.observed["inflow"] / truth - 1.0}
    for name in QUANTITIES:
        if name in errors:
            yield row_of(
                run,
                name,
                error=errors[name],
                uncertainty=uncertainty if name in QUANTITIES[:2] else 0.0,
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
    isolated=lambda point: float(point.settings["pores"]) > IN_PROCESS,
    seconds=300.0,
)
