"""Case: what the specimen is. Validated once, at birth.

A case holds no paths and no binary. `fdnet.case.file` reads one from TOML, `Case.toml()` writes it back with
every default. Its tables are in the modules next to this one, what must hold
between them in `fdnet.case.rules`.
"""

import hashlib
import json
import tomllib
from typing import Annotated, Any

import tomli_w
from pydantic import Field, model_validator

from fdnet.case.analysis import AnalysisChoices
from fdnet.case.control import Run
from fdnet.case.fluid import Fluid
from fdnet.case.particles import Fines, Grains
from fdnet.case.parts import Box, Drag, Gravity
from fdnet.case.rules import cross_problems
from fdnet.case.values import Part

POLICIES = ("max_hours", "max_overlap", "on_overlap")
"""Keys of [run] that say whether a run may go on, not what it computes."""


class Case(Part):
    """One specimen. Without `fines` the pack stays intact and no invasion is run."""

    name: Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")] = Field(
        description="Name of the case: letters, digits, dot, underscore and hyphen. It also names "
        "the run folder."
    )
    seed: Annotated[int, Field(ge=0, lt=2**31)] = Field(
        1, description="Seed of all random numbers. The same case and seed give the same result."
    )
    box: Box
    grains: Grains
    fines: Fines | None = None
    fluid: Fluid = Fluid()
    drag: Drag = Drag()
    gravity: Gravity = Gravity()
    run: Run = Run()
    analysis: AnalysisChoices = AnalysisChoices()

    @model_validator(mode="after")
    def _parts_fit(self) -> "Case":
        found = list(
            cross_problems({name: getattr(self, name) for name in type(self).model_fields})
        )
        if found:
            raise ValueError("; ".join(found))
        return self

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Side lengths of the box (x, y, z), m."""
        return self.box.size_m

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions are periodic; the flow direction never is."""
        return self.box.periodic

    def data(self) -> dict[str, Any]:
        """All keys with a value, defaults written out (TOML has no null: keys without a value are left out)."""
        return _without_none(self.model_dump(mode="json"))

    def toml(self) -> str:
        """The full resolved case as TOML."""
        return tomli_w.dumps(self.data())

    def digest(self, stage: str = "analyse") -> str:
        """Hash of what `stage` depends on: "pack" ignores fines, fluid and analysis, "invade" the analysis.

        No result depends on `POLICIES`, so no digest does.
        """
        data = self.data()
        data["run"] = {key: value for key, value in data["run"].items() if key not in POLICIES}
        if stage in ("pack", "invade"):
            data.pop("analysis")
            data.pop("name")
        if stage == "pack":
            data["grains"].pop("motion")
            fines = self.fines.normal_stiffness_N_m if self.fines else None
            scaling = {"stiffness": self.run.stiffness_N_m, "fines_stiffness": fines}
            data = {key: data[key] for key in ("seed", "box", "grains")} | scaling
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]

    def same_specimen(self, text: bytes) -> bool:
        """Whether a case.toml as `toml` wrote it is this case but for `POLICIES`."""
        try:
            return Case.model_validate(tomllib.loads(text.decode())).digest() == self.digest()
        except ValueError:
            return False


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return value
