"""The solids finer than the cut of `invasion.method` = "both", beside the spheres of LIGGGHTS.

At each update of the flow they are carried on by the fluid that has passed since the one before,
as the fast model carries them. The spheres that stand in a pore, or in the cake, count there as
one more class, which holds finer ones. What the classes add to a side of a throat multiplies what
the spheres leave of it,

    kept = kept(spheres) r(spheres) / r(spheres and classes),

with the resistance r of the side by the fast model. A throat to which the spheres leave the share
s of its conductance lets pass what is narrower than s^(1/4) of its passage, since the conductance
of an opening goes with the fourth power of its width. Spheres and classes share the room of a
pore: where both together fill it, by the fast model, spheres stay in it, and before it.
"""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.classes.capture import Bed, SizeClasses, filter_coefficient, mud_classes
from fdnet.classes.deposit import (
    Deposits,
    Release,
    Sieve,
    advanced,
    holding,
    kept_shares,
    loads_of,
    no_solids,
    released,
    sieve_of,
    thickness_of_cake,
)
from fdnet.classes.invasion import bed_of, cake_permeability, cake_resistance, release_of
from fdnet.classes.transport import NONE, streams_of
from fdnet.files import replacing
from fdnet.network.flow.flow import Flow
from fdnet.network.network import Network
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Array

CLASS_COLUMNS = ("classes_inside_m3", "classes_passed_m3", "classes_cake_m3", "classes_missing")
"""Volume of all classes in the specimen, beyond it and before it; error of their ledger."""


CHANGED = 0.2  # Share of the classes at rest that may come before the network is solved anew


class Passed(NamedTuple):
    """The fluid that has passed, m3 in all, up to the update `before` and `now`; its superficial
    `velocity`, m/s."""

    before: float
    now: float
    velocity: float


class Stands(NamedTuple):
    """The spheres that stand: the share (T, 2) that they leave of each side, their m3 in each pore
    (P,) over the share of the pore inside the box, and m3 before the face."""

    factor: Array
    in_pores: Array
    cake: float


class Narrowed(NamedTuple):
    """What all solids leave (T, 2) of each side, m3 of finer ones at rest in groups of pores (G,),
    and whether the network must be solved anew for them."""

    kept: Array
    volume: Array
    grown: bool


