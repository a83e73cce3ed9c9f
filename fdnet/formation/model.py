"""Fines carried into a core or around a well, in one dimension: filtration, Darcy, a cake.

The volume V that has flowed in takes the place of time (Iwasaki 1937; Herzig, Leclerc and Le Goff
1970): at a depth where the flow crosses the area A,

    phi dc_i/dV + dc_i/dx / A = - ds_i/dV,    A ds_i/dV = rate_i (1 + growth_i s) c_i.

Formulas, sources and cells are derived on docs/theory/from_core_to_well.md.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_banded

from fdnet.spheres.snapshot import Array

FINENESS = 0.05
"""Largest step over the volume since the last change, and of a deposit's effect at the face."""
_LANDED = 1e-10


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Column:
    """The way of the flow, straight or outwards from a well, in J cells."""

    edges: Array  # (J+1,) m, depths from the face, 0 first
    area: float  # m2, of the face
    well: float = math.inf  # m, radius of the face; infinite for a straight core
    outer: float = 0.0  # m, depth where the pressure is held; sound rock up to it

    @property
    def volume(self) -> Array:
        """(J,) m3 of each cell."""
        middle = (self.edges[1:] + self.edges[:-1]) / 2
        return self.area * np.diff(self.edges) * (1.0 + middle / self.well)

    def reach(self, depth: Any) -> Array:
        """Integral of dx / A from the face to depths (N,) m, 1/m; over k it is a resistance."""
        x = np.asarray(depth, float)
        way = x if math.isinf(self.well) else np.log1p(x / self.well) * self.well
        return np.asarray(way / self.area)


def steep_grid(length: float, cells: int, scale: float) -> Array:
    """(J+1,) edges, m, of cells that grow by one factor, slowly within `scale` m of the face."""
    return np.geomspace(scale, scale + length, cells + 1) - scale


class FineClass(NamedTuple):
    """Fines that are filtered alike."""

    name: str
    concentration: float  # their volume over that of the mud
    rate: float  # 1/m, the filtration coefficient of clean rock
    growth: float = 0.0  # its relative growth with the deposit of all classes


@dataclass(frozen=True, slots=True, kw_only=True)
class Medium:
    """A rock and a mud as the model knows them, SI units."""

    porosity: float  # of sound rock
    permeability: float  # m2, of sound rock; a deposit s leaves 1 / (1 + damage s)^power of it
    damage: float = 0.0
    power: float = 2.0
    viscosity: float = 1e-3  # Pa s
    mud: tuple[FineClass, ...] = ()
    closing: float = math.inf  # deposit of the face that closes it; 0: at once, infinite: never
    cake_porosity: float = 0.5
    # m2, of what the solids build on the closed face; without it nothing is known from then on
    cake_permeability: float | None = None
    released: float = 0.0  # share of the deposit that back-flow can take away
    release_rate: float = 0.0  # 1/m, how fast it decays with the back-flow over the area

    @property
    def solids(self) -> float:
        """Volume of all fines over that of the mud."""
        return sum(one.concentration for one in self.mud)

    def loss(self, deposit: Array) -> Array:
        """k0 / k of a deposit (J,) of all classes."""
        return (1.0 + self.damage * deposit) ** self.power


class Flood(NamedTuple):
    """What drives the flow for so many `seconds`: `pressure` Pa or `rate` m3/s, below 0 back."""

    seconds: float
    pressure: float = math.nan
    rate: float | None = None

    def flow(self, resistance: float) -> float:
        """m3/s through a resistance in Pa s/m3."""
        return self.pressure / resistance if self.rate is None else self.rate


def cake_skin(shape: str, thickness: float, well: float) -> float:
    """Skin of a cake as permeable as the formation; times k / k_c it is that of the cake.

    For its thickness h m (volume over the face) at a well of radius r m: "linear" h / r, "radial"
    ln(sqrt(r^2 + 2 r h) / r), "linrad" ln((r + h) / r) as OPM Flow has them, and "inward"
    ln(r / sqrt(r^2 - 2 r h)), a cake inside the well.
    """
    ratio = thickness / well
    if shape in ("linear", "linrad"):
        return ratio if shape == "linear" else math.log1p(ratio)
    sign = 1 if shape == "radial" else -1
    return sign * math.log1p(sign * 2 * ratio) / 2 if sign * 2 * ratio > -1 else math.inf


def damage_skin(column: Column, loss: Array) -> float:
    """Integral of (k0 / k - 1) dr / r over the cells, `loss` being k0 / k (J,)."""
    over_r = np.diff(column.reach(column.edges)) * column.area / column.well
    return float((loss - 1.0) @ over_r)


