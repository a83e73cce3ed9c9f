"""A fluid that flows the other way: the specimen is mirrored, asked, and mirrored back."""

from dataclasses import dataclass, replace

import numpy as np

from fdnet.dem.fluid import Fluid, FluidForces, Moment
from fdnet.spheres.snapshot import Snapshot

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
