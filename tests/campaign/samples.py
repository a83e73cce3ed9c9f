"""Comparisons of made-up runs."""

import json
from pathlib import Path

from fdnet.campaign.result.comparison import Comparison
from fdnet.campaign.result.entry import Entry
from fdnet.case.case import Case
from fdnet.run.folder import OPTIONAL, OUTPUTS, digests_of, mark_folder


def comparison(path: Path, values: dict, *, shared: bool = True, more: dict | None = None):
    """Variants with a list of k_reduction by seed; `shared` gives runs of one seed one pack."""
    entries = [
        Entry(
            name=f"{name}-seed-{seed}",
            variant=name,
            seed=seed,
            keys={"fines.radius_mm": 0.01 * (number + 1)},
            folder=path / "runs" / f"{name}-seed-{seed}",
            pack=f"pack-{seed}" if shared else f"{name}-{seed}",
            numbers={"k_reduction": value, **{k: v[seed] for k, v in (more or {}).items()}},
        )
        for number, (name, column) in enumerate(values.items())
        for seed, value in enumerate(column)
    ]
    return Comparison(
        title="made up", path=path, keys=("fines.radius_mm",), entries=tuple(entries)
    )


def finished_run(folder: Path, case: Case, **numbers: object) -> None:
    """A run folder as fdnet leaves it, with made-up results: `numbers` of its summary."""
    for stage in ("pack", "invade"):
        (folder / stage).mkdir(parents=True)
        record = {
            "format": 1,
            "digest": case.digest(stage),
            **dict.fromkeys(
                ("seconds", "max_overlap", "dt_s", "porosity", "porosity_assumed"), 1.0
            ),
            **dict.fromkeys(("steps", "supplied"), 1),
            "stop_reason": "plugged",
            "ranks": 1,
            "files": {"post/gone.dump": "0" * 64},
            "runs": [{"version": "3.8.0", "seconds": 1.0}],
            "attempts": [{"liggghts_s": 1.0}],
            "left_out": [],
            "warnings": [],
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
    tables = [name for name in OUTPUTS["analyse"] if name not in OPTIONAL]
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
