"""The whole case, and what differs between two.

A case says what the specimen is. It is validated when it is made and never changes. It holds no
paths and no binary: `fdnet.case.file` reads one from TOML, `Case.toml()` writes it back with every
default. Its tables are in the modules next to this one, what must hold between them is in
`fdnet.case.rules`.
"""

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Self

import tomli_w
from pydantic import Field, model_validator

from fdnet.case.rules import cross_problems
from fdnet.case.spheres import Fines, Grains, Spheres
from fdnet.case.tables import (
    MODEL_KEYS,
    AnalysisChoices,
    Bonds,
    Box,
    CleanUp,
    ContactLaw,
    Drag,
    Fluid,
    Gravity,
    Part,
    Run,
    Well,
)
from fdnet.errors import CaseError
from fdnet.names import LIGGGHTS_STAGES, STAGES, Stage

POLICIES = ("max_hours", "max_overlap", "on_overlap")
"""Keys of [run] that decide whether a run may go on, not what it computes."""
KEYS = (
    "name",
    "seed",
    "box",
    "grains",
    "fines",
    "fluid",
    "well",
    "drag",
    "gravity",
    "contact",
    "clean_up",
    "bonds",
    "run",
    "analysis",
    "given",
)
"""Keys at the top of a case file, in the order in which they are written."""


