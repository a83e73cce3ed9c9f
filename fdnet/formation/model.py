"""Fines carried into a core or around a well, in one dimension: filtration, Darcy, a cake.

With the volume V that has flowed in since the start, the concentration c_i of a class (volume of
fines over volume of fluid) and its deposit s_i (volume of fines over bulk volume), at a depth
where the flow crosses the area A,

    phi dc_i/dV + A dc_i/dx / A = - ds_i/dV,    A ds_i/dV = rate_i (1 + growth_i s) c_i,

s being the deposit of all classes (Iwasaki 1937; Herzig, Leclerc and Le Goff 1970). Time does not
enter: it follows from Darcy's law, mu dV/dt R(V) = dp, where R is the resistance of cake, cells
and formation in series. Of the permeability k0 the deposit leaves k0 / (1 + damage s)^power (power
2: Mays and Hunt 2005). When the deposit at the face reaches `closing`, the solids that arrive
build a cake instead (Pang and Sharma 1997). The volume that deposit takes from the pores is left
out of phi. Derivations are on docs/theory/from_core_to_well.md.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_banded
from scipy.optimize import brentq

from fdnet.spheres.snapshot import Array

FINENESS = 0.05
"""Largest step over the volume since the last change, and of a deposit's effect at the face."""
_LANDED = 1e-10


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Column:
    """The way of the flow, straight or outwards from a well, in J cells.

    Attributes:
        edges: (J+1,) m, depths from the face, 0 first.
        area: m2, of the face.
        well: m, radius of the face; infinite for a straight core.
        outer: m, depth where the pressure is held; sound rock lies between the last edge and it.
    """

    edges: Array
    area: float
    well: float = math.inf
    outer: float = 0.0

    @property
    def width(self) -> Array:
        """(J,) m."""
        return np.diff(self.edges)

    @property
    def volume(self) -> Array:
        """(J,) m3 of each cell."""
        return self.area * self.width * (1.0 + (self.edges[1:] + self.edges[:-1]) / 2 / self.well)

    def reach(self, depth: Any) -> Array:
        """Integral of dx / A from the face to depths (N,) m, 1/m; over k it is a resistance."""
        x = np.asarray(depth, float)
        way = x if math.isinf(self.well) else np.log1p(x / self.well) * self.well
        return np.asarray(way / self.area)


