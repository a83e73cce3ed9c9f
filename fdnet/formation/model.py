"""Fines carried into a core or around a well, in one dimension: filtration, Darcy, a cake.

The volume that has flowed in takes the place of time. Formulas, sources and cells are derived on
docs/theory/from_core_to_well.md.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_banded
from scipy.special import exprel

from fdnet.errors import FlowError
from fdnet.spheres.snapshot import Array

FINENESS, FINEST = 0.05, 1e-2  # Largest relative step; a march refines one above the second
TINY = 1e-12  # What is as good as nothing
STRAIGHT = 1e9  # m, radius of a face that is as good as plane: over 0.1 m it errs by 5e-11
FULL = "the cake of these fines alone fills the hole"
CLOSED = "the face has the deposit of the run's end, and its cake is not known"
CAKE_SKINS = {
    "linear": lambda h: h,
    "radial": lambda h: math.log1p(2 * h) / 2,
    "linrad": lambda h: math.log1p(h),
    "inward": lambda h: -math.log1p(-2 * h) / 2 if 2 * h < 1 else math.inf,
}
"""Skin of a cake as permeable as the rock, by its volume over the face and the well's radius.

Times k / k_c it is that of the cake. The first three are those of OPM Flow; inwards the cake
stands inside the well, which it fills at one half.
"""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Column:
    """The way of the flow outwards from a well, or along a straight core, in J cells."""

    edges: Array  # (J+1,) m, depths from the face, 0 first
    area: float  # m2, of the face
    well: float = STRAIGHT  # m, radius of the face
    outer: float = 0.0  # m, depth where the pressure is held; sound rock up to it

    @property
    def volume(self) -> Array:
        """(J,) m3 of each cell."""
        middle = (self.edges[1:] + self.edges[:-1]) / 2
        return self.area * np.diff(self.edges) * (1.0 + middle / self.well)

    def reach(self, depth: Any) -> Array:
        """Integral of dx / A from the face to depths (N,) m, 1/m; over k it is a resistance."""
        return np.log1p(np.asarray(depth) / self.well) * self.well / self.area

    def skin(self, loss: Array) -> float:
        """Integral of (k0 / k - 1) dr / r over the cells, `loss` being k0 / k (J,)."""
        over_r = np.diff(self.reach(self.edges)) * self.area / self.well
        return float((loss - 1.0) @ over_r)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Medium:
    """A rock and a mud of C classes of fines as the model knows them, SI units."""

    porosity: float  # of sound rock
    permeability: float  # m2, of sound rock; a deposit s leaves 1 / (1 + damage s)^power of it
    damage: float = 0.0
    power: float = 2.0
    viscosity: float = 1e-3  # Pa s
    names: tuple[str, ...] = ("all",)  # of the classes
    solids: Array  # (C,) their volume over that of the mud
    rate: Array  # (C,) 1/m, their filtration coefficient in clean rock
    growth: Array  # (C,) its relative growth with the deposit of all classes
    closing: float = math.inf  # deposit of the face that closes it; 0: at once, infinite: never
    cake_porosity: float = 0.5
    # m2, of what the solids build on the closed face; without it nothing is known from then on
    cake_permeability: float | None = None
    released: float = 0.0  # share of the deposit that back-flow can take away
    release_rate: float = 0.0  # 1/m, how fast it decays with the back-flow over the area

    def loss(self, deposit: Array) -> Array:
        """k0 / k of a deposit (J,) of all classes."""
        return (1.0 + self.damage * deposit) ** self.power

    def at_face(self, deposit: float) -> tuple[float, float]:
        """Area times ds/dV at a `deposit` of the face, and its slope with it."""
        slope = float(self.rate * self.growth @ self.solids) or 1e-30
        return float(self.rate @ self.solids) + slope * deposit, slope

    def closes(self, deposit: float) -> bool:
        """Whether a `deposit` closes the face."""
        return deposit >= self.closing * (1 - TINY)


class Flood(NamedTuple):
    """What drives the flow for so many `seconds`: `pressure` Pa or `rate` m3/s, below 0 back."""

    seconds: float
    pressure: float = math.nan
    rate: float | None = None

    def flow(self, resistance: float) -> float:
        """m3/s through a resistance in Pa s/m3."""
        return self.pressure / resistance if self.rate is None else self.rate


class Filled(NamedTuple):
    """Where the fines of C classes are, in J cells."""

    suspended: Array  # (C, J) volume of fines over that of fluid
    deposit: Array  # (C, J) over bulk volume
    loose: Array  # (C, J) the part of the deposit that back-flow can take away
    face: float  # deposit of all classes at the face itself
    cake: float  # m3 before the face, with its pores


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
    stopped: str  # why it ended early, `FULL` or `CLOSED`; else empty


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
    measured, by default the ends. `fineness` is the largest step over the volume of the drive; the
    error falls with it to first order. Where a deposit would fall below 0, all is marched anew
    with a quarter of it, until it is below `FINEST`. Raises FlowError where that does not help.
    """
    cells, mu = np.zeros((len(medium.rate), len(column.edges) - 1)), medium.viscosity
    state, ends = Filled(cells, cells, cells, 0.0, 0.0), column.edges[[0, -1]]
    at = column.reach([*(ends if taps is None else taps), max(column.outer, ends[-1])])
    start, slope = medium.at_face(0.0)
    quick = (abs(slope) + medium.damage * medium.power * start) / column.area  # 1/m3, the face
    first = fineness / (quick + 10 / (medium.porosity * column.volume.sum()))
    parts, rows = _resistances(column, medium, at, state), list[tuple[Any, ...]]()
    rows.append((0.0, 0.0, drives[0].flow(mu * parts.sum()), parts, cells[:, 0]))
    time, filtrate, closed_at, stopped = 0.0, 0.0, None, ""
    for drive in drives:
        end, since, way = time + drive.seconds, 0.0, math.copysign(1.0, drive.flow(1.0))
        if way < 0:
            state = state._replace(cake=0.0)
            parts = _resistances(column, medium, at, state)
        while time < end:
            if way > 0 and closed_at is None and medium.closes(state.face):
                closed_at = time
            step, over = fineness * since + first, math.inf
            while over > 1 + TINY:  # the step ends where the drive does, or the face closes
                after, effluent = _moved(state, column, medium, way * step)
                met = _resistances(column, medium, at, after)
                if np.isinf(met[0]):
                    break
                seconds = step / abs(drive.flow(mu * (parts + met).sum() / 2))
                closer = (after.face - state.face) / max(medium.closing - state.face, TINY)
                over = max(seconds / (end - time), closer)
                step /= max(over, 1.0)
            if np.isinf(met[0]):
                stopped = FULL if medium.cake_permeability else CLOSED
                break
            if after.deposit.min() < -TINY * after.deposit.max():
                if fineness > FINEST:
                    return march(column, medium, drives, taps=taps, fineness=fineness / 4)
                raise FlowError(
                    f"core or well: a deposit falls below 0 in steps of {fineness:.2g} of the "
                    f"volume, because filtration changes too fast with the deposit (growth "
                    f"{medium.growth.min():.3g}); hand up several seeds or a run with more fines"
                )
            left = end - time - seconds
            time = end if left < TINY * drive.seconds else time + seconds
            filtrate, since, state, parts = filtrate + way * step, since + step, after, met
            rows.append((time, filtrate, drive.flow(mu * parts.sum()), parts, effluent))
    times, volumes, rates, met, effluents = (np.array(one) for one in zip(*rows, strict=True))
    kept = np.diff(at)[:-1] / medium.permeability / met[:, 1:-1]
    drops = mu * rates[:, None] * met
    return March(times, volumes, rates, drops, kept, effluents, state, closed_at, stopped)


