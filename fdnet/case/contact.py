"""The table [contact] of a case file: the law of contacts, and what acts in them besides."""

from typing import Literal

from pydantic import Field

from fdnet.case.values import Part, Positive

MODEL_KEYS = {
    "hooke": frozenset({"normal_stiffness_N_m", "shear_stiffness_N_m"}),
    "hertz": frozenset({"youngs_modulus_GPa", "poissons_ratio"}),
}
"""Keys of [grains] and [fines] that only one contact model reads."""
DEEPEST_DAMPING = 0.69
"""Damping ratio up to which LIGGGHTS's Hertz model takes the restitution (above 0.05)."""


class ContactLaw(Part):
    """The law of all contacts; what is not asked for is left out of the deck."""

    model: Literal["hooke", "hertz"] = Field(
        "hooke",
        description='Contact law: "hooke", linear springs of `normal_stiffness_N_m` and '
        '`shear_stiffness_N_m`, or "hertz", Hertz-Mindlin contacts of `youngs_modulus_GPa` and '
        "`poissons_ratio`.",
    )

    restitution: Literal["dry", "liquid"] = Field(
        "dry",
        description='Rebound of fines: "dry" takes `damping_ratio` as it is, "liquid" lowers the '
        "restitution of every contact of a fine by exp(-35 / St), St being the impact Stokes "
        "number at the velocity of the fluid. Below a St of 10 nothing rebounds.",
    )
    rolling_friction: Positive | None = Field(
        None,
        description="Coefficient of rolling friction of all contacts with friction: the largest "
        "rolling torque over normal force and effective radius. When absent nothing resists "
        "rolling.",
    )
    cohesion_J_m3: Positive | None = Field(
        None,
        description="Cohesion of every contact of a fine: attraction over the area of contact "
        '(LIGGGHTS\'s SJKR). It needs contact.model = "hertz". When absent nothing attracts.',
    )

    @property
    def other_keys(self) -> frozenset[str]:
        """Keys of [grains] and [fines] that the other contact model reads."""
        return frozenset().union(*(MODEL_KEYS[name] for name in MODEL_KEYS if name != self.model))
