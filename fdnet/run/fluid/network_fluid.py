"""The fluid of `drag.field` = "network": it follows the deposit, and the deposit follows it.

The force on a fine that moves is that of the uniform field (`uniform`) with local values: u is the
volume of suspension that passes a unit area of pores at its place (`network_flow`), G the fall of
pressure that this flow causes in the grains alone. A fine that stands in the pack feels what the
network's pressure does there (`pressed`), and G. Upstream of the face the mud moves at the rate
over the cross-section, and fines that stand there feel the drag of the crowd.

The rate U follows from the resistances in series: the pack with its deposit (network), the cake
(the drag on the fines that stand upstream), the drag on fines that move in the pack, and the rest
of the way on which the overbalance is lost, which stays as it is.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.coupled import steps_between
from fdnet.dem.fluid import FluidForces, Moment, drag_rate
from fdnet.network.fines.crowding import Neighbourhood, local_porosity
from fdnet.run.fluid.fine_forces import Deposit, FineForces, forces_on
from fdnet.run.fluid.network_flow import (
    RENEWED,
    Carried,
    PackFlow,
    Renewal,
    pack_flow,
    placed,
)
from fdnet.run.fluid.pressed import on_each_fine
from fdnet.run.fluid.sampled_places import Places
from fdnet.run.fluid.uniform import CROWD_COLUMNS, crowd_factor, crowd_measures
from fdnet.run.fluid.way_ahead import Movers, mean_ahead
from fdnet.run.history import FLOW_COLUMNS
from fdnet.scales.scales import InvasionScales
from fdnet.scales.velocity import path_of
from fdnet.spheres.snapshot import Array, Snapshot

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
