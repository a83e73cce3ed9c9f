"""The flow through a finished run, state by state: fluxes of its throats, or streamlines."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.names import SECTION_ARCHIE
from fdnet.network.field.of_pack import velocity_field
from fdnet.network.field.streamlines import streamlines
from fdnet.network.fines.invaded import cake_of
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.flow import Flow, solve_flow
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS, damage_law
from fdnet.run.finished import FinishedRun
from fdnet.spheres.images import wrapped
from fdnet.spheres.snapshot import Array, Snapshot

LINES = 200
"""About so many streamlines, evenly spaced in the mud: each carries the same flow."""
CELLS = 14.0
"""Cells across a grain: fewer lose more lines among the fines, more take minutes."""
STEP, AHEAD = 0.02, 0.3
"""Step along a streamline, and how far before the deposit it begins, in diameters of a grain."""
BRIGHTEST, DECADES = 99.5, 2.0
"""Percentile of the first values at which the colours end, and how many decades they show."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FlowState:
    """The flow at one state, ready to be drawn.

    Attributes:
        values: what is coloured, one array.
        k_over_k0: permeability over that of the clean specimen; None where it is not measured.
        write: writes the lines with their values to a path.
    """

    values: Array
    k_over_k0: float | None
    write: Callable[[Path], Any]


FlowOf = Callable[[Snapshot, float | None], FlowState]
"""From the fines (none: the clean specimen) and the rate over the first (None: not known)."""


def flux_of(run: FinishedRun) -> FlowOf:
    """The flux of each throat in percent of the first flow through the specimen.

    The laws are those of the run; where it measured the damage in two ways, that of the throats.
    Where no rate is known it is the one at the first pressure drop. Fines that still move count
    as deposit.
    """
    from fdnet.report.vtk import write_flux_vtp

    network, choices = run.network(), run.case.analysis
    clean = LAWS[choices.law](network)
    first = solve_flow(network, clean)

    def flow_of(fines: Snapshot, rate: float | None) -> FlowState:
        flow = solve_flow(network, _damaged(fines)) if len(fines) else first
        k = flow.inflow / first.inflow if first.inflow > 0 else 0.0
        values = 100.0 * _share(flow) * (k if rate is None else rate)
        return FlowState(
            values=values,
            k_over_k0=k,
            write=lambda path: write_flux_vtp(path, network, values),
        )

    def _damaged(fines: Snapshot) -> Array:
        names = (str(run.summary.get(f"damage_law_{which}")) for which in ("other", "used"))
        law = damage_law(
            next((name for name in names if name in DAMAGE_LAWS), SECTION_ARCHIE),
            clogging_threshold=choices.clogging_threshold,
            middle_band=choices.middle_band,
        )
        occupancy = measure_occupancy(network, fines, overlap=choices.throat_overlap)
        return law(network, occupancy, clean).conductance

    return flow_of


def _share(flow: Flow) -> Array:
    """Flux (T,) over that through the specimen; 0 where nothing flows."""
    return np.abs(flow.throat_flux) / flow.inflow if flow.inflow > 0 else 0.0 * flow.throat_flux


def streamlines_of(run: FinishedRun, *, cells: float = CELLS) -> FlowOf:
    """Streamlines of the resolved flow around grains and deposit, with the speed of the fluid.

    The speed is over the first superficial velocity; where no rate is known, over the present
    one. The deposit is all fines in the specimen, and the cake.
    """
    from fdnet.report.vtk import write_lines_vtp

    grains, sides = run.spheres("initial").grains(), run.case.periodic

    def flow_of(fines: Snapshot, rate: float | None) -> FlowState:
        deposit = _deposit(grains, fines, sides)
        field = velocity_field(grains, periodic=sides, fines=deposit, cells=cells)
        diameter = 2.0 * float(grains.radius.mean())
        front = float(np.min(deposit.position[:, 0] - deposit.radius, initial=grains.box[0, 0]))
        start = _starts(grains.box, front - AHEAD * diameter)
        ways = streamlines(field, start, step=STEP * diameter, until=float(grains.box[0, 1]))
        pieces = [piece for way in ways for piece in _pieces(way, grains.box, sides)]
        present = 1.0 if rate is None else rate
        lines = [(piece, present * np.linalg.norm(field.at(piece), axis=1)) for piece in pieces]
        return FlowState(
            values=np.concatenate([values for _, values in lines]),
            k_over_k0=None,
            write=lambda path: write_lines_vtp(path, lines),
        )

    return flow_of


def _deposit(grains: Snapshot, fines: Snapshot, sides: tuple[bool, bool, bool]) -> Snapshot:
    if not len(fines):
        return fines
    within = fines.where(fines.position[:, 0] >= grains.box[0, 0])
    cake = cake_of(grains.joined(fines), sides)
    return within.joined(cake) if len(cake) else within


def _starts(box: Array, depth: float) -> Array:
    """Points (N, 3) m, evenly over the cross-section at x = `depth`."""
    (y0, y1), (z0, z1) = box[1:]
    apart = np.sqrt((y1 - y0) * (z1 - z0) / LINES)
    across, up = max(1, round((y1 - y0) / apart)), max(1, round((z1 - z0) / apart))
    y = y0 + (np.arange(across) + 0.5) * (y1 - y0) / across
    z = z0 + (np.arange(up) + 0.5) * (z1 - z0) / up
    at_y, at_z = np.meshgrid(y, z)
    return np.column_stack([np.full(at_y.size, depth), at_y.ravel(), at_z.ravel()])


def _pieces(way: Array, box: Array, sides: tuple[bool, bool, bool]) -> list[Array]:
    """A line (M, 3) m cut where it passes a periodic side, each piece inside the box."""
    inside = wrapped(way, box, sides)
    jump = np.any(np.abs(np.diff(inside - way, axis=0)) > 0.5 * np.ptp(box, axis=1), axis=1)
    return [piece for piece in np.split(inside, np.flatnonzero(jump) + 1) if len(piece) > 1]


def colour_limits(values: Array) -> tuple[float, float]:
    """Two decades below the largest values (N,), rounded to one digit; of values above 0."""
    most = float(np.percentile(values[values > 0], BRIGHTEST)) if np.any(values > 0) else 1.0
    digit = 10.0 ** np.floor(np.log10(most))
    high = float(np.ceil(most / digit) * digit)
    return high / 10.0**DECADES, high