@dataclass(slots=True, eq=False, kw_only=True)
class FinerClasses:
    """Where the finer classes (C) are, from one update to the next."""

    network: Network  # of the grains, with pores in N groups and throats (T)
    sieve: Sieve  # the same as solids meet it
    classes: SizeClasses  # (C) and, as the last one, the spheres
    own: SizeClasses  # (C) without them
    bed: Bed  # grains and fluid, for what sticks to them
    sticking: float  # share of the contacts with grains that stick
    release: Release | None  # what the flow lifts; None: nothing
    mud: float  # m3 that come at most
    cake: float | None  # m2, permeability of the cake of classes, where the case gives it
    solids: Deposits  # of the classes (C)
    kept: Array  # (T, 2) share that the classes leave of what the spheres leave
    flux: Array  # (T,) m3, of the last solve
    pressure: Array  # (N,) of the last solve
    full: Array  # (N,) whether spheres and classes fill the pore, by the last update
    solved: float = 0.0  # m3 of them that the last solve knew

    def among(self, passed: Passed, spheres: Stands) -> Narrowed:
        """Carry the classes on by what `passed`, among the `spheres` that stand."""
        step = passed.now - passed.before
        sieve = replace(
            self.sieve, passage=self.sieve.passage * np.min(spheres.factor, axis=1) ** 0.25
        )
        if step > 0:
            share = np.clip((self.mud - passed.before) / step, 0.0, 1.0)
            classes = replace(self.classes, concentration=share * self.classes.concentration)
            streams = streams_of(
                *(sieve.ends, self.flux, self.pressure), inlet=sieve.inlet, outlet=sieve.outlet
            )
            solids = self._among(self.solids, spheres)
            bed = replace(self.bed, velocity=passed.velocity)
            sticks = filter_coefficient(classes, bed, self.sticking)
            what = holding(sieve, solids, classes, streams, sticks)
            if self.release and streams.inflow > 0 and passed.velocity > 0:
                rate = passed.velocity * sieve.area
                drop = bed.viscosity * rate / streams.inflow
                solids = released(sieve, solids, streams, drop, step / rate, self.release)
            after = advanced(sieve, solids, classes, streams, what, step)
            self.solids = Deposits(
                **{one.name: getattr(after, one.name)[..., :-1] for one in fields(Deposits)}
            )
        nothing = no_solids(self.sieve, self.own)
        both, alone = (self._among(one, spheres) for one in (self.solids, nothing))
        left, without = (kept_shares(self.sieve, one, self.classes) for one in (both, alone))
        # loosely packed spheres among fine solids may seem to make room: they make none
        self.kept = np.minimum(left / without, 1.0)
        held, rest = self._held, (self.solids.in_pores + self.solids.attached).sum(axis=1)
        filled = loads_of(self.sieve, both, self.classes).filled
        self.full = (filled >= 1.0) & (rest > NONE * self.sieve.void)
        return Narrowed(spheres.factor * self.kept, rest, held - self.solved > CHANGED * held)

    def _among(self, solids: Deposits, spheres: Stands) -> Deposits:
        """The solids with the standing spheres as the last class."""
        network, columns = self.network, {}
        inside = spheres.in_pores * network.pore_share
        standing = {
            "in_pores": np.bincount(network.pore_group, inside, len(self.sieve.void)),
            "cake": np.array(spheres.cake),
        }
        for one in fields(Deposits):
            values = getattr(solids, one.name)
            last = standing.get(one.name, np.zeros(values.shape[:-1]))
            columns[one.name] = np.concatenate([values, last[..., None]], axis=-1)
        return Deposits(**columns)

    @property
    def _held(self) -> float:
        """m3 of them that rest in the specimen."""
        parts = (self.solids.in_pores, self.solids.attached, self.solids.in_throats)
        return float(sum(one.sum() for one in parts))

    def solve(self, flow: Flow) -> None:
        """Take the `flow` of the last solve."""
        if self.flux is flow.throat_flux:
            return
        first = np.unique(self.network.pore_group, return_index=True)[1]
        self.flux, self.pressure = flow.throat_flux, flow.pore_pressure[first]
        self.solved = self._held

    @property
    def resistance(self) -> float:
        """1/m, of what lies of them before the face."""
        return cake_resistance(self.cake, self.sieve, self.solids, self.own)

    @property
    def thickness(self) -> float:
        """m, of what lies of them before the face."""
        return thickness_of_cake(self.sieve, self.solids)

    @property
    def measures(self) -> dict[str, float]:
        """`CLASS_COLUMNS`."""
        solids = self.solids
        volumes = (solids.inside_by_class, solids.passed, solids.cake)
        values = [float(one.sum()) for one in volumes]
        missing = float(np.abs(solids.missing).max())
        return dict(zip(CLASS_COLUMNS, (*values, missing), strict=True))

    def keep(self, path: Path) -> None:
        """Write all that the next update needs."""
        arrays = {one.name: getattr(self.solids, one.name) for one in fields(Deposits)}
        with replacing(path) as part:
            np.savez(part, kept=self.kept, flux=self.flux, pressure=self.pressure, **arrays)

    def recall(self, path: Path) -> None:
        """Read it back."""
        with np.load(path) as data:
            self.solids = Deposits(**{one.name: data[one.name] for one in fields(Deposits)})
            self.kept, self.flux, self.pressure = data["kept"], data["flux"], data["pressure"]

    def forget(self) -> None:
        """Begin anew: no mud has come."""
        self.solids = no_solids(self.sieve, self.own)
        self.kept = np.ones(self.sieve.ends.shape)


def finer_classes(
    case: InvasionCase, scales: InvasionScales, network: Network, halves: Array, flow: Flow
) -> FinerClasses | None:
    """What is finer than the cut of a case before its mud comes; None where nothing is.

    `halves` (T, 2) 1/m3 are the resistances of the clean sides, `flow` is through these.
    """
    choices, fines = case.invasion, case.fines
    if choices is None:
        return None
    finer = mud_classes(fines, choices.classes, below=fines.finest_m)
    if not len(finer.diameter):
        return None
    coarse = {
        "low": 2.0 * fines.radius_range_m[0],
        "high": 2.0 * fines.radius_range_m[1],
        "diameter": fines.sauter_diameter_m,
        "concentration": 0.0,
        "density": fines.mean_density_kg_m3,
    }
    classes = {name: np.append(getattr(finer, name), one) for name, one in coarse.items()}
    sieve = sieve_of(network, halves, flow.throat_flux)
    made = FinerClasses(
        network=network,
        sieve=sieve,
        classes=SizeClasses(**classes),
        own=finer,
        bed=bed_of(case, scales, scales.darcy_velocity),
        sticking=choices.sticking,
        release=release_of(case),
        mud=scales.slab_length * sieve.area,
        cake=cake_permeability(case),
        solids=no_solids(sieve, finer),
        kept=np.ones(sieve.ends.shape),
        flux=np.zeros(0),
        pressure=np.zeros(0),
        full=np.zeros(len(sieve.void), bool),
    )
    made.solve(flow)
    return made
