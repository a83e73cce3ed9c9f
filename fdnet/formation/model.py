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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

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

    def reach(self, depth: Array) -> Array:
        """Integral of dx / A from the face to depths (N,) m, 1/m; over k it is a resistance."""
        if math.isinf(self.well):
            return np.asarray(depth) / self.area
        return np.log1p(np.asarray(depth) / self.well) * self.well / self.area

    @property
    def behind(self) -> float:
        """Reach of the sound rock behind the cells, 1/m."""
        first, last = self.reach(np.array([self.edges[-1], max(self.outer, self.edges[-1])]))
        return float(last - first)


def plain_grid(length: float, cells: int) -> Array:
    """(J+1,) edges of equal cells, m."""
    return np.linspace(0.0, length, cells + 1)


def steep_grid(length: float, cells: int, first: float) -> Array:
    """(J+1,) edges, m, of cells that grow by one factor from `first` m at the face."""
    if first * cells >= length:
        return plain_grid(length, cells)

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


class Drive(NamedTuple):
    """What drives the flow for so many `seconds`: `pressure` Pa or `rate` m3/s, below 0 back."""

    seconds: float
    pressure: float | None = None
    rate: float | None = None


class Release(NamedTuple):
    """Deposit that back-flow takes away: a `share` of it, decaying by `rate` 1/m of its flow."""

    share: float
    rate: float


def cake_skin(shape: str, thickness: float, well: float) -> float:
    """Skin of a cake as permeable as the formation; times k / k_c it is that of the cake.

    Args:
        shape: "linear": h / r; "radial": ln(sqrt(r^2 + 2 r h) / r), "linrad": ln((r + h) / r),
            as OPM Flow has them; "inward": ln(r / sqrt(r^2 - 2 r h)), a cake inside the well.
        thickness: h, m: volume of the cake over the area of the face.
        well: r, m.
    """
    ratio = 0.0 if math.isinf(well) else thickness / well
    if shape == "linear":
        return ratio
    if shape == "linrad":
        return math.log1p(ratio)
    return 0.5 * (math.log1p(2 * ratio) if shape == "radial" else -math.log1p(-2 * ratio))


