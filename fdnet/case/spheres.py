"""What the tables [grains] and [fines] share: sizes, density and contact of spheres."""

import math
from functools import cached_property
from typing import Annotated, Any

from pydantic import Field

from fdnet.case.materials import Solid
from fdnet.case.sizes import Sizes
from fdnet.case.values import NonNegative, Part, Positive, Radius
from fdnet.sizes.curve import NUMBER, SizeCurve, blended
from fdnet.sizes.laws import Uniform

SHEAR_RATIO = 0.04
"""Tangential over normal stiffness of a material that gives none: small enough that no fine larger
than 1/370 of a grain at friction 0.55 locks between two grains (`fdnet.scales.sticking`)."""


class Spheres(Part):
    """What grains and fines share: sizes, density and the parameters of their contacts."""

    radius_mm: Radius | None = Field(
        None,
        description="Radius of a sphere. A list of two values, [smallest, largest], gives radii "
        "that are uniform by number between them. Give this or `sizes`.",
    )
    sizes: Sizes | None = Field(
        None,
        description="A measured curve of diameters instead of `radius_mm`; its keys are below.",
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

    @cached_property
    def components(self) -> tuple[Solid, ...]:
        """The materials that the spheres are of: one."""
        return (Solid(name="", share=1.0, curve=self._own_curve(), density=self.density_kg_m3),)

    @cached_property
    def curve(self) -> SizeCurve:
        """The curve of the diameters, m, of all spheres."""
        return blended(
            [one.share for one in self.components], [one.curve for one in self.components]
        )

    @property
    def mean_density_kg_m3(self) -> float:
        """Mass over volume of the spheres that are placed."""
        if len(self.components) == 1:
            return self.components[0].density
        volumes = [one.share * one.curve.kept for one in self.components]
        masses = [one.density * v for one, v in zip(self.components, volumes, strict=True)]
        return sum(masses) / sum(volumes)

    @property
    def finest_m(self) -> float:
        """Diameter, m, below which sizes are left out."""
        return 0.0

    def _own_curve(self) -> SizeCurve:
        if self.sizes is not None:
            return self.sizes.curve(self.finest_m)
        low, high = (2 * radius for radius in self._given_range)
        return SizeCurve(law=Uniform(low, high), by=NUMBER, low=low, high=high)

    @property
    def _given_range(self) -> tuple[float, float]:
        pair = self.radius_mm if isinstance(self.radius_mm, tuple) else (self.radius_mm,) * 2
        return (pair[0] or 0.0) * 1e-3, (pair[1] or 0.0) * 1e-3

    @property
    def has_one_curve(self) -> bool:
        """Whether the sizes are given, and once only."""
        return sum(key is not None for key in self._size_keys) == 1

    @property
    def _size_keys(self) -> tuple[Any, ...]:
        return self.radius_mm, self.sizes

    @property
    def measured(self) -> bool:
        """Whether the sizes are given by curves, and not by `radius_mm`."""
        return self.radius_mm is None

    @property
    def radius_range_m(self) -> tuple[float, float]:
        """Smallest and largest radius, m."""
        if self.measured:
            return 0.5 * self.curve.low, 0.5 * self.curve.high
        return self._given_range

    @property
    def one_size(self) -> bool:
        """Whether all radii are equal."""
        return isinstance(self.radius_mm, float | int)

    @property
    def mean_radius_m(self) -> float:
        """Number mean of the radius, m."""
        if self.measured:
            return 0.5 * self.curve.mean(1)
        low, high = self.radius_range_m
        return 0.5 * (low + high)

    @property
    def mean_volume_m3(self) -> float:
        """Mean sphere volume; of a radius uniform in [a, b] it is pi/3 (a + b)(a^2 + b^2)."""
        if self.measured:
            return math.pi / 6 * self.curve.mean(3)
        low, high = self.radius_range_m
        return math.pi / 3 * (low + high) * (low**2 + high**2)

    @property
    def sauter_diameter_m(self) -> float:
        """Diameter of equal volume to surface ratio, <d^3>/<d^2>."""
        if self.measured:
            return self.curve.mean(3) / self.curve.mean(2)
        low, high = self.radius_range_m
        return (
            2 * (0.25 * (low + high) * (low**2 + high**2)) / ((low**2 + low * high + high**2) / 3)
        )
