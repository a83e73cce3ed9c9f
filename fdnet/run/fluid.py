"""The fluid that drives the fines: uniform, or by the network.

Drag in a crowd of fines in the uniform field: Beetstra's law of the porosity around each fine.

The uniform velocity u is the volume of suspension that passes a unit area of pores in a unit
of time. Where fines of porosity phi stand in it, the fluid flows at u / phi between them; where
they move with it, there is no slip. So the superficial slip is u - v in either case, and

    F = 6 pi mu r M Y F_b / phi (u - v) + V G,

with Beetstra's factor F_b and the size factor Y (`fdnet.scales.drag`). The first part is
the total force of the fluid in the crowd, the fall of pressure that the crowd itself causes among
it: fines that fill a cross-section A and stand take up dp A. G is the gradient of the intact pack
without fines, which acts inside the pack where `drag.pressure_gradient` asks for it. So the two
gradients add, and none is counted twice.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import Checkpoint, entered_by
from fdnet.dem.invade_deck import Fluid, FluidForces, Moment, drag_rate
from fdnet.dem.invasion import steps_between
from fdnet.dem.supply import batches_of
from fdnet.network.field.field import VelocityField
from fdnet.network.fines.crowding import Neighbourhood, local_porosity
from fdnet.run.network_flow import (
    RENEWED,
    Carried,
    PackFlow,
    Renewal,
    on_each_fine,
    pack_flow,
    placed,
)
from fdnet.scales.drag import Crowd, crowd_drag_factor
from fdnet.scales.flow import path_of
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Array, Snapshot, unmoved

CROWD_COLUMNS = ("factor_mean", "factor_most", "porosity_least", "porosity_capped")
"""Mean and largest factor on the drag, least porosity, fines whose porosity was capped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformCrowd:
    """The uniform field, with drag by the crowd around each fine.

    Attributes:
        case: what is run.
        scales: of the case.
        mud_beyond: whether the mud is at the other end: that of a clean-up, mirrored.
    """

    case: InvasionCase
    scales: InvasionScales
    mud_beyond: bool = False

    @property
    def measured(self) -> tuple[str, ...]:
        """What a row of the record holds."""
        return CROWD_COLUMNS

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""
        fines, scales = spheres.fines(), self.scales
        depth = fines.position[:, 0]
        velocity, push = np.zeros((2, len(fines), 3))
        mud = depth > self.case.size_m[0] if self.mud_beyond else depth < 0
        velocity[:, 0] = np.where(mud, scales.upstream_velocity, scales.drive_velocity)
        volume = 4.0 / 3.0 * np.pi * fines.radius**3
        within = (depth >= 0) & (depth < self.case.size_m[0])
        push[:, 0] = np.where(within, volume * scales.push.gradient, 0.0)
        near = local_porosity(spheres, self.case.periodic)
        slip = np.linalg.norm(velocity - fines.velocity, axis=1)
        factor = crowd_factor(scales, near, fines.radius, slip)
        return FluidForces(
            coefficient=scales.push.coefficient * fines.radius * factor,
            velocity=velocity,
            push=push,
            pace=scales.drive_velocity,
            measures=crowd_measures(factor, near),
        )


def crowd_factor(scales: InvasionScales, near: Neighbourhood, radius: Array, slip: Array) -> Array:
    """Factor (N,) on the drag of lone fines of `radius` m and superficial `slip` m/s.

    It is the total force in the crowd, Y F_b / phi. The Reynolds number is 0 unless the case asks
    for drag at finite ones.
    """
    reynolds = scales.push.reynolds_slope * radius / near.size_ratio * slip
    crowd = Crowd(porosity=near.porosity, size_ratio=near.size_ratio, reynolds=reynolds)
    return crowd_drag_factor(crowd) / near.porosity


def crowd_measures(factor: Array, near: Neighbourhood) -> dict[str, float]:
    """`CROWD_COLUMNS`, from the `factor` (N,) on the drag of fines."""
    values = (
        float(np.mean(factor)) if len(factor) else 1.0,
        float(np.max(factor, initial=1.0)),
        float(np.min(near.porosity, initial=1.0)),
        near.capped,
    )
    return dict(zip(CROWD_COLUMNS, values, strict=True))


