"""Run folders with made-up results, and what fdnet says of them."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from builders import tiny

import fdnet
from fdnet import Case
from fdnet.run.folder import TABLES, digests_of, mark_folder


def compared(
    path: Path, values: Mapping[str, Sequence[object]], quantity="k_reduction", *, shared=True
):
    """What `values` by variant give, one of each seed from 1; `shared`: one pack a seed."""
    folders = []
    for number, (name, column) in enumerate(values.items()):
        key = "fines.count" if shared else "grains.count"
        for seed, value in enumerate(column, start=1):
            folder = path / "made" / f"{name}-{seed}"
            case = tiny(f"name={name}", f"{key}={60 + number}", f"seed={seed}")
            finished_run(folder, case, **{quantity: value})
            folders.append(folder)
    return fdnet.compare_runs(folders, out=path / "compared", ranked_by=quantity)


def finished_run(folder: Path, case: Case, **numbers: object) -> None:
    """A run folder as fdnet leaves it, with made-up results: `numbers` of its summary."""
    for stage in ("pack", "invade"):
        (folder / stage).mkdir(parents=True)
        ones = ("seconds", "max_overlap", "dt_s", "porosity", "porosity_assumed")
        record = {
            **{"format": 1, "digest": case.digest(stage), "stop_reason": "plugged", "ranks": 1},
            **dict.fromkeys(ones, 1.0),
            **dict.fromkeys(("steps", "supplied"), 1),
            "files": {"post/gone.dump": "0" * 64},
            "runs": [{"version": "3.8.0", "seconds": 1.0}],
            "attempts": [{"liggghts_s": 1.0}],
            **{"left_out": [], "warnings": []},
        }
        (folder / stage / "stage.json").write_text(json.dumps(record))
    numbers = {
        **{"case": case.name, "seed": case.seed, "law": "x", "damage_law": "x"},
        **dict.fromkeys(("porosity_initial", "porosity_damaged"), 0.4),
        **dict.fromkeys(("k_initial_m2", "k_damaged_m2"), 1e-10),
        **dict.fromkeys(("invasion_depth_m", "invasion_depth_p95_m", "cake_thickness_m"), 1e-3),
        **dict.fromkeys(("supplied_count", "invaded_count", "passed_count", "upstream_count"), 9),
        **dict.fromkeys(("pores", "throats", "throats_blocked"), 9),
        **{"k_reduction": 0.5, "stop_reason": "plugged", "sections": [], "warnings": []},
        **numbers,
    }
    tables = [name for name in TABLES if name not in ("layers.csv", "history.csv")]
    for name in tables:
        (folder / name).write_text("x_m\n1.0\n")
    (folder / "summary.json").write_text(json.dumps(numbers))
    (folder / "case.toml").write_text(case.toml())
    manifest = {
        "format": 1,
        "case": case.name,
        "stages": list(case.stages),
        "digests": {"analyse": case.digest()},
        "files": digests_of(folder, tables),
        "invade": record,
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))
    mark_folder(folder)