def steep_grid(length: float, cells: int, first: float) -> Array:
    """(J+1,) edges, m, of cells that grow by one factor from `first` m at the face."""
    if first * cells >= length:
        return np.linspace(0.0, length, cells + 1)

    def excess(growth: float) -> float:
        return first * math.expm1(cells * growth) / math.expm1(growth) - length

    growth = brentq(excess, 1e-9, 700.0 / cells)
    edges = np.expm1(growth * np.arange(cells + 1))
    return edges * (length / edges[-1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Rock:
    """Sound rock, and what a deposit s does to it: k = permeability / (1 + damage s)^power."""

    porosity: float
    permeability: float
    damage: float
    power: float = 2.0

    def loss(self, deposit: Array) -> Array:
        """k0 / k of deposits (C, J) of all classes; (J,)."""
        return (1.0 + self.damage * np.sum(deposit, axis=0)) ** self.power


class FineClass(NamedTuple):
    """Fines that are filtered alike.

    Attributes:
        name: of the class.
        concentration: volume of its fines over volume of mud.
        rate: 1/m, filtration coefficient of clean rock.
        growth: relative growth of the rate with the deposit s of all classes; below 0 it falls.
    """

    name: str
    concentration: float
    rate: float
    growth: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CakeOf:
    """What a cake is: porosity, permeability (m2), and its shape as `cake_skin` names it."""

    porosity: float
    permeability: float
    shape: str = "linear"


class Flood(NamedTuple):
    """What drives the flow for so many `seconds`: `pressure` Pa or `rate` m3/s, below 0 back."""

    seconds: float
    pressure: float = math.nan
    rate: float | None = None

    def flow(self, resistance: float) -> float:
        """m3/s through a resistance in Pa s/m3."""
        return self.pressure / resistance if self.rate is None else self.rate


class Release(NamedTuple):
    """Deposit that back-flow takes away: a `share` of it, decaying by `rate` 1/m of its flow."""

    share: float
    rate: float


NO_RELEASE = Release(0.0, 0.0)


def cake_skin(shape: str, thickness: float, well: float) -> float:
    """Skin of a cake as permeable as the formation; times k / k_c it is that of the cake.

    Args:
        shape: "linear": h / r; "radial": ln(sqrt(r^2 + 2 r h) / r), "linrad": ln((r + h) / r),
            as OPM Flow has them; "inward": ln(r / sqrt(r^2 - 2 r h)), a cake inside the well.
        thickness: h, m: volume of the cake over the area of the face.
        well: r, m.
    """
    ratio = thickness / well
    if shape in ("linear", "linrad"):
        return ratio if shape == "linear" else math.log1p(ratio)
    if shape == "radial":
        return 0.5 * math.log1p(2 * ratio)
    return -0.5 * math.log1p(-2 * ratio) if 2 * ratio < 1 else math.inf


def damage_skin(column: Column, loss: Array) -> float:
    """Integral of (k0 / k - 1) dr / r over the cells, `loss` being k0 / k (J,)."""
    over_r = np.diff(column.reach(column.edges)) * column.area / column.well
    return float(np.sum((loss - 1.0) * over_r))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Filled:
    """Where the fines of C classes are, in J cells.

    Attributes:
        suspended, deposit: (C, J) volume of fines over that of fluid, and over bulk volume.
        held: (C, J) part of the deposit that back-flow cannot take.
        face: deposit of all classes at the face itself.
        cake, supplied, passed, returned: (C,) m3 of fines in the cake, supplied with the mud, out
            of the far end, out of the face.
    """

    suspended: Array
    deposit: Array
    held: Array
    face: float
    cake: Array
    supplied: Array
    passed: Array
    returned: Array

    def kept(self, column: Column, rock: Rock) -> Array:
        """(C,) m3 of fines inside and in the cake."""
        inside = (rock.porosity * self.suspended + self.deposit) @ column.volume
        return np.asarray(inside + self.cake)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class March:
    """What `march` gives, at N moments, in S sections, for C classes.

    Attributes:
        time, filtrate: (N,) s and m3 (what flowed in less what flowed back).
        rate, pressure: (N,) m3/s and Pa, of the whole way.
        parts: (N, S+2) Pa, lost in the cake, each section, and behind the sections.
        k_over_k0: (N, S) of the sections.
        effluent: (N, C) volume of fines over volume of fluid that leaves.
        end: the last state.
        closed_at: s, when the cake began first; None: never.
        stopped: "" at the end of the drives; "closed" where the face closed and the cake is not
            known, "full" where the cake filled the well.
    """

    time: Array
    filtrate: Array
    rate: Array
    pressure: Array
    parts: Array
    k_over_k0: Array
    effluent: Array
    end: Filled
    closed_at: float | None
    stopped: str


def march(
    column: Column,
    rock: Rock,
    mud: Sequence[FineClass],
    drives: Sequence[Flood],
    viscosity: float,
    *,
    cake: CakeOf | None = None,
    closing: float = math.inf,
    release: Release = NO_RELEASE,
    taps: Array | None = None,
    fineness: float = FINENESS,
) -> March:
    """The mud of the classes driven through the column, from clean rock on.

    Args:
        column: the way of the flow.
        rock: porosity, permeability and damage.
        mud: its classes.
        drives: one after the other; a back-flow lifts the cake first.
        viscosity: Pa s.
        cake: what the solids build on the closed face; None: the march ends when it closes.
        closing: deposit of the face at which it closes; 0: at once, infinite: never.
        release: what back-flow takes away.
        taps: (S+1,) m, depths between which sections are measured; by default the ends.
        fineness: largest relative step; the error falls with it to first order.
    """
    cells, none = np.zeros((len(mud), len(column.width))), np.zeros(len(mud))
    state = Filled(
        **dict.fromkeys(("suspended", "deposit", "held"), cells),
        **dict.fromkeys(("cake", "supplied", "passed", "returned"), none),
        face=0.0,
    )
    taps = column.edges[[0, -1]] if taps is None else np.asarray(taps, float)
    resistances = partial(_resistances, column=column, rock=rock, cake=cake, taps=taps)
    small = fineness / 10 * rock.porosity * float(column.volume.sum())
    time, filtrate, closed_at, stopped = 0.0, 0.0, None, ""
    parts, rows = resistances(state), list[tuple[Any, ...]]()
    for drive in drives:
        end, since = time + drive.seconds, 0.0
        back = (drive.pressure if drive.rate is None else drive.rate) < 0
        if back:
            held = np.maximum(state.held, (1 - release.share) * state.deposit)
            returned = state.returned + state.cake
            state = replace(state, returned=returned, cake=none, held=held)
            parts = resistances(state)
        if not rows:
            flow = drive.flow(viscosity * parts.sum())
            rows.append((time, filtrate, flow, viscosity * flow * parts, none))
        while time < end:
            shut = not back and state.face >= closing
            if shut:
                closed_at = time if closed_at is None else closed_at
                stopped = "" if cake else "closed"
            if stopped:
                break
            step, to_closing = fineness * since + small, math.inf
            if not back and not shut:
                most, to_closing = _until(state, column, rock, mud, closing, fineness)
                step = min(step, most, to_closing)
            for _ in range(60):
                if back:
                    after, effluent = _backward(state, column, rock, release, step)
                else:
                    after, effluent = _forward(state, column, rock, mud, cake, shut, step)
                new = resistances(after)
                if not np.isfinite(new).all():
                    break
                seconds = step / abs(drive.flow(viscosity * (parts + new).sum() / 2))
                early = (end - time - seconds) / drive.seconds
                if early >= -_LANDED:
                    break
                step *= (end - time) / seconds
            if not np.isfinite(new).all():
                stopped = "full"
                break
            time = end if early <= _LANDED else time + seconds
            filtrate, since = filtrate + (-step if back else step), since + step
            if step == to_closing:
                after, since = replace(after, face=closing), 0.0
            state, parts = after, new
            flow = drive.flow(viscosity * parts.sum())
            rows.append((time, filtrate, flow, viscosity * flow * parts, effluent))
    times, volumes, rates, drops, effluents = (np.array(one) for one in zip(*rows, strict=True))
    clean = np.diff(column.reach(taps)) / rock.permeability
    return March(
        time=times,
        filtrate=volumes,
        rate=rates,
        pressure=drops.sum(axis=1),
        parts=drops,
        k_over_k0=clean * viscosity * rates[:, None] / drops[:, 1:-1],
        effluent=effluents,
        end=state,
        closed_at=closed_at,
        stopped=stopped,
    )


def _resistances(
    state: Filled, column: Column, rock: Rock, cake: CakeOf | None, taps: Array
) -> Array:
    """(S+2,) resistances over viscosity, 1/m3, of cake, sections and the rest of the way.

    That of a cake which fills the well is infinite.
    """
    reach, at = column.reach(column.edges), column.reach(taps)
    cells = np.append(0.0, np.cumsum(np.diff(reach) * rock.loss(state.deposit)))
    inside = np.interp(at, reach, cells)
    outer = float(column.reach(max(column.outer, column.edges[-1])) - reach[-1])
    own = 0.0
    if cake and state.cake.any():
        thick = state.cake.sum() / ((1 - cake.porosity) * column.area)
        own = thick / column.area
        if math.isfinite(column.well):
            own = cake_skin(cake.shape, thick, column.well) * column.well / column.area
        own *= rock.permeability / cake.permeability
    ends = cells[-1] - inside[-1] + outer
    return np.array([own, *np.diff(inside), ends]) / rock.permeability


def _until(
    state: Filled,
    column: Column,
    rock: Rock,
    mud: Sequence[FineClass],
    closing: float,
    fineness: float,
) -> tuple[float, float]:
    """Volume m3 in which the face changes little, and that until it closes (infinite: never)."""
    start = sum(one.rate * (1 + one.growth * state.face) * one.concentration for one in mud)
    slope = sum(one.rate * one.growth * one.concentration for one in mud)
    limits = [2 * fineness / abs(slope)] if slope else []
    if start > 0 and rock.damage > 0:
        limits.append(fineness * (1 / rock.damage + state.face) / rock.power / start)
    full = (closing - state.face) / start if start > 0 else math.inf
    if slope:
        full = math.log1p(full * slope) / slope if full * slope > -1 else math.inf
    return column.area * min(limits, default=math.inf), column.area * full


def _forward(
    state: Filled,
    column: Column,
    rock: Rock,
    mud: Sequence[FineClass],
    cake: CakeOf | None,
    shut: bool,
    volume: float,
) -> tuple[Filled, Array]:
    """The state after a `volume` m3 of inflow, and the mean effluent (C,).

    The filtration coefficients are those of the deposit half-way. Through a shut face no fines
    enter; the mud whose place the cake takes brings its own solids.
    """
    _, solids, rate, growth = (np.array(one) for one in zip(*mud, strict=True))
    if shut and cake:
        free = 1 - cake.porosity
        built = free * solids / (free - solids.sum()) * volume
        state = replace(state, cake=state.cake + built, supplied=state.supplied + built)
        if not state.suspended.any():
            return state, np.zeros(len(mud))
        solids = 0.0 * solids
    first, pores = np.eye(1, len(column.width))[0], rock.porosity * column.volume
    total = before = state.deposit.sum(axis=0)
    for _ in range(2 if growth.any() else 1):
        catch = rate[:, None] * (1 + growth[:, None] * total) * column.width
        out, last = _sweep(solids[:, None] * first, state.suspended, pores, catch, volume)
        caught = np.expm1(catch) * out * volume / column.volume
        total = before + caught.sum(axis=0) / 2
    start = float(np.sum(rate * (1 + growth * state.face) * solids)) * volume / column.area
    slope = float(np.sum(rate * growth * solids)) * volume / column.area
    after = replace(
        state,
        suspended=last,
        deposit=state.deposit + caught,
        face=state.face + start * (math.expm1(slope) / slope if slope else 1.0),
        supplied=state.supplied + solids * volume,
        passed=state.passed + out[:, -1] * volume,
    )
    return after, out[:, -1]


def _backward(
    state: Filled, column: Column, rock: Rock, release: Release, volume: float
) -> tuple[Filled, Array]:
    """The state after a `volume` m3 has flowed back, and the mean that leaves the face (C,)."""
    pores = rock.porosity * column.volume
    gone = -np.expm1(-release.rate * column.width / column.volume * volume)
    freed = (state.deposit - state.held) * gone
    inflow, none = freed * column.volume / volume, np.zeros_like(freed)
    out, last = _sweep(inflow[:, ::-1], state.suspended[:, ::-1], pores[::-1], none, volume)
    loose = release.share * -math.expm1(-release.rate * volume / column.area)
    after = replace(
        state,
        suspended=last[:, ::-1],
        deposit=state.deposit - freed,
        face=state.face * (1 - loose),
        returned=state.returned + out[:, -1] * volume,
    )
    return after, out[:, -1]


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
