"""Tables of a case file: [box], [drag] and [gravity].

The keys carry the unit of the user; properties give the same values in SI for everything else.
"""

from typing import Annotated, Literal

from pydantic import Field

from fdnet.case.values import (
    NonNegative,
    Part,
    Positive,
    Triple,
    Vector,
)


class Box(Part):
    """The specimen: flow and depth run along the first side; x = 0 is the formation face."""

    size_mm: Triple = Field(
        description="Three side lengths of the box. The mud flows along the first side."
    )
    sides: Literal["walls", "periodic"] = Field(
        "walls",
        description="What bounds the box in y and z: solid walls, or periodic images of itself.",
    )
    wall_friction: NonNegative = Field(
        0.0,
        description="Coefficient of sliding friction of the side walls. A contact takes the "
        "smaller value of the wall and the sphere.",
    )

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Side lengths (x, y, z), m."""
        x, y, z = self.size_mm
        return x * 1e-3, y * 1e-3, z * 1e-3

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions are periodic; the flow direction never is."""
        sideways = self.sides == "periodic"
        return False, sideways, sideways


class Drag(Part):
    """Stokes drag on every fine: 6 pi viscosity multiplier radius (fluid minus fine velocity)."""

    field: Literal["uniform", "network"] = Field(
        "uniform",
        description='Velocity field of the fluid: "uniform" is the same velocity everywhere. '
        '"network" is reserved and is refused for now.',
    )
    multiplier: Positive = Field(1.0, description="Factor on the Stokes drag.")
    scheme: Literal["every_step", "held", "implicit", "viscous"] = Field(
        "held",
        description='How the force is integrated: "every_step" computes it at each step, "held" '
        'keeps it for `refresh_steps` steps, "viscous" splits it into a constant force and '
        'viscous damping (fines of one size only), "implicit" solves it for the new velocity and '
        "is stable at any step.",
    )
    refresh_steps: Annotated[int, Field(ge=1)] | None = Field(
        None,
        description='Steps for which scheme "held" keeps the force. When absent the force is kept '
        "for at most 0.05 of the drag relaxation time.",
    )
    upstream: Literal["interstitial", "darcy"] = Field(
        "interstitial",
        description="Velocity of the fluid upstream of the formation face: the interstitial one "
        "of the pack, or the Darcy velocity.",
    )
    crowd: Literal["none", "beetstra"] = Field(
        "none",
        description='How other spheres nearby change the drag on a fine: "none" leaves it that of '
        'a lone sphere. "beetstra", the law of Beetstra, van der Hoef and Kuipers (2007), is '
        "refused for now.",
    )


class Gravity(Part):
    """Weight and buoyancy of the moving spheres."""

    mode: Literal["auto", "on", "off"] = Field(
        "auto",
        description='"auto" leaves gravity out where weight over drag is below '
        "`negligible_below`; the run summary then says so.",
    )
    acceleration_m_s2: Vector = Field((0.0, 0.0, -9.81), description="Gravity vector (x, y, z).")
    buoyancy: bool = Field(
        True,
        description="Whether the fluid's buoyancy acts. It needs gravity down one axis.",
    )
    negligible_below: NonNegative = Field(
        1e-3, description='Ratio of weight to drag below which mode "auto" leaves gravity out.'
    )