class Filled(NamedTuple):
    """Where the fines of C classes are, in J cells."""

    suspended: Array  # (C, J) volume of fines over that of fluid
    deposit: Array  # (C, J) over bulk volume
    held: Array  # (C, J) the part of the deposit that back-flow cannot take
    face: float  # deposit of all classes at the face itself
    cake: Array  # (C,) m3


class March(NamedTuple):
    """What `march` gives, at N moments, in S sections, for C classes."""

    time: Array  # (N,) s
    filtrate: Array  # (N,) m3, what flowed in less what flowed back
    rate: Array  # (N,) m3/s
    parts: Array  # (N, S+2) Pa, lost in the cake, each section, and behind the sections
    k_over_k0: Array  # (N, S) of the sections
    effluent: Array  # (N, C) volume of fines over volume of fluid that leaves
    end: Filled  # the last state
    closed_at: float | None  # s, when the cake began first; None: never
    stopped: str  # "closed": the face did and its cake is not known; "full": the well is, of cake


def march(
    column: Column,
    medium: Medium,
    drives: Sequence[Flood],
    *,
    taps: Array | None = None,
    fineness: float = FINENESS,
) -> March:
    """The mud driven through the column by one of the `drives` after the other, from clean rock.

    A back-flow lifts the cake first. `taps` (S+1,) m are the depths between which sections are
    measured, by default the ends. `fineness` is the largest relative step; the error falls with
    it to first order.
    """
    none, mu = np.zeros(len(medium.mud)), medium.viscosity
    cells = np.zeros((len(none), len(column.edges) - 1))
    state = Filled(cells, cells, cells, 0.0, none)
    at = column.reach(column.edges[[0, -1]] if taps is None else taps)
    small = fineness / 10 * medium.porosity * float(column.volume.sum())
    time, filtrate, closed_at, stopped = 0.0, 0.0, None, ""
    parts, rows = _resistances(column, medium, at, state), list[tuple[Any, ...]]()
    for drive in drives:
        end, since, back = time + drive.seconds, 0.0, drive.flow(1.0) < 0
        if back:
            held = np.maximum(state.held, (1 - medium.released) * state.deposit)
            state = state._replace(cake=none, held=held)
            parts = _resistances(column, medium, at, state)
        if not rows:
            rows.append((time, filtrate, drive.flow(mu * parts.sum()), parts, none))
        while time < end and not stopped:
            shut = not back and state.face >= medium.closing
            if shut:
                closed_at = time if closed_at is None else closed_at
                if medium.cake_permeability is None:
                    stopped = "closed"
                    break
            step, to_closing = fineness * since + small, math.inf
            if not back and not shut:
                most, to_closing = _until(state, column, medium, fineness)
                step = min(step, most, to_closing)
            early = -math.inf
            while early < -_LANDED:
                after, effluent = _moved(state, column, medium, step, back, shut)
                new = _resistances(column, medium, at, after)
                if not np.isfinite(new).all():
                    stopped = "full"
                    break
                seconds, tried = step / abs(drive.flow(mu * (parts + new).sum() / 2)), step
                early = (end - time - seconds) / drive.seconds
                step *= min((end - time) / seconds, 1.0)
            if stopped:
                break
            time = end if early <= _LANDED else time + seconds
            filtrate, since = filtrate + (-tried if back else tried), since + tried
            if tried == to_closing:
                after, since = after._replace(face=medium.closing), 0.0
            state, parts = after, new
            rows.append((time, filtrate, drive.flow(mu * parts.sum()), parts, effluent))
    times, volumes, rates, met, effluents = (np.array(one) for one in zip(*rows, strict=True))
    kept = np.diff(at) / medium.permeability / met[:, 1:-1]
    drops = mu * rates[:, None] * met
    return March(times, volumes, rates, drops, kept, effluents, state, closed_at, stopped)


def _resistances(column: Column, medium: Medium, at: Array, state: Filled) -> Array:
    """(S+2,) resistances over viscosity, 1/m3, of cake, sections and the rest of the way.

    The sections lie between the `at` (S+1,), as `Column.reach`. A cake that fills the well has an
    infinite one.
    """
    reach, loss = column.reach(column.edges), medium.loss(state.deposit.sum(axis=0))
    cells = np.append(0.0, np.cumsum(np.diff(reach) * loss))
    inside = np.interp(at, reach, cells)
    outer = float(column.reach(max(column.outer, column.edges[-1])) - reach[-1])
    own = 0.0
    if medium.cake_permeability and state.cake.any():
        thick = state.cake.sum() / ((1 - medium.cake_porosity) * column.area)
        if math.isfinite(column.well):
            own = cake_skin("inward", thick, column.well) * column.well / column.area
        else:
            own = thick / column.area
        own *= medium.permeability / medium.cake_permeability
    return np.array([own, *np.diff(inside), cells[-1] - inside[-1] + outer]) / medium.permeability


