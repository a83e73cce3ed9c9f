"""The runs of the thesis's specimens: their plan, how they are made, and the states kept."""

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

import fdnet
from fdnet.case.case import InvasionCase, with_fines, without_old_keys
from fdnet.case.file import case_from, case_path, read_case, set_keys
from fdnet.dem.liggghts import find_binary
from fdnet.errors import CaseError
from fdnet.files import replacing, write_text
from fdnet.spheres.snapshot import Array, Kind, Snapshot
from validation.thesis.published import rows_in


# ---- The plan.
@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """One run: a shipped case with a seed and perhaps a changed setting, from plan.csv.

    The group is "specimen", "variant", "quick", "reason" (what might let more fines in), or what
    is scanned ("friction", "drag", "supply", with its value). The setting is "key=value"; the
    consequence is one that follows and is not named.
    """

    group: str
    name: str
    seed: int = 1
    setting: str = ""
    value: str = ""
    consequence: str = ""

    @property
    def id(self) -> str:
        """Name of the run, the same for all seeds."""
        return f"{self.name} {self.setting}".strip()

    @property
    def file(self) -> str:
        """Name of the file of its state."""
        return f"{self.id.replace(' ', '_')}-seed{self.seed}.npz"

    @property
    def settings(self) -> list[str]:
        """Everything that is changed, as "key=value"."""
        return [one for one in (self.setting, self.consequence) if one]

    def load(self) -> InvasionCase:
        """Its case."""
        seed = f"seed={self.seed}"
        return with_fines(read_case(case_path(self.name), assignments=[seed, *self.settings]))


def points() -> list[Planned]:
    """All rows of plan.csv, one a seed; a scan also has the case itself, at its own value."""
    rows = [row._asdict() for row in rows_in("plan.csv")]
    return [Planned(seed=int(one), **row) for row in rows for one in row.pop("seeds").split()]


def planned(*, quick: bool = False) -> list[Planned]:
    """All runs, each once, or with `quick` one run of each quick form."""
    if quick:
        return [one for one in points() if one.group == "quick" and one.seed == 1]
    runs = dict[tuple[str, int], Planned]()
    for one in points():
        runs.setdefault((one.id, one.seed), one)
    return [*runs.values()]


# ---- The runs.
def make_runs(plan: Sequence[Planned], states: Path, runs: Path, *, jobs: int) -> list[str]:
    """Make the runs that have no state in `states`; returns what failed, one sentence each.

    Cases with the same setting and seeds are one sweep in a folder of `runs`, which goes on where
    it was cut. Two runs with the same invasion (Table 3 and specimen 7) are made once.
    """
    find_binary()
    for folder in (states, runs):
        folder.mkdir(parents=True, exist_ok=True)
    sweeps: dict[tuple[Any, ...], dict[str, Planned]] = {}
    invasions = set()
    for item in plan:
        invasion = item.load().digest("invade")
        if find_state(states, item) is None and invasion not in invasions:
            seeds = tuple(one.seed for one in plan if one.id == item.id)
            same = sweeps.setdefault((item.group, seeds, *item.settings), {})
            same[item.load().digest()] = item
        invasions.add(invasion)
    failed = []
    for (group, seeds, *settings), items in sweeps.items():
        name = re.sub(r"[^\w.-]|_", "-", "-".join([group, *map(str, seeds), *settings]))
        cases = [str(case_path(one)) for one in dict.fromkeys(i.name for i in items.values())]
        keys = set_keys({}, settings)
        sweep = {"name": name, "cases": cases, "seeds": [*seeds], "set": keys}
        file = write_text(runs / f"{name}.toml", tomli_w.dumps(sweep))
        stages = ("pack", "invade", "analyse")
        fdnet.sweep(file, out=runs / name, jobs=jobs, stages=stages, progress=True)
        for folder in (runs / name / "runs").iterdir():
            try:
                state = state_of_run(folder)
            except CaseError as error:
                failed.append(str(error))
                continue
            if state.case.digest() in items:
                write_state(states / items[state.case.digest()].file, state)
    return failed


# ---- The states.
@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A specimen before and after its invasion, with the fines upstream, and how that ended."""

    case: InvasionCase
    grains: Snapshot
    damaged: Snapshot
    ending: Mapping[str, Any]


def state_of_run(folder: Path) -> State:
    """The end of a finished run. Raises CaseError when it is not finished, or was changed."""
    run = fdnet.open_run(folder)
    summary, invasion = run.summary, run.manifest["invade"]
    names = ("stop_reason", "seconds", "steps", "dt_s", "max_overlap", "supplied")
    ending = {name: invasion[name] for name in names} | {"passed": summary["passed_count"]}
    ending["pack_seconds"] = run.manifest["pack"]["seconds"]
    both = run.spheres("initial"), run.spheres("damaged")
    return State(with_fines(run.case), *both, ending)


def write_state(path: Path, state: State) -> None:
    """Keep a state in one compressed file of single precision (0.5 nm at 8 mm)."""
    text = json.dumps({"case": state.case.toml(), "ending": dict(state.ending)}).encode()
    arrays = {"text": np.frombuffer(text, np.uint8)}
    for name, spheres in (("grains", state.grains), ("damaged", state.damaged)):
        place = np.column_stack([spheres.position, spheres.radius])
        arrays[f"{name}_place"] = place.astype(np.float32)
        arrays[f"{name}_kind"] = spheres.kind.astype(np.uint8)
        arrays[f"{name}_id"] = spheres.id.astype(np.uint32)
    with replacing(path) as part:
        np.savez_compressed(part, allow_pickle=False, **arrays)


def read_state(path: Path) -> State:
    """A state that `write_state` kept."""
    with np.load(path) as file:
        arrays = dict(file)
    text = json.loads(arrays["text"].tobytes())
    case = with_fines(case_from(without_old_keys(tomllib.loads(text["case"])), source=str(path)))
    grains, damaged = (_spheres(arrays, name, case) for name in ("grains", "damaged"))
    return State(case, grains, damaged, text["ending"])


def find_state(states: Path, item: Planned) -> State | None:
    """The kept state of a run, with the analysis options of its case today; None without one.

    Table 3 has that of specimen 7, the same invasion. Raises CaseError for one of another case.
    """
    case = item.load()
    twin = replace(item, name=item.name.replace("table3", "specimen7"))
    for path in filter(Path.exists, (states / item.file, states / twin.file)):
        state = read_state(path)
        if state.case.digest("invade") == case.digest("invade"):
            return replace(state, case=case)
        if path.name == item.file:
            what = f"is the state of another case than {item.id}"
            raise CaseError(f"{path}: {what}; remove it to run the case anew")
    return None


def _spheres(arrays: Mapping[str, Array], name: str, case: InvasionCase) -> Snapshot:
    place, kind = arrays[f"{name}_place"].astype(float), arrays[f"{name}_kind"]
    kind, radius = np.where(kind == Kind.GRAIN, Kind.GRAIN, Kind.FINE), place[:, 3]
    for spheres, which in ((case.grains, Kind.GRAIN), (case.fines, Kind.FINE)):
        if spheres.one_size:  # in full precision
            radius = np.where(kind == which, spheres.mean_radius_m, radius)
    box = [(0.0, side) for side in case.size_m]
    made = Snapshot.from_arrays(place[:, :3], radius, box=box, kind=kind)
    return replace(made, id=arrays[f"{name}_id"])
