"""The materials of a mud: the list `fines.materials`, such as CaCO3, barite and drilled solids."""

from collections.abc import Sequence
from dataclasses import dataclass

from pydantic import Field

from fdnet.case.sizes import Sizes
from fdnet.case.values import NonNegative, Part, Positive
from fdnet.sizes.curve import SizeCurve


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """One material of some spheres.

    Attributes:
        name: as the case gives it; empty where there is one material.
        share: of the volume of all solids of the case.
        curve: diameters, m.
        density: kg/m3.
    """

    name: str
    share: float
    curve: SizeCurve
    density: float


class Material(Part):
    """One kind of solids in the mud."""

    name: str = Field(min_length=1, max_length=60, description="Name of the material.")
    share: Positive = Field(
        description="Its share of the solids by mass; the shares are relative to their sum."
    )
    sizes: Sizes = Field(description="Its curve of diameters, as `fines.sizes`.")
    density_kg_m3: Positive | None = Field(
        None, description="Density of the material. When absent: `fines.density_kg_m3`."
    )
    friction: NonNegative | None = Field(
        None,
        description="Coefficient of sliding friction; for now it must be that of all fines, "
        "`fines.friction`, which is also the default.",
    )


def components_of(
    materials: Sequence[Material], *, density: float, finest: float
) -> tuple[Solid, ...]:
    """The materials with their shares by volume of all solids.

    `density` kg/m3 is for those without one; nothing finer than `finest` m is kept.
    """
    volumes = [one.share / (one.density_kg_m3 or density) for one in materials]
    return tuple(
        Solid(
            name=one.name,
            share=volume / sum(volumes),
            curve=one.sizes.curve(finest),
            density=one.density_kg_m3 or density,
        )
        for one, volume in zip(materials, volumes, strict=True)
    )


def mixed_density(materials: Sequence[Material], density: float) -> float:
    """Mass over volume, kg/m3, of materials by their shares of mass; see `components_of`."""
    mass = sum(one.share for one in materials)
    return mass / sum(one.share / (one.density_kg_m3 or density) for one in materials)