# ------------------------------------------------------------------------------------------------
# A fluid that flows the other way: the specimen is mirrored, asked, and mirrored back.


_TURN = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Mirrored:
    """The fluid of a mirrored specimen, as it acts on the specimen itself.

    Attributes:
        fluid: flows along x through the mirrored specimen.
    """

    fluid: Fluid

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
    middle = float(spheres.box[0].sum())
    position = spheres.position * _TURN
    position[:, 0] += middle
    return replace(spheres, position=position, velocity=spheres.velocity * _TURN)


# ------------------------------------------------------------------------------------------------
# The force on each fine: carried along, standing in the pack, or part of the cake.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Deposit:
    """The fines (N) that stand.

    Attributes:
        held: (N,) which stand in the pack.
        pressed: (N, 3) N, what the network's pressure does to them; also to fines of the cake that
            reach into the pack; 0 for all others.
    """

    held: Array
    pressed: Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FineForces:
    """The force C (u - v) + P on each fine (N) of velocity v.

    Attributes:
        coefficient: (N,) N s/m, C.
        velocity: (N, 3) m/s, u.
        push: (N, 3) N, P.
        held: (N,) which stand in the pack.
        pressed: (N, 3) N, of `Deposit`.
        crowd_drag: N, along x, what the law of the crowd would do to those that stand in the pack.
    """

    coefficient: Array
    velocity: Array
    push: Array
    held: Array
    pressed: Array
    crowd_drag: float


def forces_on(
    fines: Snapshot,
    deposit: Deposit,
    *,
    crowd: Array,
    lone: Array,
    carried: Array,
    intact: Array,
    push: Array,
    pace: float,
) -> FineForces:
    """The forces on `fines`.

    A fine that stands in the pack feels what the network's pressure does to it. When it comes
    loose its throat opens, so it is not pushed on by all that force, but goes on with the flow of
    the intact pack: C = F / u, with u the larger of the velocity there and the superficial one,
    and at least the coefficient of a lone fine.

    Args:
        fines: N of them.
        deposit: what stands.
        crowd: (N,) N s/m, coefficients by the law of the crowd.
        lone: (N,) N s/m, of a lone fine.
        carried: (N, 3) m/s, velocity of the fluid at each fine.
        intact: (N, 3) m/s, that of the intact pack at the same rate.
        push: (N, 3) N, by the gradient of the grains alone.
        pace: superficial velocity, m/s.
    """
    held, pressed = deposit.held, deposit.pressed
    force = np.linalg.norm(pressed, axis=1)
    speed = np.maximum(np.linalg.norm(intact, axis=1), pace)
    loose = np.divide(force, speed, out=np.zeros_like(force), where=speed > 0)
    coefficient = np.where(held, np.maximum(loose, lone), crowd)
    at_rest = pressed / coefficient[:, None]
    return FineForces(
        coefficient=coefficient,
        velocity=np.where(held[:, None], at_rest, carried),
        push=push + np.where(held[:, None], 0.0, pressed),
        held=held,
        pressed=pressed,
        crowd_drag=float(crowd[held] @ carried[held, 0]),
    )


# ------------------------------------------------------------------------------------------------
# The intact pack's flow at the fines, taken again only where they moved.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sampled:
    """What the intact pack's flow is at N fines.

    Attributes:
        id: (N,) of the fines.
        position: (N, 3) m, where it was taken.
        velocity: (N, 3) over the superficial velocity.
        gradient: (N, 3) 1/m2, of the pressure over mu U.
    """

    id: Array
    position: Array
    velocity: Array
    gradient: Array

    def at(self, fines: Snapshot, shape: VelocityField) -> "Sampled":
        """The same at other `fines`; it is kept for those at the same place."""
        new, old = unmoved((fines.id, fines.position), (self.id, self.position))
        moved = np.ones(len(fines), bool)
        moved[new] = False
        velocity, gradient = (np.empty((len(fines), 3)) for _ in range(2))
        velocity[new], velocity[moved] = self.velocity[old], shape.at(fines.position[moved])
        gradient[new] = self.gradient[old]
        gradient[moved] = shape.pressure_gradient_at(fines.position[moved])
        return Sampled(id=fines.id, position=fines.position, velocity=velocity, gradient=gradient)


