"""The tables [grains] and [fines] of a case file: sizes, material and number of the spheres."""

import math
from typing import Annotated, Literal

from pydantic import Field

from fdnet.case.values import (
    MAX_CONCENTRATION,
    Fraction,
    NonNegative,
    Part,
    Positive,
    Radius,
    scaled,
)

SHEAR_RATIO = 0.04
"""Tangential over normal stiffness of a material that gives none: small enough that no fine larger
than 1/370 of a grain at friction 0.55 locks between two grains (`fdnet.scales.sticking`)."""


class Spheres(Part):
    """What grains and fines share: sizes, density and the parameters of their contacts."""

    radius_mm: Radius = Field(
        description="Radius of a sphere. A list of two values, [smallest, largest], gives radii "
        "that are uniform by number between them."
    )
    density_kg_m3: Positive = Field(description="Density of the solid.")
    normal_stiffness_N_m: Positive = Field(
        description="Normal contact stiffness of the material. Two spheres in contact act as two "
        "springs in series. `run.stiffness_N_m` scales all contact stiffnesses by one factor."
    )
    shear_stiffness_N_m: Positive | None = Field(
        None,
        description="Tangential contact stiffness of the material, scaled like the normal one. "
        "When absent: 0.04 of the normal one, so that friction lets go of fines that roll around "
        "the neck of two grains.",
    )
    youngs_modulus_GPa: Positive = Field(
        description='Young\'s modulus of the material, for contact.model = "hertz".'
    )
    poissons_ratio: Annotated[float, Field(ge=0, le=0.5)] = Field(
        description='Poisson\'s ratio of the material, for contact.model = "hertz".'
    )
    friction: NonNegative = Field(
        0.55,
        description="Coefficient of sliding friction. A contact takes the smaller value of its "
        "two materials.",
    )
    damping_ratio: Annotated[float, Field(ge=0, lt=1)] = Field(
        0.2,
        description="Damping of a contact over its critical damping. A contact takes the mean of "
        "its two materials.",
    )

    @property
    def tangential_stiffness(self) -> float:
        """Tangential contact stiffness, N/m: the one given, or `SHEAR_RATIO` of the normal one."""
        given = self.shear_stiffness_N_m
        return SHEAR_RATIO * self.normal_stiffness_N_m if given is None else given

    @property
    def youngs_modulus_Pa(self) -> float:
        """Young's modulus of the material, Pa."""
        return self.youngs_modulus_GPa * 1e9

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
    def one_size(self) -> bool:
        """Whether all radii are equal."""
        return not isinstance(self.radius_mm, tuple)

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
        """Diameter of equal volume to surface ratio, 2 <r^3>/<r^2>, radius uniform in [a, b]."""
        low, high = self.radius_range_m
        return (
            2 * (0.25 * (low + high) * (low**2 + high**2)) / ((low**2 + low * high + high**2) / 3)
        )


class Grains(Spheres):
    """The skeleton: the sand grains of the formation. Give either `porosity` or `count`."""

    porosity: Fraction | None = Field(
        None,
        description="Porosity of the finished pack, with overlaps of grains counted once. The "
        "number of grains is adjusted until it is met within 0.003.",
    )
    count: Annotated[int, Field(ge=1)] | None = Field(
        None, description="Number of grains. It overrides `porosity`."
    )
    density_kg_m3: Positive = Field(2650.0, description="Density of the grains.")
    normal_stiffness_N_m: Positive = Field(
        94.3e9,
        description="Normal contact stiffness of the grains' material, and of the walls. "
        "`run.stiffness_N_m` scales all contact stiffnesses by one factor.",
    )
    shear_stiffness_N_m: Positive | None = Field(
        None,
        description="Tangential contact stiffness of the grains' material, and of the walls. When "
        "absent: 0.04 of the normal one, so that friction lets go of fines that roll around the "
        "neck of two grains. The thesis has 34e9.",
    )
    youngs_modulus_GPa: Positive = Field(
        94.3,
        description="Young's modulus of the grains' material, and of the walls, for "
        'contact.model = "hertz". The default is the thesis\'s (quartz). `run.stiffness_N_m` '
        "scales all moduli by one factor.",
    )
    poissons_ratio: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.387,
        description="Poisson's ratio of the grains' material, and of the walls, for "
        'contact.model = "hertz". The default is E / 2G - 1 of the thesis\'s 94.3 and 34 GPa.',
    )
    motion: Literal["fixed", "mobile"] = Field(
        "fixed",
        description='Motion of the grains during the invasion: "fixed" keeps them in place, '
        '"mobile" lets the fines push them. The fluid itself does not push grains.',
    )
    max_overlap: Fraction = Field(
        0.15,
        description="Largest accepted overlap of two grains in the pack, over the smaller "
        "diameter. A denser pack is refused.",
    )


class Fines(Spheres):
    """The invading particles: a slab of suspension upstream. Give either `count` or `slab_mm`.

    A case without this table has no invasion: only the intact pack is made and analysed.
    """

    density_kg_m3: Positive = Field(2146.0, description="Density of the fines.")
    normal_stiffness_N_m: Positive = Field(
        63.0e9, description="Normal contact stiffness of the fines' material."
    )
    shear_stiffness_N_m: Positive | None = Field(
        None,
        description="Tangential contact stiffness of the fines' material. When absent: 0.04 of "
        "the normal one. The thesis has 26e9.",
    )
    youngs_modulus_GPa: Positive = Field(
        63.0,
        description="Young's modulus of the fines' material, for contact.model = \"hertz\". The "
        "default is the thesis's.",
    )
    poissons_ratio: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.212,
        description="Poisson's ratio of the fines' material, for contact.model = \"hertz\". The "
        "default is E / 2G - 1 of the thesis's 63 and 26 GPa.",
    )
    concentration: Annotated[float, Field(gt=0, le=MAX_CONCENTRATION)] = Field(
        0.10, description="Volume of fines over the volume of suspension in the slab upstream."
    )
    count: Annotated[int, Field(ge=1)] | None = Field(
        None, description="Number of fines supplied. The length of the slab follows from it."
    )
    slab_mm: Positive | None = Field(
        None,
        description="Length of the slab of suspension along the flow. The number of fines follows "
        "from it.",
    )
    supply: Literal["slab", "batches"] = Field(
        "slab",
        description='How the fines enter: "slab" puts all of them in at the start, "batches" puts '
        "each part of the slab in when it is about to arrive. The suspension is the same; batches "
        "are much faster for a long slab.",
    )

    @property
    def slab_m(self) -> float | None:
        """Length of the slab of suspension, m; None: it follows from the count."""
        return scaled(self.slab_mm, 1e-3)
