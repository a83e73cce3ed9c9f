"""Drag in a crowd of fines in the uniform field: Beetstra's law of the porosity around each fine.

The uniform velocity u is the volume of suspension that passes a unit area of pores in a unit
of time. Where fines of porosity phi stand in it, the fluid flows at u / phi between them; where
they move with it, there is no slip. So the superficial slip is u - v in either case, and

    F = 6 pi mu r M Y F_b / phi (u - v) + V G,

with Beetstra's factor F_b and the size factor Y (`fdnet.scales.forces.crowd`). The first part is
the total force of the fluid in the crowd, the fall of pressure that the crowd itself causes among
it: fines that fill a cross-section A and stand take up dp A. G is the gradient of the intact pack
without fines, which acts inside the pack where `drag.pressure_gradient` asks for it. So the two
gradients add, and none is counted twice.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.fluid import FluidForces, Moment
from fdnet.network.fines.crowding import Neighbourhood, local_porosity
from fdnet.scales.forces.crowd import Crowd, drag_factor
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Array, Snapshot

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
    return drag_factor(crowd, gradient_apart=False) / near.porosity


def crowd_measures(factor: Array, near: Neighbourhood) -> dict[str, float]:
    """`CROWD_COLUMNS`, from the `factor` (N,) on the drag of fines."""
    values = (
        float(np.mean(factor)) if len(factor) else 1.0,
        float(np.max(factor, initial=1.0)),
        float(np.min(near.porosity, initial=1.0)),
        near.capped,
    )
    return dict(zip(CROWD_COLUMNS, values, strict=True))
