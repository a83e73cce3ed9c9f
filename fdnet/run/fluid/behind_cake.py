"""The uniform field of a clean-up whose cake stays: the fluid is slower while the cake stands."""

from dataclasses import dataclass, replace

from fdnet.dem.fluid import FluidForces, Moment
from fdnet.dem.kept_cake import KeptCake
from fdnet.run.fluid.mirrored import Mirrored
from fdnet.run.fluid.uniform import UniformCrowd
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class BehindCake:
    """The uniform field turned back, behind a cake.

    Attributes:
        fluid: without the cake, in the mirrored specimen.
        cake: that stays.
    """

    fluid: UniformCrowd
    cake: KeptCake

    @property
    def measured(self) -> tuple[str, ...]:
        """The measures of the fluid."""
        return self.fluid.measured

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""
        scales = self.fluid.scales
        slower = replace(self.fluid, scales=slowed(scales, self.cake.rate(spheres)))
        made = Mirrored(fluid=slower).forces(spheres, moment)
        # the rate rises as the cake comes off, so what moves is looked at as often as without it
        return replace(made, pace=scales.drive_velocity)


def slowed(scales: InvasionScales, rate: float) -> InvasionScales:
    """The scales with the velocities and the gradient at `rate` times the fluid's rate."""
    push = scales.push
    return replace(
        scales,
        drive_velocity=rate * scales.drive_velocity,
        upstream_velocity=rate * scales.upstream_velocity,
        push=replace(push, velocity=rate * push.velocity, gradient=rate * push.gradient),
    )
