"""Drag in a crowd of fines in the uniform field: Beetstra's law of the porosity around each fine.

The uniform velocity u is the volume of suspension that passes a unit area of pores in a unit
of time. Where fines of porosity phi stand in it, the fluid flows at u / phi between them; where
they move with it, there is no slip. So the superficial slip is u - v in either case, and

    F = 6 pi mu r M Y F_b / phi (u - v),

with Beetstra's factor F_b and the size factor Y (`fdnet.scales.forces.crowd`). This is the total
force of the fluid in the crowd, the fall of pressure that the crowd itself causes among it: fines
that fill a cross-section A and stand still take up dp A.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.fluid import FluidForces, Moment
from fdnet.network.fines.crowding import local_porosity
from fdnet.scales.forces.crowd import Crowd, drag_factor
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformCrowd:
    """The uniform field, with drag by the crowd around each fine."""

    case: InvasionCase
    scales: InvasionScales

    @property
    def measured(self) -> tuple[str, ...]:
        """Mean and largest factor on the drag, least porosity, fines whose porosity was capped."""
        return ("factor_mean", "factor_most", "porosity_least", "porosity_capped")

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""
        fines = spheres.fines()
        near = local_porosity(spheres, self.case.periodic)
        crowd = Crowd(porosity=near.porosity, size_ratio=near.size_ratio)
        factor = drag_factor(crowd, gradient_apart=False) / near.porosity
        lone = self.case.fluid.stokes_coefficient_Pa_s * self.case.drag.multiplier * fines.radius
        velocity = np.zeros((len(fines), 3))
        inside = fines.position[:, 0] >= 0.0
        velocity[:, 0] = np.where(
            inside, self.scales.interstitial_velocity, self.scales.upstream_velocity
        )
        return FluidForces(
            coefficient=lone * factor,
            velocity=velocity,
            push=np.zeros((len(fines), 3)),
            pace=self.scales.interstitial_velocity,
            measures={
                "factor_mean": float(np.mean(factor)) if len(fines) else 1.0,
                "factor_most": float(np.max(factor, initial=1.0)),
                "porosity_least": float(np.min(near.porosity, initial=1.0)),
                "porosity_capped": near.capped,
            },
        )
