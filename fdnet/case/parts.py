"""The tables of a case file: each validates its own keys; lengths and pressures carry their unit in the key."""

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

MAX_CONCENTRATION = 0.30
"""Random sequential addition of spheres saturates near 0.38 (Torquato, Uche & Stillinger 2006)."""

MOST_GRAINS, MOST_FINES, MOST_SLAB, MOST_BINS = 10_000_000, 10_000_000, 1000, 10_000
"""Bounds on what a case may ask for: number of grains and of fines, slab over box length, bins."""

LEAST_SKIN, MOST_NEIGHBOUR_BINS = 0.01, 10_000_000
"""Smallest skin over the smallest fine's radius, most bins of the neighbour search in the box."""

CONTACT_STEP_LIMIT = 0.2
"""Largest time step over sqrt(m/k): at 0.3 energy still holds, at 0.5 it grows (measured, docs/physics.md)."""


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


Positive = Annotated[float, Field(ge=1e-18, le=1e15, allow_inf_nan=False)]
Fraction = Annotated[float, Field(gt=0, lt=1)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Pair = Annotated[tuple[Positive, Positive], BeforeValidator(_as_tuple)]
Triple = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(_as_tuple)]
Vector = Annotated[tuple[Finite, Finite, Finite], BeforeValidator(_as_tuple)]
Radius = Annotated[Positive | Pair, Field(union_mode="smart")]


class Part(BaseModel):
    """A table of the case file: frozen, no unknown keys, no silent conversion of text to numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Spheres(Part):
    """What grains and fines share: sizes, density and linear (Hooke) contact parameters."""

    radius_mm: Radius
    density_kg_m3: Positive
    normal_stiffness_N_m: Positive
    shear_stiffness_N_m: Positive
    friction: NonNegative = 0.55
    damping_ratio: Annotated[float, Field(ge=0, lt=1)] = 0.2

    @property
    def radius_range_m(self) -> tuple[float, float]:
        """Smallest and largest radius, m; radii are uniform by number between them."""
        pair = (
            self.radius_mm
            if isinstance(self.radius_mm, tuple)
            else (self.radius_mm, self.radius_mm)
        )
        return pair[0] * 1e-3, pair[1] * 1e-3

    @property
    def mean_radius_m(self) -> float:
        """Number mean of the radius, m."""
        low, high = self.radius_range_m
        return 0.5 * (low + high)

    @property
    def mean_volume_m3(self) -> float:
        """Mean sphere volume of a radius uniform in [a, b]: pi/3 (a + b)(a^2 + b^2)."""
        low, high = self.radius_range_m
        return math.pi / 3 * (low + high) * (low**2 + high**2)

    @property
    def sauter_diameter_m(self) -> float:
        """Diameter of equal volume to surface ratio, 6 V/S = 2 <r^3>/<r^2>, radius uniform in [a, b]."""
        low, high = self.radius_range_m
        return (
            2 * (0.25 * (low + high) * (low**2 + high**2)) / ((low**2 + low * high + high**2) / 3)
        )


class Box(Part):
    """The specimen: flow and depth along the first side; `sides` is what bounds the other two."""

    size_mm: Triple
    sides: Literal["walls", "periodic"] = "walls"
    wall_friction: NonNegative = 0.0


class Grains(Spheres):
    """The skeleton. `porosity` counts overlap once; `count` overrides it."""

    porosity: Fraction | None = None
    count: Annotated[int, Field(ge=1)] | None = None
    density_kg_m3: Positive = 2650.0
    normal_stiffness_N_m: Positive = 94.3e9
    shear_stiffness_N_m: Positive = 34.0e9
    motion: Literal["fixed", "mobile"] = "fixed"
    max_overlap: Fraction = 0.15


class Fines(Spheres):
    """The invading particles: a slab upstream, given by its length or by the number of fines.

    `supply` puts the whole slab into the simulation at once, or feeds it in batches, each when it is about to arrive.
    """

    density_kg_m3: Positive = 2146.0
    normal_stiffness_N_m: Positive = 63.0e9
    shear_stiffness_N_m: Positive = 26.0e9
    concentration: Annotated[float, Field(gt=0, le=MAX_CONCENTRATION)] = 0.10
    count: Annotated[int, Field(ge=1)] | None = None
    slab_mm: Positive | None = None
    supply: Literal["slab", "batches"] = "slab"


class Fluid(Part):
    """The mud's liquid. Its velocity is given, or follows from Darcy's law and Carman-Kozeny."""

    viscosity_cP: Positive = 50.0
    density_kg_m3: Positive = 1095.0
    overbalance_MPa: Positive = 3.5
    velocity_m_s: Positive | None = None
    darcy_length_mm: Positive | None = None


class Drag(Part):
    """Stokes drag on every fine, by one of four schemes.

    `every_step` and `held` (for `refresh_steps` steps) evaluate the force; `viscous` splits it into a constant force
    and viscous damping (one size of fines only); `implicit` solves it for the new velocity, stable at any step.
    """

    field: Literal["uniform", "network"] = "uniform"
    multiplier: Positive = 1.0
    scheme: Literal["every_step", "held", "implicit", "viscous"] = "held"
    refresh_steps: Annotated[int, Field(ge=1)] | None = None
    upstream: Literal["interstitial", "darcy"] = "interstitial"


class Gravity(Part):
    """`auto` leaves gravity out of the deck where gravity over drag is below `negligible_below`."""

    mode: Literal["auto", "on", "off"] = "auto"
    acceleration_m_s2: Vector = (0.0, 0.0, -9.81)
    buoyancy: bool = True
    negligible_below: NonNegative = 1e-3


class Run(Part):
    """Run control. Times left out are derived from the case (see `fdnet render`).

    `stiffness_N_m` is that of the stiffest contact; "nominal" leaves the materials as they are. `max_hours` is what a
    run may be expected to take. An overlap of a fine above `max_overlap` of the smaller diameter is told, or stops the
    run. These three decide nothing else, so a finished stage does not depend on them. The face counts as plugged when
    in `plug_time_ms` no more fines cross it than `plug_rate` of those the undisturbed suspension would bring. `skin_mm`
    and `neighbour_bin_mm` are LIGGGHTS's neighbour search in the invasion: time, and the order of sums.
    """

    stiffness_N_m: Positive | Literal["nominal"] = 1.0e4
    max_hours: Positive = 24.0
    max_overlap: Fraction = 0.03
    on_overlap: Literal["warn", "stop"] = "warn"
    time_step_factor: Annotated[float, Field(gt=0, le=CONTACT_STEP_LIMIT)] = 0.1
    time_step_s: Positive | None = None
    duration_ms: Positive | None = None
    plug_time_ms: Positive | None = None
    plug_rate: Annotated[float, Field(ge=0, lt=1)] = 0.0
    cap_ms: Positive | None = None
    checkpoint_ms: Positive | None = None
    skin_mm: Positive | None = None
    neighbour_bin_mm: Positive | None = None
