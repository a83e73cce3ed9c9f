"""Tables of a case file: [box], [drag] and [gravity].

The keys carry the unit of the user; properties give the same values in SI for everything else.
"""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from fdnet.case.values import (
    NonNegative,
    Part,
    Positive,
    Triple,
    Vector,
    still_there,
)

CROWD_TRAVEL, FLOW_TRAVEL, MOST_TRAVEL = 0.5, 1.0, 10.0
"""Diameters of the smallest fine between two updates: by default, and at most."""


class Box(Part):
    """The specimen: flow and depth run along the first side; x = 0 is the formation face."""

    size_mm: Triple = Field(
        description="Three side lengths of the box. The mud flows along the first side."
    )
    sides: Literal["walls", "periodic"] = Field(
        "periodic",
        description="What bounds the box in y and z: periodic images of itself, or solid walls.",
    )
    wall_friction: NonNegative | None = Field(
        None,
        description="Coefficient of sliding friction of the side walls, if there are any. When "
        "absent it is that of the grains. A contact takes the smaller value of the wall and the "
        "sphere.",
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
    """Forces of the fluid on every fine: drag by its slip, and that of the pressure gradient."""

    field: Literal["uniform", "network"] = Field(
        "uniform",
        description='Velocity field of the fluid: "uniform" is the same velocity everywhere. '
        '"network" follows the pores of the pack and the deposit in them: fdnet solves it anew '
        "while LIGGGHTS waits.",
    )
    multiplier: Positive = Field(1.0, description="Factor on the Stokes drag.")
    scheme: Literal["held", "implicit", "viscous"] = Field(
        "held",
        description='How the force is integrated: "held" keeps it for `refresh_steps` steps, '
        '"viscous" splits it into a constant force and viscous damping (fines of one size only), '
        '"implicit" solves it for the new velocity and is stable at any step.',
    )
    refresh_steps: Annotated[int, Field(ge=1)] | None = Field(
        None,
        description='Steps for which scheme "held" keeps the force. When absent the force is kept '
        "for at most 0.05 of the drag relaxation time.",
    )
    drive_velocity_m_s: Positive | Literal["auto"] | None = Field(
        None,
        description="Velocity of the fluid in the pores of the simulation, to shorten a run with "
        "a weak push: every force is scaled by the same factor, and the physical clock runs "
        "faster by it. Allowed where the fines' inertia does not matter, up to an impact Stokes "
        'number of 1. "auto" drives to 0.1, or as fast as the fluid itself.',
    )
    upstream: Literal["interstitial", "darcy"] = Field(
        "darcy",
        description="Velocity of the fluid upstream of the formation face: the Darcy velocity of "
        "the mud, or the interstitial one of the pack, which brings the mud faster than it flows "
        "in.",
    )
    pressure_gradient: bool = Field(
        True,
        description="Whether the pressure gradient of the pack acts on every fine inside it, with "
        "the volume of the fine times the fall of pressure with x. The thesis's cases leave it "
        "out.",
    )
    inertia: Literal["none", "schiller-naumann"] = Field(
        "none",
        description='Drag at finite Reynolds numbers: "none" is Stokes\'s at any speed, '
        '"schiller-naumann" multiplies it by 1 + 0.15 Re^0.687 (Re up to 800; scheme "held").',
    )
    crowd: Literal["none", "beetstra"] = Field(
        "none",
        description='How other fines nearby change the drag on a fine: "none" leaves it that of a '
        'lone sphere, "beetstra" takes the law of Beetstra, van der Hoef and Kuipers (2007) with '
        "the porosity around each fine, which fdnet computes while LIGGGHTS waits.",
    )
    drive: Literal["pressure", "rate"] | None = Field(
        None,
        description='What stays constant where the field is "network": the pressure over pack, '
        "cake and the rest of the way on which the overbalance is lost, or the rate. When absent: "
        '"pressure".',
    )
    update_travel: Annotated[float, Field(gt=0, le=MOST_TRAVEL)] | None = Field(
        None,
        description="How far the fluid carries a fine, in diameters of the smallest fine, before "
        "the forces on all fines are computed anew. When absent: "
        f'{FLOW_TRAVEL:g} where the field is "network", else {CROWD_TRAVEL:g}.',
    )

    @field_validator("scheme", mode="before")
    @classmethod
    def _is_there(cls, name: Any) -> Any:
        return still_there(name, {"every_step": "held"})

    @property
    def coupled(self) -> bool:
        """Whether fdnet computes the forces on each fine while LIGGGHTS waits."""
        return self.crowd != "none" or self.field == "network"

    @property
    def slowed(self) -> bool:
        """Whether the deposit slows the mud down."""
        return self.field == "network" and self.drive != "rate"

    @property
    def travel_diameters(self) -> float:
        """Diameters of the smallest fine between two updates of a coupled invasion."""
        usual = FLOW_TRAVEL if self.field == "network" else CROWD_TRAVEL
        return usual if self.update_travel is None else self.update_travel


class Gravity(Part):
    """Weight and buoyancy of the moving spheres."""

    mode: Literal["auto", "on", "off"] = Field(
        "auto",
        description='"auto" leaves gravity out where weight over drag is below '
        "`negligible_below`; the run summary then says so.",
    )
    acceleration_m_s2: Vector = Field(
        (0.0, 0.0, -9.81), description="Gravity vector (x, y, z), in any direction."
    )
    buoyancy: bool = Field(
        True,
        description="Whether the fluid's buoyancy acts: gravity times 1 - fluid over sphere "
        "density, for fines and for mobile grains.",
    )
    negligible_below: NonNegative = Field(
        1e-3, description='Ratio of weight to drag below which mode "auto" leaves gravity out.'
    )
