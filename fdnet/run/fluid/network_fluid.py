"""The fluid of `drag.field` = "network": it follows the deposit, and the deposit follows it.

The force on a fine is that of the uniform field (`uniform`) with local values: u is the volume of
suspension that passes a unit area of pores at its place (`network_flow`), G the fall of pressure
that this flow causes in the grains alone. What the fines add to the fall of pressure is in the
drag of the crowd. Upstream of the face the mud moves at the rate over the cross-section.

The rate U follows from the resistances in series: the pack with its deposit (network), the cake
(the drag on the fines that stand upstream) and the rest of the way on which the overbalance is
lost, which stays as it is.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.fluid import FluidForces, Moment
from fdnet.network.fines.crowding import Neighbourhood, local_porosity
from fdnet.run.fluid.network_flow import Carried, PackFlow, Renewal, pack_flow
from fdnet.run.fluid.uniform import crowd_factor
from fdnet.run.history import FLOW_COLUMNS
from fdnet.scales.scales import InvasionScales
from fdnet.scales.velocity import path_of
from fdnet.spheres.snapshot import Array, Snapshot

STANDING = 0.5
"""A fine belongs to the deposit when it moves slower than this share of the intact pack's flow."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Balance:
    """Momentum of the fluid in the pack along x, N.

    Attributes:
        whole: drop of pressure times area, which the forces on grains and fines must add up to.
        grains: force on the grains.
    """

    whole: float
    grains: float

    def throat_factor(self, held: float, others: float) -> float:
        """Factor on the drag `held` of the deposit that closes the balance; `others` are known.

        At least 1: a fine that stands in a throat takes up more than one in a wide crowd (5 times
        at half the width of a tube, Haberman and Sayre 1958), and the network says how much.
        """
        return max(1.0, (self.whole - others) / held) if held > 0 else 1.0

    def defect(self, force: float) -> float:
        """|forces - drop times area| over drop times area; 0 without a drop."""
        return abs(force - self.whole) / self.whole if self.whole > 0 else 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class NetworkFluid:
    """The fluid in a pack whose pores the fines fill.

    Attributes:
        case: what is run.
        scales: of the case.
        grains: of the pack, fixed.
    """

    case: InvasionCase
    scales: InvasionScales
    grains: Snapshot

    @property
    def measured(self) -> tuple[str, ...]:
        """What a row of the record holds; see docs/physics.md."""
        return (
            "velocity_m_s",
            *FLOW_COLUMNS,
            "factor_mean",
            "factor_most",
            "porosity_least",
            "porosity_capped",
            "pores_stagnant",
        )

    @cached_property
    def pack(self) -> PackFlow:
        """The intact pack."""
        return pack_flow(self.grains, self.case.periodic, self.case.analysis.walls)

    @cached_property
    def _renewal(self) -> Renewal:
        return Renewal(self.pack)

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
        shape = pack.shape.at(fines.position)
        before = self.first_velocity if moment.before is None else moment.before["velocity_m_s"]
        standing = _speed(fines.velocity) < STANDING * before * _speed(shape)
        carried = self._renewal.of(fines.where(standing), anew=moment.fresh)
        near = local_porosity(spheres, self.case.periodic)
        share = np.where(within, carried.ratio[pack.pore_of(fines.position)], 1.0)
        shape = shape * share[:, None]
        held, caked = standing & within, standing & (depth < 0)
        factor = self._factor(near, fines, before * shape)
        coefficient = self.scales.push.coefficient * fines.radius * factor
        cake = float(coefficient[caked] @ shape[caked, 0]) / pack.network.area
        speed = self._velocity(carried, cake)
        push = self._push(fines, speed * np.where(within, share, 0.0))
        drag = coefficient * (speed * shape - fines.velocity)[:, 0]
        balance = self._balance(carried, speed)
        others = float(push[within, 0].sum() + drag[within & ~held].sum()) + balance.grains
        narrow = balance.throat_factor(float(drag[held].sum()), others)
        return FluidForces(
            coefficient=np.where(held, narrow * coefficient, coefficient),
            velocity=speed * shape,
            push=push,
            pace=speed / self.scales.porosity,
            measures=self._pressures(carried, cake, speed)
            | self._ledger(speed, moment)
            | _crowd(factor, near)
            | {
                "cake_thickness_m": self._thickness(fines.radius[caked], near, caked),
                "momentum_defect": balance.defect(narrow * float(drag[held].sum()) + others),
                "throat_factor": narrow,
                "pores_stagnant": carried.stagnant,
            },
        )

    def _factor(self, near: Neighbourhood, fines: Snapshot, velocity: Array) -> Array:
        if self.case.drag.crowd == "none":
            return np.ones(len(fines))
        slip = np.linalg.norm(velocity - fines.velocity, axis=1)
        return crowd_factor(self.scales, near, fines.radius, slip)

    def _velocity(self, carried: Carried, cake: float) -> float:
        """Superficial velocity, m/s, with a cake of `cake` Pa s/m.

        At constant pressure U / U0 = (1 + rest) / (k0 / k + rest + cake k0 / (mu L)).
        """
        if self.case.drag.drive == "rate":
            return self.first_velocity
        if carried.k_over_k0 <= 0:
            return 0.0
        intact = self._viscosity * self.pack.length / self.pack.permeability
        resistance = 1.0 / carried.k_over_k0 + self.rest + cake / intact
        return self.first_velocity * (1.0 + self.rest) / resistance

    @property
    def _viscosity(self) -> float:
        return self.case.fluid.viscosity_Pa_s

    def _push(self, fines: Snapshot, speed: Array) -> Array:
        """V (-grad p) of the grains, (N, 3) N, for the local `speed` (N,) m/s over the shape."""
        if not self.case.drag.pressure_gradient:
            return np.zeros((len(fines), 3))
        gradient = self.pack.shape.pressure_gradient_at(fines.position) * self.pack.scale
        volume = 4.0 / 3.0 * np.pi * fines.radius**3
        return -gradient * (self._viscosity * volume * speed)[:, None]

    def _pressures(self, carried: Carried, cake: float, speed: float) -> dict[str, float]:
        """Drops of pressure of the fluid itself, Pa, and the permeability."""
        factor = self.scales.force_factor
        return {
            "k_over_k0": carried.k_over_k0,
            "pressure_cake_Pa": cake * speed / factor,
            "pressure_pack_Pa": self._drop(carried, speed) / factor,
        }

    def _drop(self, carried: Carried, speed: float) -> float:
        """Drop of pressure over the pack as simulated, Pa."""
        if carried.k_over_k0 <= 0:
            return 0.0
        intact = self._viscosity * speed * self.pack.length / self.pack.permeability
        return intact / carried.k_over_k0

    def _balance(self, carried: Carried, speed: float) -> Balance:
        return Balance(
            whole=self._drop(carried, speed) * self.pack.network.area,
            grains=self._viscosity * speed * self.pack.grain_force(carried),
        )

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


def _speed(velocity: Array) -> Array:
    return np.linalg.norm(velocity, axis=1)


def _crowd(factor: Array, near: Neighbourhood) -> dict[str, float]:
    return {
        "factor_mean": float(np.mean(factor)) if len(factor) else 1.0,
        "factor_most": float(np.max(factor, initial=1.0)),
        "porosity_least": float(np.min(near.porosity, initial=1.0)),
        "porosity_capped": near.capped,
    }
