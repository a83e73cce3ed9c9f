"""Comparisons of made-up runs."""

from pathlib import Path

from fdnet.campaign.result.comparison import Comparison
from fdnet.campaign.result.entry import Entry


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
