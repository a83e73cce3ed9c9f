"""The kinds of value that a case file may hold, and their bounds."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

MAX_CONCENTRATION = 0.30
"""Random sequential addition of spheres saturates near 0.38 (Torquato, Uche & Stillinger 2006)."""

MOST_GRAINS, MOST_FINES, MOST_SLAB, MOST_BINS = 10_000_000, 10_000_000, 1000, 10_000
"""Upper bounds: grains, fines, slab over box length, profile bins."""

LEAST_SKIN, MOST_NEIGHBOUR_BINS = 0.01, 10_000_000
"""Smallest skin over the smallest fine's radius, most bins of the neighbour search in the box."""

CONTACT_STEP_LIMIT = 0.3
"""Largest time step over sqrt(m/k).

Dense packs without damping keep their energy at 0.4. It grows at 0.5, and at 0.4 in a dilute gas.
"""


def as_tuple(value: Any) -> Any:
    """A list of a case file as a tuple; anything else as it is."""
    return tuple(value) if isinstance(value, list) else value


Positive = Annotated[float, Field(ge=1e-18, le=1e15, allow_inf_nan=False)]
Fraction = Annotated[float, Field(gt=0, lt=1)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Pair = Annotated[tuple[Positive, Positive], BeforeValidator(as_tuple)]
Triple = Annotated[tuple[Positive, Positive, Positive], BeforeValidator(as_tuple)]
Vector = Annotated[tuple[Finite, Finite, Finite], BeforeValidator(as_tuple)]
Radius = Annotated[Positive | Pair, Field(union_mode="smart")]


def scaled(value: float | None, factor: float) -> float | None:
    """`value` times `factor`, which turns the unit of a key into SI; None stays None."""
    return None if value is None else value * factor


class Part(BaseModel):
    """A table of the case file: frozen, no unknown keys, no conversion of text to numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


def still_there(name: Any, removed: Mapping[str, str]) -> Any:
    """The name as given. Refuses one that is gone, with the one of `removed` to take instead."""
    if isinstance(name, str) and name in removed:
        text = "is no longer there; take '{instead}'"
        raise PydanticCustomError("removed", text, {"instead": removed[name]})
    return name
