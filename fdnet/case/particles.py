"""The tables [grains] and [fines] of a case file: material and number of the spheres."""

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from fdnet.case.materials import Material, Solid, components_of, mixed_density
from fdnet.case.spheres import Spheres
from fdnet.case.values import MAX_CONCENTRATION, Fraction, Positive, as_tuple, scaled

Materials = Annotated[
    tuple[Material, ...], BeforeValidator(as_tuple), Field(min_length=1, max_length=20)
]


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
    materials: Materials | None = Field(
        None,
        description="Several materials, each a table with its own sizes, instead of `radius_mm` "
        "or `sizes`; their keys are below.",
    )
    cut_um: Positive | None = Field(
        None,
        description="Diameter below which solids of measured sizes are left out. Their share is "
        "said in the warnings of the summary, and the suspension is thinner by it.",
    )
    concentration: Annotated[float, Field(gt=0, le=MAX_CONCENTRATION)] | None = Field(
        0.10,
        description="Volume of solids over the volume of suspension in the slab upstream. It has "
        "no default where `solids_kg_m3` is given.",
    )
    solids_kg_m3: Positive | None = Field(
        None, description="Mass of solids in a volume of mud, instead of `concentration`."
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
        "batches",
        description='How the fines enter: "batches" puts each part of the slab in when it is '
        'about to arrive, "slab" puts all of them in at the start. The suspension is the same; '
        "batches are much faster for a long slab.",
    )

    @property
    def slab_m(self) -> float | None:
        """Length of the slab of suspension, m; None: it follows from the count."""
        return scaled(self.slab_mm, 1e-3)

    @model_validator(mode="before")
    @classmethod
    def _one_concentration(cls, data: Any) -> Any:
        """The default of `concentration` gives way to `solids_kg_m3`."""
        by_mass = isinstance(data, Mapping) and data.get("solids_kg_m3") is not None
        return {"concentration": None, **data} if by_mass else data

    @model_validator(mode="after")
    def _something_is_left(self) -> Self:
        sizes = [self.sizes] if self.sizes is not None else []
        for one in [*sizes, *(material.sizes for material in self.materials or ())]:
            largest = one.curve().high
            if self.finest_m >= largest:
                problem = (
                    f"cut_um {self.cut_um:g} leaves nothing of a curve that ends at "
                    f"{1e6 * largest:.3g} um; lower it"
                )
                raise PydanticCustomError("size_curve", "{problem}", {"problem": problem})
        return self

    @property
    def _size_keys(self) -> tuple[Any, ...]:
        return self.radius_mm, self.sizes, self.materials

    @property
    def finest_m(self) -> float:
        """Diameter, m, below which sizes are left out."""
        return (self.cut_um or 0.0) * 1e-6

    @cached_property
    def components(self) -> tuple[Solid, ...]:
        """The materials that the fines are of, with their shares by volume of what is kept."""
        if self.materials is None:
            return super().components
        return components_of(self.materials, density=self.density_kg_m3, finest=self.finest_m)

    @property
    def solids_density_kg_m3(self) -> float:
        """Mass over volume of all solids of the mud, those that are left out as well."""
        if self.materials is None:
            return self.density_kg_m3
        return mixed_density(self.materials, self.density_kg_m3)

    @property
    def has_one_concentration(self) -> bool:
        """Whether the solids of the mud are given, and once only."""
        return (self.solids_kg_m3 is None) != (self.concentration is None)

    @property
    def volume_fraction(self) -> float:
        """Volume of all solids over that of the suspension."""
        if self.solids_kg_m3 is not None:
            return self.solids_kg_m3 / self.solids_density_kg_m3
        return self.concentration or 0.0

    @property
    def placed_fraction(self) -> float:
        """Volume of the fines over that of the suspension: the solids without what is left out."""
        return self.volume_fraction * self.curve.kept if self.measured else self.volume_fraction
