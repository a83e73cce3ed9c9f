"""The table [bonds] of a case file: cement between the grains."""

from typing import Annotated

from pydantic import Field

from fdnet.case.values import Part, Positive, scaled


class Bonds(Part):
    """Parallel bonds: a disc of elastic cement between two grains.

    Only `fdnet mechanics` reads them; the invasion has no bonds.
    """

    radius_ratio: Annotated[float, Field(gt=0, le=1)] = Field(
        description="Radius of a bond over that of the smaller of its two grains."
    )
    normal_stiffness_GPa_m: Positive = Field(
        95.0, description="Normal stiffness of a bond per area of its disc."
    )
    shear_stiffness_GPa_m: Positive = Field(
        40.0, description="Shear stiffness of a bond per area of its disc."
    )
    tensile_strength_MPa: Positive | None = Field(
        None,
        description="Largest tensile stress of a bond. When absent, bonds never break; give it "
        "together with the shear strength.",
    )
    shear_strength_MPa: Positive | None = Field(
        None, description="Largest shear stress of a bond; see the tensile strength."
    )
    gap_ratio: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.01,
        description="Widest gap that a bond bridges, over the smaller diameter of its two grains.",
    )

    @property
    def normal_stiffness_Pa_m(self) -> float:
        """Normal stiffness per area, Pa/m."""
        return self.normal_stiffness_GPa_m * 1e9

    @property
    def shear_stiffness_Pa_m(self) -> float:
        """Shear stiffness per area, Pa/m."""
        return self.shear_stiffness_GPa_m * 1e9

    @property
    def tensile_strength_Pa(self) -> float | None:
        """Tensile strength, Pa; None: bonds never break."""
        return scaled(self.tensile_strength_MPa, 1e6)

    @property
    def shear_strength_Pa(self) -> float | None:
        """Shear strength, Pa; None: bonds never break."""
        return scaled(self.shear_strength_MPa, 1e6)
