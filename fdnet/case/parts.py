"""The other tables of a case file; lengths, pressures and times carry their unit in the key."""

from typing import Annotated, Literal

from pydantic import Field

from fdnet.case.values import (
    CONTACT_STEP_LIMIT,
    MOST_SECTIONS,
    Fraction,
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


class Run(Part):
    """Run control: contact stiffness, time step, when to stop and what to refuse.

    `max_hours`, `max_overlap` and `on_overlap` decide only whether a run may go on. No result
    depends on them, so they may be changed when a run is resumed.
    """

    stiffness_N_m: Positive | Literal["nominal"] = Field(
        1.0e4,
        description="Stiffness of the stiffest contact; all others keep their ratio to it. "
        '"nominal" keeps the materials\' own stiffness, which needs a far smaller time step.',
    )
    max_hours: Positive = Field(
        24.0, description="A case that is expected to run longer is refused before it starts."
    )
    max_overlap: Fraction = Field(
        0.03,
        description="Overlap of a fine with another sphere, over the smaller diameter, above "
        "which `on_overlap` applies.",
    )
    on_overlap: Literal["warn", "stop"] = Field(
        "warn",
        description="What follows when `max_overlap` is exceeded: a warning in the summary, or "
        "the run stops with its state kept.",
    )
    time_step_factor: Annotated[float, Field(gt=0, le=CONTACT_STEP_LIMIT)] = Field(
        0.1, description="Time step over sqrt(m/k) of the lightest sphere and stiffest contact."
    )
    time_step_s: Positive | None = Field(
        None,
        description="Time step of the invasion. When absent it follows from `time_step_factor`, "
        "and explicit drag keeps it below 0.1 of the drag relaxation time.",
    )
    duration_ms: Positive | None = Field(
        None,
        description="Length of the invasion. It replaces the stop rule and excludes `cap_ms`.",
    )
    plug_time_ms: Positive | None = Field(
        None,
        description="The face counts as plugged when no fine has crossed it for this time. When "
        "absent: the longer of the time in which the fluid passes four grain diameters and the "
        "time in which ten fines arrive.",
    )
    plug_rate: Annotated[float, Field(ge=0, lt=1)] = Field(
        0.0,
        description="Share of the undisturbed supply that may still cross the face while it "
        "counts as plugged.",
    )
    cap_ms: Positive | None = Field(
        None,
        description="The invasion ends at this time at the latest. When absent it is derived from "
        "the length of the slab, the plug time and the passage of the fluid.",
    )
    checkpoint_ms: Positive | None = Field(
        None,
        description="Time between checkpoints (dump and restart). When absent: the time in which "
        "the fluid passes about one grain diameter.",
    )
    skin_mm: Positive | None = Field(
        None,
        description="Skin of LIGGGHTS's neighbour search. When absent: the radius of the smallest "
        "fine. It changes run time and the order of sums, not the physics.",
    )
    neighbour_bin_mm: Positive | None = Field(
        None,
        description="Bin width of LIGGGHTS's neighbour search. When absent LIGGGHTS chooses it.",
    )


class AnalysisChoices(Part):
    """How permeability is computed; the default laws are fdnet's most accurate pair."""

    sections: Annotated[int, Field(ge=1, le=MOST_SECTIONS)] = Field(
        8, description="Number of equal slabs along the flow in `sections.csv`."
    )
    law: Literal["thesis", "effective", "hydraulic", "series", "lubrication"] = Field(
        "lubrication", description="Conductance of a clean throat."
    )
    damage_law: Literal["thesis", "thesis-code", "kozeny", "side-kozeny"] = Field(
        "side-kozeny", description="Conductance of a throat with fines over that of the clean one."
    )
    clogging_threshold: Fraction | None = Field(
        None,
        description="Throat porosity below which the thesis's damage laws take a throat as "
        'clogged. When absent: 0.40 ("thesis") or 0.36 ("thesis-code").',
    )
    middle_band: Literal["threshold", "position"] = Field(
        "threshold",
        description="Rule of the thesis's damage laws for a throat porosity of 0.36 to 0.80: "
        "by `clogging_threshold` alone, or by where the fines lie in the throat.",
    )
    throat_overlap: Literal["exact", "two-plane"] = Field(
        "exact",
        description="Volume of a fine inside a throat: exact, or by the thesis's two planes.",
    )
    profile_bin_mm: Positive = Field(0.25, description="Width of the depth bins in `profile.csv`.")
    walls: Literal["no-slip", "slip"] = Field(
        "no-slip",
        description="Whether side walls hold the fluid or let it slip; known to the laws "
        '"lubrication" and "side-kozeny".',
    )