def _at_the_face(medium: Medium, face: float) -> tuple[float, float]:
    """Area times ds/dV at the deposit `face`, and its slope with the deposit."""
    start = sum(one.rate * (1 + one.growth * face) * one.concentration for one in medium.mud)
    return start, sum(one.rate * one.growth * one.concentration for one in medium.mud)


def _until(state: Filled, column: Column, medium: Medium, fineness: float) -> tuple[float, float]:
    """Volume m3 in which the face changes little, and that until it closes (infinite: never)."""
    start, slope = _at_the_face(medium, state.face)
    limits = [2 * fineness / abs(slope)] if slope else []
    if start > 0 and medium.damage > 0:
        limits.append(fineness * (1 / medium.damage + state.face) / medium.power / start)
    full = (medium.closing - state.face) / start if start > 0 else math.inf
    if slope:
        full = math.log1p(full * slope) / slope if full * slope > -1 else math.inf
    return column.area * min(limits, default=math.inf), column.area * full


def _moved(
    state: Filled, column: Column, medium: Medium, volume: float, back: bool, shut: bool
) -> tuple[Filled, Array]:
    """The state after a `volume` m3 of flow, and the mean (C,) that leaves.

    The filtration coefficients are those of the deposit half-way. Through a shut face no fines
    enter; the mud whose place the cake takes brings its own solids.
    """
    _, solids, rate, growth = (np.array(one) for one in zip(*medium.mud, strict=True))
    width, bulk, inflow = np.diff(column.edges), column.volume, np.zeros_like(state.deposit)
    pores = medium.porosity * bulk
    if back:
        pace = medium.release_rate * volume
        freed = (state.deposit - state.held) * -np.expm1(-pace * width / bulk)
        source = (freed * bulk / volume)[:, ::-1]
        out, last = _sweep(source, state.suspended[:, ::-1], pores[::-1], inflow, volume)
        face = state.face * (1 + medium.released * math.expm1(-pace / column.area))
        deposit = state.deposit - freed
        return state._replace(suspended=last[:, ::-1], deposit=deposit, face=face), out[:, -1]
    start, slope = (one * volume / column.area for one in _at_the_face(medium, state.face))
    if shut:
        free = 1 - medium.cake_porosity
        built = free * solids / (free - solids.sum()) * volume
        state = state._replace(cake=state.cake + built)
        solids, start, slope = 0.0 * solids, 0.0, 0.0
    inflow[:, 0] = solids
    total = before = state.deposit.sum(axis=0)
    for _ in range(2 if growth.any() else 1):
        catch = rate[:, None] * (1 + growth[:, None] * total) * width
        out, last = _sweep(inflow, state.suspended, pores, catch, volume)
        caught = np.expm1(catch) * out * volume / bulk
        total = before + caught.sum(axis=0) / 2
    face = state.face + start * (math.expm1(slope) / slope if slope else 1.0)
    return state._replace(suspended=last, deposit=state.deposit + caught, face=face), out[:, -1]


def _sweep(
    inflow: Array, held: Array, pores: Array, catch: Array, volume: float
) -> tuple[Array, Array]:
    """Mean outflow and last concentration (C, J) of cells in the order of the flow.

    In each cell, of pore volume p, the flow of a `volume` V obeys p dc/dV = in - e^h c, h being
    `catch` = rate times width: exact where nothing changes. `inflow` is what enters a cell other
    than from the cell before; the mean outflow of that is passed on.
    """
    exponent = np.exp(catch)
    decay = exponent * volume / pores
    left = -np.expm1(-decay)
    stay = left / decay
    on = (1 - stay) / exponent
    out = np.empty_like(held)
    for one, (pass_on, own) in enumerate(zip(on, held * stay + on * inflow, strict=True)):
        bands = np.stack([np.ones_like(pass_on), np.append(-pass_on[1:], 0.0)])
        out[one] = solve_banded((1, 0), bands, own, check_finite=False)
    entered = inflow + np.pad(out[:, :-1], ((0, 0), (1, 0)))
    return out, entered * left / exponent + held * np.exp(-decay)
