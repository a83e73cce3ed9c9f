"""The fluid of `drag.field` = "network": it follows the deposit, and the deposit follows it.

The drag on a fine at the superficial slip u - v is 6 pi mu r M Y F_b / phi (u - v), with
Beetstra's factor F_b of the porosity phi around it and the size factor Y (`fdnet.scales.drag`).
The forces, the rate, and what happens when a standing fine comes loose are derived on
docs/physics.md, "The field of the network".
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.classes.beside_spheres import (
    CLASS_COLUMNS,
    FinerClasses,
    Narrowed,
    Passed,
    Stands,
    finer_classes,
)
from fdnet.classes.invasion import FirstFlow, first_flow, velocity_in
from fdnet.dem.checkpoint import Checkpoint, entered_by, time_of
from fdnet.dem.invade_deck import DrivingFluid, FluidForces, Moment, drag_rate
from fdnet.dem.invasion import steps_between
from fdnet.dem.supply import batches_of
from fdnet.network.fines.crowding import local_porosity
from fdnet.network.fines.occupancy import ratio
from fdnet.run import network_flow
from fdnet.run.cake import Standing, standing_cake
from fdnet.scales.drag import crowd_drag_factor
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Array, Snapshot


def _speed(velocity: Array) -> Array:
    return np.linalg.norm(velocity, axis=1)


# ---- A fluid that flows the other way: the specimen is mirrored, asked, and mirrored back.
_TURN = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Mirrored:
    """The fluid of a mirrored specimen, as it acts on the specimen itself."""

    fluid: DrivingFluid  # flows along x through the mirrored specimen

    def keep(self, path: Path) -> None:
        """Nothing: the flow turns back in cases of spheres alone."""

    def recall(self, path: Path | None) -> None:
        """Nothing, likewise."""

    @property
    def measured(self) -> tuple[str, ...]:
        """The measures of the fluid."""
        return self.fluid.measured

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""
        seen = self.fluid.forces(mirrored(spheres), moment)
        return replace(seen, velocity=seen.velocity * _TURN, push=seen.push * _TURN)


def mirrored(spheres: Snapshot) -> Snapshot:
    """The spheres with x mirrored in the middle of their box."""
    position = spheres.position * _TURN
    position[:, 0] += float(spheres.box[0].sum())
    return replace(spheres, position=position, velocity=spheres.velocity * _TURN)


# ---- What moving fines meet until they are looked at again: the mean over their way.
PARTS = 4  # Parts of the way; in each the fluid is taken half-way


class Movers(NamedTuple):
    """N fines that move."""

    position: Array  # (N, 3) m
    velocity: Array  # (N, 3) m/s
    rate: Array  # (N,) 1/s, drag coefficient over mass

    def after(self, time: float, fluid: Array) -> "Movers":
        """The same after `time` s in a `fluid` of constant velocity (N, 3) m/s.

        Drag takes up the slip: dv/dt = rate (u - v).
        """
        kept, slip = np.exp(-self.rate * time)[:, None], self.velocity - fluid
        way = fluid * time + slip * (1.0 - kept) / self.rate[:, None]
        return Movers(self.position + way, fluid + slip * kept, self.rate)


def mean_ahead(
    movers: Movers, fluid: Callable[[Array], Array], time: float, *, even_to: float = -np.inf
) -> Array:
    """Mean velocity (N, 3) m/s of the `fluid` over the way of the `movers` in `time` s.

    `fluid` gives the velocity (N, 3) m/s at places (N, 3) m. Before the depth `even_to` m it is
    the same everywhere. Other spheres are not looked at, but where the way leads into a grain or a
    wall, where no fluid is, a fine stays before it.
    """
    mean = fluid(movers.position)
    fastest = np.maximum(movers.velocity[:, 0], mean[:, 0])
    some = movers.position[:, 0] + np.maximum(fastest, 0.0) * time >= even_to
    own, here = Movers(*(values[some] for values in movers)), mean[some]
    met = np.zeros_like(own.position)
    for left in reversed(range(PARTS)):
        half = fluid(own.after(0.5 * time / PARTS, here).position)
        there = np.where(_wet(half), half, here)
        met += there / PARTS
        if left:
            further = own.after(time / PARTS, there)
            beyond = fluid(further.position)
            free = _wet(beyond)
            here = np.where(free, beyond, here)
            place = np.where(free, further.position, own.position)
            own = further._replace(position=place)
    mean[some] = met
    return mean


def _wet(velocity: Array) -> Array:
    """Where there is fluid, (N, 1)."""
    return np.any(velocity != 0.0, axis=1, keepdims=True)


# ---- The invasion over time as rows: the table history.csv of a run folder.
FLOW_COLUMNS = (
    "rate_m3_s",
    "rate_over_initial",
    "k_over_k0",
    "filtrate_m3",
    "cake_thickness_m",
    "pressure_cake_Pa",
    "pressure_pack_Pa",
    "momentum_defect",
    "fines_share",
    "crowd_over_network",
)
"""What the record of updates holds of the flow, where it follows the deposit."""


def history_rows(
    case: InvasionCase,
    scales: InvasionScales,
    checkpoints: Sequence[Checkpoint],
    updates: Sequence[Mapping[str, float]] = (),
) -> list[dict[str, float]]:
    """One row a checkpoint: times in s, and numbers of fines.

    `time_s` is the time of the simulation, `physical_time_s` that of the fluid. They differ where
    the case drives the fines faster than the fluid moves (`drag.drive_velocity_m_s`). Where the
    flow follows the deposit the row holds what the last of the `updates` before it measured.
    """
    batches, rows = batches_of(case, scales), []
    for row in checkpoints:
        flow = next((one for one in reversed(updates) if one["step"] < row.step), {})
        rows.append(
            {
                "time_s": time_of(row, scales),
                "physical_time_s": time_of(row, scales) * scales.force_factor,
                "supplied_count": batches.supplied(entered_by(case, batches, row)),
                "invaded_count": row.invaded,
                "passed_count": row.passed,
                "upstream_count": row.upstream,
                "step": row.step,
                **{name: flow[name] for name in FLOW_COLUMNS + CLASS_COLUMNS if name in flow},
            }
        )
    return rows


# ---- The fluid: velocity, drag and pressure on each fine, and the rate of flow.
STANDING = 0.5
"""A fine belongs to the deposit when it is slower than this share of the velocity given to it."""

BEDDED = 1e3  # Drag on a sphere that finer solids in a full pore hold, over that of the fluid


@dataclass(frozen=True, eq=False, kw_only=True)
class NetworkFluid:
    """The fluid in a pack whose pores the fines fill."""

    case: InvasionCase
    scales: InvasionScales
    grains: Snapshot  # of the pack, fixed
    standing: float = STANDING

    @property
    def measured(self) -> tuple[str, ...]:
        """What a row of the record holds; see docs/physics.md."""
        return (
            "velocity_m_s",
            *FLOW_COLUMNS,
            *(() if self.finer is None else CLASS_COLUMNS),
            *("factor_mean", "factor_most", "porosity_least", "porosity_capped"),
            "pores_stagnant",
            "fines_standing",
        )

    @cached_property
    def pack(self) -> network_flow.PackFlow:
        """The intact pack."""
        return network_flow.pack_flow(self.grains, self.case.periodic, self.case.analysis.walls)

    @cached_property
    def renewal(self) -> network_flow.Renewal:
        """The damaged pack, from one update to the next."""
        return network_flow.Renewal(self.pack)

    @cached_property
    def finer(self) -> FinerClasses | None:
        """The solids finer than the cut, from one update to the next; None without any."""
        if not self.case.with_classes:
            return None
        pack = self.pack
        return finer_classes(self.case, self.scales, pack.network, pack.halves, pack.flow)

    def keep(self, path: Path) -> None:
        """Write what the next update needs of the finer solids."""
        if self.finer is not None:
            self.finer.keep(path)

    def recall(self, path: Path | None) -> None:
        """Go on from what was written."""
        if self.finer is not None:
            self.finer.recall(path) if path is not None else self.finer.forget()

    @cached_property
    def drive(self) -> FirstFlow:
        """What drives the fluid, the velocity as simulated."""
        drive = first_flow(self.case, self.scales, self.pack.permeability)
        return drive._replace(velocity=drive.velocity * self.scales.force_factor)

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""
        fines, pack, scales = spheres.fines(), self.pack, self.scales
        depth, lone = fines.position[:, 0], scales.push.coefficient * fines.radius
        within = (depth >= 0) & (depth < pack.length)
        measured, before = network_flow.placed(fines), self._before(moment)
        intact = pack.shape.at(measured.position)
        # a fine that comes out of a throat has the speed that it was given, slow for its place
        usual = before * _speed(intact)
        known = usual if moment.given is None else np.where(moment.given > 0, moment.given, usual)
        standing = _speed(fines.velocity) < self.standing * known
        stack = standing_cake(spheres, self.case.periodic)
        filtrate, finer = self._filtrate(moment), self.finer
        among = None if finer is None else partial(self._among, moment, filtrate, stack)
        stood = measured.where(standing)
        carried, deposit = self.renewal.of(stood, anew=moment.fresh, finer=among)
        if finer is not None:
            finer.solve(carried.flow)
        near = local_porosity(spheres, self.case.periodic)
        share = pack.share_at(fines.position, carried)
        shape = intact * share[:, None]
        slip = _speed(before * shape - fines.velocity)
        reynolds = scales.push.reynolds_slope * fines.radius / near.size_ratio * slip
        factor = crowd_drag_factor(near.porosity, near.size_ratio, reynolds) / near.porosity
        crowd, goes = lone * factor, ~standing
        density = self.case.fines.density_kg_m3 if moment.density is None else moment.density
        rate = drag_rate(fines, crowd, density)
        shape[goes] = self._ahead(fines.where(goes), rate[goes], carried, moment)

        pressed = np.zeros((len(fines), 3))
        order = np.argsort(fines.id)
        rows = order[np.searchsorted(fines.id[order], deposit.fines.id)]
        pressed[rows] = network_flow.on_each_fine(carried.pressed, deposit)
        held = standing & within & np.any(pressed != 0.0, axis=1)
        cake = scales.push.coefficient / (6.0 * np.pi) * float(stack.resistance.sum())
        # the pack's own flow knows no cake: the forces on its fines add up to its pressure drop
        caked = standing & np.isin(fines.id, stack.fines.id)
        drawn = float(crowd[caked] @ shape[caked, 0])
        shape[caked] *= cake * pack.network.area / drawn if drawn > 0 else 1.0
        moving = np.where(within & ~held, crowd, 0.0) / pack.network.area
        slow, gain = float(moving @ shape[:, 0]), float(moving @ fines.velocity[:, 0])
        more = 0.0 if finer is None else self._viscosity * finer.resistance
        speed, own = self.drive.velocity, self._viscosity * pack.length / pack.permeability
        if self.case.drag.drive != "rate":
            resists, back = (cake + more + slow) / own, gain / own
            speed = velocity_in(speed, self.drive.rest, carried.k_over_k0, resists, back)
        # drops of pressure as simulated, Pa: of what moves in the pack, and of all that stands
        loose = slow * speed - gain
        drop = self._viscosity * speed * pack.length / pack.permeability / carried.k_over_k0

        pressed, fluid = drop * pressed, speed * shape
        pace = np.maximum(_speed(speed * intact), speed)
        force, volume = _speed(pressed), 4.0 / 3.0 * np.pi * fines.radius**3
        going = ratio(force, pace)
        coefficient = np.where(held, np.maximum(going, lone), crowd)
        velocity = np.where(held[:, None], pressed / coefficient[:, None], fluid)
        push = np.where(held[:, None], 0.0, pressed)
        if self.case.drag.pressure_gradient:
            local = self._viscosity * volume * (speed * np.where(within, share, 0.0))
            gradient = pack.shape.pressure_gradient_at(measured.position)
            # the network's resistance over that of the coarse resolved field
            scale = pack.length / pack.permeability / pack.shape.resistance
            push = -scale * gradient * local[:, None] + push

        # the push of the intact pack's gradient is part of what the network gives to the grains
        drag = coefficient * np.where(held, velocity[:, 0], (velocity - fines.velocity)[:, 0])
        outside = ~within & np.any(pressed != 0.0, axis=1)
        on_fines = float(drag[within].sum()) + float(pressed[outside, 0].sum())
        on_grains, on_held = drop * float(carried.pressed.grains[0]), float(pressed[held, 0].sum())
        whole, law = (drop + loose) * pack.network.area, float(crowd[held] @ fluid[held, 0])
        if finer is not None:
            bedded = self._bedded(fines, intact, finer.full)
            coefficient[bedded] *= BEDDED
            velocity[bedded], push[bedded] = 0.0, 0.0
        # rates and pressures are those of the fluid itself, which is slower than a driven one
        driven = scales.force_factor
        return FluidForces(
            coefficient=coefficient,
            velocity=velocity,
            push=push,
            pace=speed / scales.porosity,
            measures={
                "velocity_m_s": speed,
                "factor_mean": float(np.mean(factor)) if len(factor) else 1.0,
                "factor_most": float(np.max(factor, initial=1.0)),
                "porosity_least": float(np.min(near.porosity, initial=1.0)),
                "porosity_capped": near.capped,
                "rate_m3_s": speed / driven * pack.network.area,
                "rate_over_initial": speed / self.drive.velocity,
                "filtrate_m3": filtrate,
                "k_over_k0": carried.k_over_k0,
                "pressure_cake_Pa": (cake + more) * speed / driven,
                "pressure_pack_Pa": (drop + loose) / driven,
                "momentum_defect": _over(abs(on_fines + on_grains - whole), whole),
                "fines_share": _over(on_held, whole),
                "crowd_over_network": _over(law, on_held),
                "cake_thickness_m": stack.thickness + (0.0 if finer is None else finer.thickness),
                "pores_stagnant": carried.stagnant,
                "fines_standing": int(np.sum(standing & within)),
                **({} if finer is None else finer.measures),
            },
        )

    def _filtrate(self, moment: Moment) -> float:
        """m3 that have passed up to this moment, at the rate of the update before."""
        if moment.before is None:
            return 0.0
        time = (moment.time - moment.before["time_s"]) * self.scales.force_factor
        return moment.before["filtrate_m3"] + moment.before["rate_m3_s"] * time

    def _among(
        self, moment: Moment, filtrate: float, stack: Standing, kept: Array, in_pores: Array
    ) -> Narrowed:
        """What the finer solids leave of the sides that `kept` (T, 2) of their conductances."""
        assert self.finer is not None
        before = 0.0 if moment.before is None else moment.before["filtrate_m3"]
        velocity = self._before(moment) / self.scales.force_factor
        cake = float(4.0 / 3.0 * np.pi * np.sum(stack.fines.radius**3))
        return self.finer.among(Passed(before, filtrate, velocity), Stands(kept, in_pores, cake))

    def _bedded(self, fines: Snapshot, intact: Array, full: Array) -> Array:
        """Which of the `fines` lie in, or reach along the `intact` flow (N, 3) into, full pores.

        `full` (G,) says which groups of pores are.
        """
        pack = self.pack
        way = ratio(intact, _speed(intact)[:, None])
        way[fines.position[:, 0] < 0.0] = [1.0, 0.0, 0.0]
        found = np.zeros(len(fines), bool)
        for place in (fines.position, fines.position + way * fines.radius[:, None]):
            within = (place[:, 0] >= 0.0) & (place[:, 0] < pack.length)
            found[within] |= full[pack.network.pore_group[pack.pore_of(place[within])]]
        return found

    def _before(self, moment: Moment) -> float:
        """Superficial velocity up to this moment, m/s."""
        return self.drive.velocity if moment.before is None else moment.before["velocity_m_s"]

    def _ahead(
        self, fines: Snapshot, rate: Array, carried: network_flow.Carried, moment: Moment
    ) -> Array:
        """Velocity (N, 3) of the fluid over U on the way of `fines` that move.

        Drag takes up their slip at the `rate` (N,) 1/s.
        """
        pace = self._before(moment)
        if pace <= 0:
            return self.pack.shape_at(fines.position, carried)
        steps = steps_between(self.case, self.scales, pace / self.scales.porosity)
        time = min(steps * self.scales.time_step, moment.left)
        movers, field = Movers(fines.position, fines.velocity, rate), self.pack.shape.lattice
        mean = mean_ahead(
            movers,
            lambda at: pace * self.pack.shape_at(at, carried),
            time,
            even_to=float(field.low[0]),
        )
        return mean / pace

    @property
    def _viscosity(self) -> float:
        return self.case.fluid.viscosity_Pa_s


def _over(part: float, whole: float) -> float:
    """`part` over `whole`; 0 where that is not above 0."""
    return part / whole if whole > 0 else 0.0


def fluid_of(case: InvasionCase, scales: InvasionScales, grains: Snapshot) -> DrivingFluid | None:
    """The fluid of a coupled case; None where the deck holds the forces itself."""
    return NetworkFluid(case=case, scales=scales, grains=grains) if case.drag.coupled else None