class Case(Part):
    """A pack of grains. Without fines it stays intact: it is made and analysed, not invaded.

    The keys carry the unit of the user, as in a case file: `radius_mm`, `viscosity_cP`. Properties
    such as `size_m` give the same in SI.

    Make one with `fdnet.read_case` from a file, or with `fdnet.case_from` from nested tables: both
    take a table of fines, and both raise CaseError that lists every problem. This class itself has
    no key `fines` (see `InvasionCase`) and raises the error of pydantic.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml")
        >>> isinstance(case, fdnet.Case), case.grains.radius_mm
        (True, 0.25)
        >>> case.digest() == fdnet.read_case("cases/quick.toml").digest()
        True
    """

    name: Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
    """Name of the case: letters, digits, dot, underscore and hyphen. It also names the run folder.
    """
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 1
    """Seed of all random numbers. The same case and seed give the same result."""
    box: Box
    grains: Grains
    fluid: Fluid = Fluid()
    well: Well | None = None
    drag: Drag = Drag()
    gravity: Gravity = Gravity()
    contact: ContactLaw = ContactLaw()
    bonds: Bonds | None = None
    run: Run = Run()
    analysis: AnalysisChoices = AnalysisChoices()
    given: dict[str, str] = Field({})
    """Written by fdnet: what the case gave with units or as a file, by dotted key. The other keys
    hold the same as numbers, and only they count."""

    @model_validator(mode="after")
    def _tables_fit(self) -> Self:
        problems = list(cross_problems(dict(self)))
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def spheres(self) -> dict[str, Spheres]:
        """The kinds of sphere by the name of their material in a deck."""
        return {"grain": self.grains}

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages that a run of this case consists of."""
        return tuple(stage for stage in STAGES if stage not in ("invade", "clean_up"))

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Side lengths of the box (x, y, z), m."""
        return self.box.size_m

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which directions are periodic; the flow direction never is."""
        return self.box.periodic

    @property
    def wall_friction(self) -> float:
        """Friction of the side walls: the one given, or that of the grains."""
        given = self.box.wall_friction
        return self.grains.friction if given is None else given

    def data(self) -> dict[str, Any]:
        """All keys that have a value, defaults written out (TOML knows no null).

        Keys that only the other contact model reads are left out.
        """
        data = self.model_dump(mode="json")
        if not self.given:
            del data["given"]
        for name in ("grains", "fines"):
            for key in self.contact.other_keys & data.get(name, {}).keys():
                del data[name][key]
        return _without_none({key: data[key] for key in KEYS if key in data})

    def toml(self) -> str:
        """The case as TOML, with every default."""
        return tomli_w.dumps(self.data())

    def digest(self, stage: str = "analyse") -> str:
        """Hash of what `stage` depends on.

        "pack" ignores fines, fluid and analysis, unless the stiffness follows from them
        (`run.stiffness_N_m` = "auto"); "invade" ignores the analysis and the clean-up,
        "clean_up" the analysis, but for side walls that let a fluid slip which is made with them
        (`walls_of_the_fluid`). No result depends on `POLICIES` or on the bonds, which mechanics
        alone reads, so no digest does.
        """
        data = self.data()
        data.pop("given", None)
        data.pop("bonds", None)
        data["run"] = {key: value for key, value in data["run"].items() if key not in POLICIES}
        if stage in LIGGGHTS_STAGES:
            data |= walls_of_the_fluid(stage, data)
            data.pop("analysis")
            data.pop("name")
        if stage == "invade":
            data.pop("clean_up", None)
        if stage == "pack" and self.run.stiffness_N_m != "auto":
            data["grains"].pop("motion")
            fines = data.get("fines", {}).get("normal_stiffness_N_m")
            scaling = {"stiffness": self.run.stiffness_N_m, "fines_stiffness": fines}
            elastic = self._elastic_of_the_pack(data)
            data = {key: data[key] for key in ("seed", "box", "grains")} | scaling | elastic
        return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()[:16]

    def _elastic_of_the_pack(self, data: dict[str, Any]) -> dict[str, Any]:
        """What the stiffness of a pack depends on besides, with contacts that are not linear."""
        if self.contact.model == "hooke":
            return {}
        fines, keys = self.spheres.get("fine"), sorted(MODEL_KEYS["hertz"])
        size = {"mean_radius_m": fines.mean_radius_m} if fines else {}
        given = {key: data["fines"][key] for key in keys} if fines else {}
        return {"model": self.contact.model, "fines": size | given}

    def same_specimen(self, text: bytes) -> bool:
        """Whether a case.toml as `toml` wrote it is this case but for `POLICIES`."""
        try:
            data = tomllib.loads(text.decode())
            return case_type(data).model_validate(data).digest() == self.digest()
        except ValueError:
            return False


class InvasionCase(Case):
    """A pack of grains and the fines that invade it: a `Case` with the table `fines`.

    The keys of the fines carry the unit of the user too: `fines.radius_mm` is in mm. Make one with
    `fdnet.read_case` or `fdnet.case_from`.

    Examples:
        >>> import fdnet
        >>> case = fdnet.read_case("cases/quick.toml", assignments=["fines.radius_mm=0.05"])
        >>> isinstance(case, fdnet.InvasionCase), case.fines.radius_mm
        (True, 0.05)
    """

    fines: Fines
    clean_up: CleanUp | None = None

    @property
    def spheres(self) -> dict[str, Spheres]:
        """The kinds of sphere by the name of their material in a deck."""
        return {"grain": self.grains, "fine": self.fines}

    @property
    def stages(self) -> tuple[Stage, ...]:
        """The stages that a run of this case consists of."""
        return tuple(stage for stage in STAGES if stage != "clean_up" or self.clean_up)


def walls_of_the_fluid(stage: str, data: Mapping[str, Any]) -> dict[str, str]:
    """The key of the analysis that the fluid of `stage` depends on, if it does.

    The network of `drag.field` = "network" is made with `analysis.walls`.

    Args:
        stage: "pack", "invade" or "clean_up".
        data: the tables of a case.
    """
    network = stage != "pack" and data["drag"]["field"] == "network"
    named = network and data["box"]["sides"] == "walls"
    return {"walls": data["analysis"]["walls"]} if named else {}


def case_type(data: Mapping[str, Any]) -> type[Case]:
    """The class that nested tables describe: a table of fines makes an invasion."""
    return InvasionCase if "fines" in data else Case


def with_fines(case: Case) -> InvasionCase:
    """The same case, known to have fines. Raises CaseError when it has none."""
    if not isinstance(case, InvasionCase):
        raise CaseError(
            f"case {case.name}: has no table [fines], but an invasion needs one; add it"
        )
    return case


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list):
        return [_without_none(item) for item in value]
    return value


# ------------------------------------------------------------------------------------------------
# Which keys of two cases differ, in words.


MOST_NAMED = 4
"""Most differing keys that a message names."""


def differences(asked: Case, kept: Mapping[str, Any]) -> list[str]:
    """The dotted keys in which a case differs from the tables of another, with both values.

    Keys that decide only whether a run may go on are left out, and what was given in words.
    """
    mine, other = dict(_flat(asked.data())), dict(_flat(kept))
    return [
        f"{key} = {_shown(other, key)} there, {_shown(mine, key)} here"
        for key in sorted(mine.keys() | other.keys())
        if mine.get(key) != other.get(key)
        and not key.startswith("given.")
        and key not in [f"run.{policy}" for policy in POLICIES]
    ]


def difference_text(asked: Case, kept: Mapping[str, Any]) -> str:
    """`differences` as the part of a message; empty where nothing differs."""
    named = differences(asked, kept)
    if not named:
        return ""
    more = f", and {len(named) - MOST_NAMED} more keys" if len(named) > MOST_NAMED else ""
    return "; ".join(named[:MOST_NAMED]) + more


def _flat(tables: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def _shown(flat: Mapping[str, Any], key: str) -> str:
    return str(flat[key])[:40] if key in flat else "absent"
