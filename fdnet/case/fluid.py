"""The table [fluid] of a case file: the liquid of the mud and what drives it."""

import math

from pydantic import Field

from fdnet.case.values import Part, Positive, scaled


class Fluid(Part):
    """The mud's liquid. Its velocity is given, or follows from Darcy's law and Carman-Kozeny."""

    viscosity_cP: Positive = Field(50.0, description="Dynamic viscosity.")
    density_kg_m3: Positive = Field(
        1095.0, description="Density; it decides buoyancy and the particle Reynolds number."
    )
    overbalance_MPa: Positive = Field(
        3.5,
        description="Pressure of the mud above that of the formation. Darcy's law turns it into "
        "the fluid's velocity.",
    )
    velocity_m_s: Positive | None = Field(
        None,
        description="Interstitial velocity of the fluid along x. When absent it follows from "
        "`overbalance_MPa` and `darcy_length_mm`.",
    )
    darcy_length_mm: Positive | None = Field(
        None,
        description="Length over which the overbalance is lost. When absent it is the length of "
        "the box.",
    )

    @property
    def viscosity_Pa_s(self) -> float:
        """Dynamic viscosity, Pa s."""
        return self.viscosity_cP * 1e-3

    @property
    def stokes_coefficient_Pa_s(self) -> float:
        """6 pi viscosity: the drag force over radius and relative velocity, Pa s (Stokes 1851)."""
        return 6 * math.pi * self.viscosity_cP * 1e-3

    @property
    def darcy_length_m(self) -> float | None:
        """Length over which the overbalance is lost, m; None: the length of the box."""
        return scaled(self.darcy_length_mm, 1e-3)

    def darcy_velocity(self, permeability: float, length: float) -> float:
        """q = k dP / (mu L), m/s, for `permeability` m2 and `length` m (Darcy 1856)."""
        return permeability / self.viscosity_Pa_s * self.overbalance_MPa * 1e6 / length
