"""The table [run] of a case file: what controls a simulation, apart from the specimen."""

from typing import Annotated, Literal

from pydantic import Field

from fdnet.case.values import CONTACT_STEP_LIMIT, Fraction, Part, Positive, scaled

DEFAULT_STIFFNESS = 1.0e4
"""N/m, of the stiffest contact."""


class Run(Part):
    """Run control: contact stiffness, time step, when to stop and what to refuse.

    `max_hours`, `max_overlap` and `on_overlap` decide only whether a run may go on. No result
    depends on them, so they may be changed when a run is resumed. Times in ms are physical times;
    they differ from those of the simulation with `drag.drive_velocity_m_s`.
    """

    stiffness_N_m: Positive | Literal["nominal", "auto"] = Field(
        DEFAULT_STIFFNESS,
        description="Stiffness of the stiffest contact; all others keep their ratio to it. With "
        'contact.model = "hertz": force over overlap of the stiffest contact of a fine, at an '
        "overlap of 1 % of its diameter. "
        '"nominal" keeps the materials\' own stiffness, which needs a far smaller time step. '
        '"auto" takes the least that keeps the predicted overlaps of a fine at 3 % of its '
        "diameter, and at least the default.",
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
        0.2,
        description="Time step over sqrt(m/k) of the lightest sphere and stiffest contact. Linear "
        "contacts without rolling friction are stable up to 0.3 where damping ratios are at most "
        "0.48, and up to somewhat less with more damping; all others take at most 0.2.",
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
    stop_rate: Fraction | None = Field(
        None,
        description="Share of the first rate below which the invasion counts as plugged, where "
        'drag.field is "network" at constant pressure.',
    )
    stop_pore_volumes: Positive | None = Field(
        None,
        description="The invasion ends when so much fluid has passed the specimen, in volumes of "
        'its intact pores, where drag.field is "network".',
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

    @property
    def duration_s(self) -> float | None:
        """Length of the invasion, s; None: until the stop rule holds."""
        return scaled(self.duration_ms, 1e-3)

    @property
    def plug_time_s(self) -> float | None:
        """Time without a crossing after which the face counts as plugged, s, if given."""
        return scaled(self.plug_time_ms, 1e-3)

    @property
    def cap_s(self) -> float | None:
        """Time at which the invasion ends at the latest, s, if given."""
        return scaled(self.cap_ms, 1e-3)

    @property
    def checkpoint_s(self) -> float | None:
        """Time between checkpoints, s, if given."""
        return scaled(self.checkpoint_ms, 1e-3)

    @property
    def skin_m(self) -> float | None:
        """Skin of the neighbour search, m, if given."""
        return scaled(self.skin_mm, 1e-3)

    @property
    def neighbour_bin_m(self) -> float | None:
        """Bin width of the neighbour search, m, if given."""
        return scaled(self.neighbour_bin_mm, 1e-3)