def damage_skin(column: Column, loss: Array) -> float:
    """Integral of (k0 / k - 1) dr / r over the cells, `loss` being k0 / k (J,)."""
    over_r = np.diff(column.reach(column.edges)) * column.area / column.well
    return float(np.sum((loss - 1.0) * over_r))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class State:
    """Where the fines of C classes are, in J cells.

    Attributes:
        suspended: (C, J) volume of fines over volume of fluid.
        deposit: (C, J) volume of fines over bulk volume.
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
    end: State
    closed_at: float | None
    stopped: str


def _sweep(
    inflow: Array, held: Array, pores: Array, catch: Array, volume: float
) -> tuple[Array, Array]:
    """Mean outflow and last concentration (J,) of cells in the order of the flow.

    In each cell, of pore volume p, the flow of a `volume` V obeys p dc/dV = in - e^h c, h being
    `catch` = rate times width: exact where nothing changes. `inflow` is what enters a cell other
    than from the cell before; the mean outflow of that is passed on.
    """
    exponent = np.exp(catch)
    decay = exponent * volume / pores
    left = -np.expm1(-decay)
    stay = left / decay
    mean = (1.0 - stay) / exponent
    bands = np.stack([np.ones_like(mean), np.append(-mean[1:], 0.0)])
    outflow = solve_banded((1, 0), bands, held * stay + mean * inflow)
    entered = inflow + np.append(0.0, outflow[:-1])
    return outflow, entered * left / exponent + held * np.exp(-decay)


def _forward(
    state: State, column: Column, rock: Rock, mud: Sequence[FineClass], open_: bool, volume: float
) -> tuple[State, Array]:
    """The state after a `volume` m3 of inflow, and the mean effluent (C,); deposit half-way."""
    pores, area, first = rock.porosity * column.volume, column.area, np.eye(len(column.width))[0]
    rate, growth, c0 = (np.array([one[i] for one in mud]) for i in (2, 3, 1))
    c0 = c0 if open_ else np.zeros_like(c0)
    deposit = total = state.deposit.sum(axis=0)
    for _ in range(2):
        catch = rate[:, None] * (1.0 + growth[:, None] * total) * column.width
        swept = [
            _sweep(c * first, old, pores, one, volume)
            for c, old, one in zip(c0, state.suspended, catch, strict=True)
        ]
        outflow, last = (np.stack(part) for part in zip(*swept, strict=True))
        caught = np.expm1(catch) * outflow * volume / column.volume
        total = deposit + caught.sum(axis=0) / 2
    slope = np.sum(rate * growth * c0) / area * volume
    begin = np.sum(rate * (1.0 + growth * state.face) * c0) / area * volume
    after = replace(
        state,
        suspended=last,
        deposit=state.deposit + caught,
        face=state.face + begin * (math.expm1(slope) / slope if slope else 1.0),
        supplied=state.supplied + c0 * volume,
        passed=state.passed + outflow[:, -1] * volume,
    )
    return after, outflow[:, -1]


def _backward(
    state: State, column: Column, rock: Rock, release: Release, volume: float
) -> tuple[State, Array]:
    """The state after a `volume` m3 has flowed back, and the mean that leaves the face (C,)."""
    pores, none = rock.porosity * column.volume, np.zeros(len(column.width))
    gone = -np.expm1(-release.rate * column.width / column.volume * volume)
    freed = (state.deposit - state.held) * gone
    swept = [
        _sweep(one[::-1], old[::-1], pores[::-1], none, volume)
        for one, old in zip(freed * column.volume / volume, state.suspended, strict=True)
    ]
    outflow, last = (np.stack(part)[:, ::-1] for part in zip(*swept, strict=True))
    loose = release.share * -math.expm1(-release.rate * volume / column.area)
    after = replace(
        state,
        suspended=last,
        deposit=state.deposit - freed,
        face=state.face * (1.0 - loose),
        returned=state.returned + outflow[:, 0] * volume,
    )
    return after, outflow[:, 0]


def march(
    column: Column,
    rock: Rock,
    mud: Sequence[FineClass],
    drives: Sequence[Drive],
    viscosity: float,
    *,
    cake: CakeOf | None = None,
    closing: float = math.inf,
    release: Release = Release(0.0, 0.0),
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
    cells = np.zeros((len(mud), len(column.width)))
    none = np.zeros(len(mud))
    state = State(
        **dict.fromkeys(("suspended", "deposit", "held"), cells),
        **dict.fromkeys(("cake", "supplied", "passed", "returned"), none),
        face=0.0,
    )
    taps = column.edges[[0, -1]] if taps is None else np.asarray(taps, float)
    solids = np.array([one.concentration for one in mud])
    reach = np.diff(column.reach(column.edges))
    sound = np.diff(column.reach(taps))
    full = math.inf
    if cake and cake.shape == "inward" and math.isfinite(column.well):
        full = 0.5 * column.well * (1 - 1e-3)

    def parts_of(state: State) -> Array:
        """(S+2,) resistances 1/m3 of cake, sections and the rest."""
        cells = np.append(0.0, np.cumsum(reach * rock.loss(state.deposit)))
        at = np.interp(column.reach(taps), column.reach(column.edges), cells)
        rest = cells[-1] - at[-1] + column.behind
        own = 0.0
        if cake and state.cake.any():
            thick = state.cake.sum() / ((1 - cake.porosity) * column.area)
            unit = cake_skin(cake.shape, thick, column.well) * column.well / column.area
            unit = thick / column.area if math.isinf(column.well) else unit
            own = unit / cake.permeability
        return np.array([own, *(np.diff(at) / rock.permeability), rest / rock.permeability])

    time, filtrate, closed_at, stopped = 0.0, 0.0, None, ""
    rows: list[tuple[float, float, float, float, Array, Array]] = []

    def note(drive: Drive, effluent: Array) -> None:
        parts = parts_of(state)
        whole = viscosity * parts.sum()
        flow = drive.pressure / whole if drive.rate is None else drive.rate
        rows.append((time, filtrate, flow, flow * whole, flow * viscosity * parts, effluent))

    for drive in drives:
        end, back = time + drive.seconds, (drive.rate or drive.pressure or 0.0) < 0
        since = 0.0
        if back:
            state = replace(
                state,
                returned=state.returned + state.cake,
                cake=none,
                held=np.maximum(state.held, (1 - release.share) * state.deposit),
            )
        if not rows:
            note(drive, none)
        while time < end and not stopped:
            shut = not back and state.face >= closing * (1 - 1e-12)
            if shut and closed_at is None:
                closed_at = time
            if shut and cake is None:
                stopped = "closed"
                break
            step, to_closing = _largest(state, column, rock, mud, closing, since, fineness)
            step = step if back or shut else min(step, to_closing)
            before = parts_of(state).sum()
            for _ in range(60):
                if back:
                    after, effluent = _backward(state, column, rock, release, step)
                else:
                    after, effluent = _forward(state, column, rock, mud, not shut, step)
                if shut and cake:
                    built = (1 - cake.porosity) * solids / (1 - cake.porosity - solids.sum()) * step
                    built = replace(
                        after, cake=after.cake + built, supplied=after.supplied + built
                    )
                    after = built
                whole = viscosity * (before + parts_of(after).sum()) / 2
                flow = drive.pressure / whole if drive.rate is None else drive.rate
                seconds = step / abs(flow)
                over = (time + seconds - end) / drive.seconds
                if over <= _LANDED:
                    break
                step *= (end - time) / seconds
            if shut and cake and after.cake.sum() / ((1 - cake.porosity) * column.area) > full:
                stopped = "full"
                break
            state, since = after, since + step
            time = end if over > -_LANDED else time + seconds
            filtrate += -step if back else step
            if not shut and not back and step == to_closing:
                since, state = 0.0, replace(state, face=closing)
            note(drive, effluent)
    columns = zip(*rows, strict=True)
    times, volumes, rates, pressures, parts, effluents = (np.array(one) for one in columns)
    inner = parts[:, 1:-1] / (viscosity * rates[:, None])
    return March(
        time=times,
        filtrate=volumes,
        rate=rates,
        pressure=pressures,
        parts=parts,
        k_over_k0=sound / rock.permeability / inner,
        effluent=effluents,
        end=state,
        closed_at=closed_at,
        stopped=stopped,
    )


def _largest(
    state: State,
    column: Column,
    rock: Rock,
    mud: Sequence[FineClass],
    closing: float,
    since: float,
    fineness: float,
) -> tuple[float, float]:
    """Volume m3 of the next step, and that until the face closes (infinite: never)."""
    start = sum(one.rate * (1 + one.growth * state.face) * one.concentration for one in mud)
    slope = sum(one.rate * one.growth * one.concentration for one in mud)
    area = column.area
    limits = [fineness * since + fineness * rock.porosity * float(column.volume.sum()) / 10]
    limits += [2 * fineness * area / abs(slope)] if slope else []
    if start > 0 and rock.damage > 0:
        limits.append(fineness * (1 / rock.damage + state.face) / rock.power * area / start)
    if start <= 0 or math.isinf(closing):
        return min(limits), math.inf
    full = (closing - state.face) / start
    if slope and 1 + full * slope <= 0:
        return min(limits), math.inf
    return min(limits), area * (math.log1p(full * slope) / slope if slope else full)