def _resistances(column: Column, medium: Medium, at: Array, state: Filled) -> Array:
    """(S+2,) resistances over viscosity, 1/m3, of cake, sections and the rest of the way.

    Sections and the rest lie between the `at` (S+2,), as `Column.reach`. A cake that fills the
    well has an infinite one, and so has one that is not known.
    """
    reach = np.append(column.reach(column.edges), at[-1])
    loss = np.append(medium.loss(state.deposit.sum(axis=0)), 1.0)
    inside = np.interp(at, reach, np.append(0.0, np.cumsum(np.diff(reach) * loss)))
    cake, own = CAKE_SKINS["inward"](state.cake / column.area / column.well), math.inf
    if medium.cake_permeability or not cake:
        own = cake * column.well / column.area / (medium.cake_permeability or 1.0)
    return np.array([own, *np.diff(inside) / medium.permeability])


def _moved(state: Filled, column: Column, medium: Medium, volume: float) -> tuple[Filled, Array]:
    """The state after a `volume` m3 of flow, below 0 back, and the mean (C,) that leaves.

    The filtration coefficients are those of the deposit half-way. Through a closed face no fines
    enter; the mud whose place the cake takes brings its own solids.
    """
    width, bulk, face, cake = np.diff(column.edges), column.volume, state.face, state.cake
    pores, inflow, passed = medium.porosity * bulk, 0.0 * state.deposit, volume / column.area
    if volume < 0:
        freed = state.loose * -np.expm1(medium.release_rate * volume * width / bulk)
        source, held = (freed * bulk / -volume)[:, ::-1], state.suspended[:, ::-1]
        out, last = _sweep(source, held, pores[::-1], inflow, -volume)
        face *= 1 + medium.released * math.expm1(medium.release_rate * passed)
        left = last[:, ::-1], state.deposit - freed, state.loose - freed
        return Filled(*left, face, cake), out[:, -1]
    if medium.closes(face):
        solids = medium.solids.sum()
        cake += solids / (1 - medium.cake_porosity - solids) * volume
    else:
        inflow[:, 0], (start, slope) = medium.solids, medium.at_face(face)
        face += start * passed * float(exprel(slope * passed))
    caught = 0.0 * state.deposit
    for _ in range(2 if medium.growth.any() else 1):
        halfway = (state.deposit + caught / 2).sum(axis=0)
        catch = medium.rate[:, None] * (1 + medium.growth[:, None] * halfway) * width
        out, last = _sweep(inflow, state.suspended, pores, catch, volume)
        caught = np.expm1(catch) * out * volume / bulk
    now = last, state.deposit + caught, state.loose + medium.released * caught
    return Filled(*now, face, cake), out[:, -1]


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
    on, own = (1 - left / decay) / exponent, held * left / decay
    above = np.pad(-on[:, 1:], ((0, 0), (0, 1))).ravel()  # one class after the other
    bands = np.stack([np.ones_like(above), above])
    out = solve_banded((1, 0), bands, (own + on * inflow).ravel()).reshape(held.shape)
    entered = inflow + np.pad(out[:, :-1], ((0, 0), (1, 0)))
    return out, entered * left / exponent + held * np.exp(-decay)