class Places:
    """What is kept from one update to the next: the flow at the fines."""

    def __init__(self) -> None:
        none = np.zeros((0, 3))
        self._last = Sampled(id=np.zeros(0, int), position=none, velocity=none, gradient=none)

    def at(self, fines: Snapshot, shape: VelocityField) -> Sampled:
        """The flow of the intact pack, `shape`, at the fines."""
        self._last = self._last.at(fines, shape)
        return self._last


# ------------------------------------------------------------------------------------------------
# The fluid that fines meet on the way that they will go until they are looked at again.
#
# Between two updates a fine passes places where the fluid is faster or slower. It is given the
# mean over its way, and not what is at its place when the way begins.


PARTS = 4
"""Parts of the way; in each the fluid is taken half-way."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Movers:
    """N fines that move.

    Attributes:
        position: (N, 3) m.
        velocity: (N, 3) m/s.
        rate: (N,) 1/s, drag coefficient over mass.
    """

    position: Array
    velocity: Array
    rate: Array

    def after(self, time: float, fluid: Array) -> "Movers":
        """The same after `time` s in a `fluid` of constant velocity (N, 3) m/s.

        Drag takes up the slip: dv/dt = rate (u - v).
        """
        kept, slip = np.exp(-self.rate * time)[:, None], self.velocity - fluid
        way = fluid * time + slip * (1.0 - kept) / self.rate[:, None]
        return Movers(position=self.position + way, velocity=fluid + slip * kept, rate=self.rate)

    def where(self, some: Array) -> "Movers":
        """Those of them for which `some` (N,) is true."""
        return Movers(
            position=self.position[some], velocity=self.velocity[some], rate=self.rate[some]
        )


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
    mean[some] = _mean(movers.where(some), fluid, time, mean[some])
    return mean


def _mean(movers: Movers, fluid: Callable[[Array], Array], time: float, here: Array) -> Array:
    met = np.zeros_like(movers.position)
    for left in reversed(range(PARTS)):
        half = fluid(movers.after(0.5 * time / PARTS, here).position)
        there = np.where(_wet(half), half, here)
        met += there / PARTS
        if left:
            further = movers.after(time / PARTS, there)
            beyond = fluid(further.position)
            free = _wet(beyond)
            here = np.where(free, beyond, here)
            place = np.where(free, further.position, movers.position)
            movers = Movers(position=place, velocity=further.velocity, rate=movers.rate)
    return met


def _wet(velocity: Array) -> Array:
    """Where there is fluid, (N, 1)."""
    return np.any(velocity != 0.0, axis=1, keepdims=True)


# ------------------------------------------------------------------------------------------------
# The invasion over time as rows: the table history.csv of a run folder.


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
    batches = batches_of(case, scales)
    return [
        {
            "time_s": row.step * scales.time_step,
            "physical_time_s": row.step * scales.time_step * scales.force_factor,
            "supplied_count": batches.supplied(entered_by(case, batches, row)),
            "invaded_count": row.invaded,
            "passed_count": row.passed,
            "upstream_count": row.upstream,
            "step": row.step,
            **_flow_before(updates, row.step),
        }
        for row in checkpoints
    ]


def _flow_before(updates: Sequence[Mapping[str, float]], step: int) -> dict[str, float]:
    """The columns of the flow from the last update before `step`; none without a flow."""
    row = next((row for row in reversed(updates) if row["step"] < step), {})
    return {name: row[name] for name in FLOW_COLUMNS if name in row}


# ------------------------------------------------------------------------------------------------
# The fluid of `drag.field` = "network": it follows the deposit, and the deposit follows it.
#
# The force on a fine that moves is that of the uniform field (`uniform`) with local values: u is
# the volume of suspension that passes a unit area of pores at its place (`network_flow`), G the
# fall of pressure that this flow causes in the grains alone. A fine that stands in the pack feels
# what the network's pressure does there (`pressed`), and G. Upstream of the face the mud moves at
# the rate over the cross-section, and fines that stand there feel the drag of the crowd.
#
# The rate U follows from the resistances in series: the pack with its deposit (network), the cake
# (the drag on the fines that stand upstream), the drag on fines that move in the pack, and the
# rest of the way on which the overbalance is lost, which stays as it is.


STANDING = 0.5
"""A fine belongs to the deposit when it is slower than this share of the velocity given to it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class NetworkFluid:
    """The fluid in a pack whose pores the fines fill.

    Attributes:
        case: what is run.
        scales: of the case.
        grains: of the pack, fixed.
        standing: share of the velocity given below which a fine belongs to the deposit.
        renewed: share of the deposit that may change before the network is solved anew.
    """

    case: InvasionCase
    scales: InvasionScales
    grains: Snapshot
    standing: float = STANDING
    renewed: float = RENEWED

    @property
    def measured(self) -> tuple[str, ...]:
        """What a row of the record holds; see docs/physics.md."""
        return (
            "velocity_m_s",
            *FLOW_COLUMNS,
            *CROWD_COLUMNS,
            "pores_stagnant",
            "fines_standing",
        )

    @cached_property
    def pack(self) -> PackFlow:
        """The intact pack."""
        return pack_flow(self.grains, self.case.periodic, self.case.analysis.walls)

    @cached_property
    def renewal(self) -> Renewal:
        """The damaged pack, from one update to the next."""
        return Renewal(self.pack, renewed=self.renewed)

    @cached_property
    def _places(self) -> Places:
        return Places()

    @property
    def first_velocity(self) -> float:
        """Superficial velocity at the start, m/s as simulated."""
        return self.scales.darcy_velocity * self.scales.force_factor

    @cached_property
    def rest(self) -> float:
        """Resistance of the way beyond the specimen over that of the intact specimen.

        A velocity that is given says nothing of the way: the specimen is all of it.
        """
        case, length = self.case, self.pack.length
        if case.fluid.velocity_m_s is not None:
            return 0.0
        given = None if case.well is None else case.well.formation_permeability_m2
        ratio = 1.0 if given is None else self.scales.permeability / given
        return max(0.0, path_of(case).viscous - length) / length * ratio

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""
        fines, pack = spheres.fines(), self.pack
        depth = fines.position[:, 0]
        within = (depth >= 0) & (depth < pack.length)
        measured = placed(fines)
        place = self._places.at(measured, pack.shape)
        before = self._before(moment)
        standing = self._stands(fines, before * _speed(place.velocity), moment)
        carried, deposit = self.renewal.of(measured.where(standing), anew=moment.fresh)
        near = local_porosity(spheres, self.case.periodic)
        share = pack.share_at(fines.position, carried)
        shape = place.velocity * share[:, None]
        caked = standing & (depth < 0)
        factor = self._factor(near, fines, before * shape)
        crowd = self.scales.push.coefficient * fines.radius * factor
        goes, rate = ~standing, self._drag_rate(fines, crowd, moment)
        shape[goes] = self._ahead(fines.where(goes), rate[goes], carried, moment)
        pressed = np.zeros((len(fines), 3))
        pressed[_rows(fines, deposit.fines)] = on_each_fine(carried.pressed, deposit)
        held = standing & within & np.any(pressed != 0.0, axis=1)
        area = pack.network.area
        cake = float(crowd[caked] @ shape[caked, 0]) / area
        moving = np.where(within & ~held, crowd, 0.0) / area
        slow, gain = float(moving @ shape[:, 0]), float(moving @ fines.velocity[:, 0])
        speed = self._velocity(carried, cake + slow, gain)
        loose, drop = slow * speed - gain, self._drop(carried, speed)
        made = forces_on(
            fines,
            Deposit(held=held, pressed=drop * pressed),
            crowd=crowd,
            lone=self.scales.push.coefficient * fines.radius,
            carried=speed * shape,
            intact=speed * place.velocity,
            push=self._push(fines, place.gradient, speed * np.where(within, share, 0.0)),
            pace=speed,
        )
        return FluidForces(
            coefficient=made.coefficient,
            velocity=made.velocity,
            push=made.push,
            pace=speed / self.scales.porosity,
            measures=self._pressures(carried, cake, loose, speed)
            | self._ledger(speed, moment)
            | crowd_measures(factor, near)
            | self._momentum(
                made, fines, within, drop * float(carried.pressed.grains[0]), drop + loose
            )
            | {
                "cake_thickness_m": self._thickness(fines.radius[caked], near, caked),
                "pores_stagnant": carried.stagnant,
                "fines_standing": int(np.sum(standing & within)),
            },
        )

    def _stands(self, fines: Snapshot, flow: Array, moment: Moment) -> Array:
        """Which fines (N,) belong to the deposit; the intact `flow` (N,) m/s is at their place.

        Their forces carry them at the speed that was given. A fine that comes out of a throat has
        that speed and is slow for its place.
        """
        given = flow if moment.given is None else np.where(moment.given > 0, moment.given, flow)
        return _speed(fines.velocity) < self.standing * given

    def _before(self, moment: Moment) -> float:
        """Superficial velocity up to this moment, m/s."""
        return self.first_velocity if moment.before is None else moment.before["velocity_m_s"]

    def _drag_rate(self, fines: Snapshot, crowd: Array, moment: Moment) -> Array:
        """How fast the drag `crowd` (N,) N s/m takes up the slip of the fines, (N,) 1/s."""
        known = moment.density
        return drag_rate(fines, crowd, self.case.fines.density_kg_m3 if known is None else known)

    def _ahead(self, fines: Snapshot, rate: Array, carried: Carried, moment: Moment) -> Array:
        """Velocity (N, 3) of the fluid over U on the way of `fines` that move.

        Drag takes up their slip at the `rate` (N,) 1/s.
        """
        pace = self._before(moment)
        if pace <= 0:
            return self.pack.shape_at(fines.position, carried)
        steps = steps_between(self.case, self.scales, pace / self.scales.porosity)
        time = min(steps * self.scales.time_step, moment.left)
        movers = Movers(position=fines.position, velocity=fines.velocity, rate=rate)
        field = float(self.pack.shape.lattice.low[0])
        mean = mean_ahead(
            movers, lambda at: pace * self.pack.shape_at(at, carried), time, even_to=field
        )
        return mean / pace

    def _momentum(
        self, made: FineForces, fines: Snapshot, within: Array, grains: float, drop: float
    ) -> dict[str, float]:
        """By how much forces and drop of pressure `drop` Pa differ; what the crowd's law says.

        The push of the intact pack's gradient is part of what the network gives to the grains.
        """
        drag = made.coefficient * (made.velocity - fines.velocity)[:, 0]
        at_rest = np.where(made.held, made.coefficient * made.velocity[:, 0], drag)
        acting = within | np.any(made.pressed != 0.0, axis=1)
        cake = ~within & acting
        on_fines = float(at_rest[within].sum()) + float(made.pressed[cake, 0].sum())
        whole = drop * self.pack.network.area
        network = float(made.pressed[made.held, 0].sum())
        return {
            "momentum_defect": abs(on_fines + grains - whole) / whole if whole > 0 else 0.0,
            "fines_share": network / whole if whole > 0 else 0.0,
            "crowd_over_network": made.crowd_drag / network if network > 0 else 0.0,
        }

    def _factor(self, near: Neighbourhood, fines: Snapshot, velocity: Array) -> Array:
        if self.case.drag.crowd == "none":
            return np.ones(len(fines))
        slip = np.linalg.norm(velocity - fines.velocity, axis=1)
        return crowd_factor(self.scales, near, fines.radius, slip)

    def _velocity(self, carried: Carried, more: float, gain: float = 0.0) -> float:
        """Superficial velocity U, m/s.

        Cake and moving fines resist with `more` Pa s/m, and the motion of the fines gives back
        `gain` Pa. At constant pressure, with the resistance R0 = mu L / k0 of the intact pack,

            U = (U0 (1 + rest) + gain / R0) / (k0 / k + rest + more / R0).
        """
        if self.case.drag.drive == "rate":
            return self.first_velocity
        intact = self._viscosity * self.pack.length / self.pack.permeability
        resistance = 1.0 / carried.k_over_k0 + self.rest + more / intact
        return (self.first_velocity * (1.0 + self.rest) + gain / intact) / resistance

    @property
    def _viscosity(self) -> float:
        return self.case.fluid.viscosity_Pa_s

    def _push(self, fines: Snapshot, gradient: Array, speed: Array) -> Array:
        """V (-grad p) of the grains, (N, 3) N, for the local `speed` (N,) m/s over the shape."""
        if not self.case.drag.pressure_gradient:
            return np.zeros((len(fines), 3))
        volume = 4.0 / 3.0 * np.pi * fines.radius**3
        return -self.pack.scale * gradient * (self._viscosity * volume * speed)[:, None]

    def _pressures(
        self, carried: Carried, cake: float, loose: float, speed: float
    ) -> dict[str, float]:
        """Drops of pressure of the fluid itself, Pa, and the permeability.

        `loose` Pa is what moving fines take.
        """
        factor = self.scales.force_factor
        return {
            "k_over_k0": carried.k_over_k0,
            "pressure_cake_Pa": cake * speed / factor,
            "pressure_pack_Pa": (self._drop(carried, speed) + loose) / factor,
        }

    def _drop(self, carried: Carried, speed: float) -> float:
        """Drop of pressure over the pack with its deposit as simulated, Pa."""
        intact = self._viscosity * speed * self.pack.length / self.pack.permeability
        return intact / carried.k_over_k0

    def _ledger(self, speed: float, moment: Moment) -> dict[str, float]:
        """Rate and filtrate of the fluid itself, which is slower than a driven one."""
        factor, before = self.scales.force_factor, moment.before
        rate, filtrate = speed / factor * self.pack.network.area, 0.0
        if before is not None:
            passed = (moment.time - before["time_s"]) * factor
            filtrate = before["filtrate_m3"] + before["rate_m3_s"] * passed
        return {
            "velocity_m_s": speed,
            "rate_m3_s": rate,
            "rate_over_initial": speed / self.first_velocity,
            "filtrate_m3": filtrate,
        }

    def _thickness(self, radius: Array, near: Neighbourhood, standing: Array) -> float:
        """Thickness, m, of a cake of the standing fines with their own mean solid fraction."""
        if not len(radius):
            return 0.0
        solid = float(np.sum(4.0 / 3.0 * np.pi * radius**3))
        dense = float(np.mean(1.0 - near.porosity[standing]))
        return solid / (self.pack.network.area * dense) if dense > 0 else 0.0


def _rows(fines: Snapshot, some: Snapshot) -> Array:
    """Where in `fines` each of `some` of them is, by their ids."""
    order = np.argsort(fines.id)
    return order[np.searchsorted(fines.id[order], some.id)]


def _speed(velocity: Array) -> Array:
    return np.linalg.norm(velocity, axis=1)


# ------------------------------------------------------------------------------------------------
# The fluid that drives the fines of a case, where fdnet computes it while LIGGGHTS waits.


def fluid_of(case: InvasionCase, scales: InvasionScales, grains: Snapshot) -> Fluid | None:
    """The fluid of a coupled case; None where the deck holds the forces itself."""
    if case.drag.field == "network":
        return NetworkFluid(case=case, scales=scales, grains=grains)
    return UniformCrowd(case=case, scales=scales) if case.drag.coupled else None
