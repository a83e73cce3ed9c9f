"""The tables [fluid] and [well] of a case file: the liquid of the mud and what drives it."""

import math
from typing import Literal

from pydantic import Field

from fdnet.case.values import Part, Positive, scaled

M2_PER_MD = 9.869233e-16
"""One millidarcy in m2."""


class Fluid(Part):
    """The mud's liquid. Its velocity is given, or follows from the overbalance by Darcy's law."""

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
        "`overbalance_MPa` and either the table `[well]` or `darcy_length_mm`.",
    )
    darcy_length_mm: Positive | None = Field(
        None,
        description="Length of a plug over which the whole overbalance is lost. Without it and "
        "without the table `[well]` it is the length of the box, which warns: around a well the "
        "gradient is about a hundred times less.",
    )
    darcy_law: Literal["darcy", "ergun"] = Field(
        "darcy",
        description='How the overbalance becomes a velocity: "darcy" takes the viscous loss '
        'alone, "ergun" adds the loss by inertia. Where this loss lowers the velocity by 5 % or '
        'more, "darcy" warns.',
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

    @property
    def overbalance_Pa(self) -> float:
        """Pressure of the mud above that of the formation, Pa."""
        return self.overbalance_MPa * 1e6


class Well(Part):
    """A vertical well in its formation: the overbalance is lost in radial flow around it.

    The specimen is a piece of the formation at the face of the well.
    """

    radius_mm: Positive = Field(description="Radius of the well, to the formation face.")
    drainage_radius_m: Positive = Field(
        description="Radius at which the pressure is that of the undisturbed formation."
    )
    formation_permeability_mD: Positive | None = Field(
        None,
        description="Permeability of the formation around the well. When absent it is that of "
        "the pack by Carman and Kozeny.",
    )

    @property
    def radius_m(self) -> float:
        """Radius of the well, m."""
        return self.radius_mm * 1e-3

    @property
    def formation_permeability_m2(self) -> float | None:
        """Permeability of the formation, m2; None: that of the pack."""
        return scaled(self.formation_permeability_mD, M2_PER_MD)
