"""One mud with its cut moved: all spheres, spheres above the median, none.

Writes cuts.csv: a row for each seed and cut, with what is left of the permeability of the
specimen and of its halves. `--aside` takes the mud and sand that were put aside until the law
stood. Runs that are there are not repeated.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from fdnet.case.file import read_case
from fdnet.files import path_option
from fdnet.run.pipeline import run_case

CASE = Path(__file__).resolve().parents[2] / "cases" / "quick.toml"
KNOWN = (
    *('box.size=["2.5 mm","1.5 mm","1.5 mm"]', "grains.count=55", "analysis.sections=2"),
    'fines.sizes={D10="75 um",D50="105 um",D90="145 um"}',
)
ASIDE = (
    *('box.size=["2.3 mm","1.4 mm","1.4 mm"]', "grains.count=58", "analysis.sections=2"),
    'grains.sizes={D10="0.40 mm",D50="0.45 mm",D90="0.51 mm"}',
    *('fines.sizes={D10="60 um",D50="90 um",D90="130 um"}', 'fines.concentration="8 %"'),
)
CUTS = {
    "all spheres": (),
    "half": ('invasion={method="both"}',),
    "no spheres": ('invasion={method="network"}',),
}


def row_of(seed: int, name: str, out: Path, *, aside: bool) -> dict[str, object]:
    """What one run gives, from its folder below `out`."""
    keys = [f"seed={seed}", *(ASIDE if aside else KNOWN), *CUTS[name]]
    keys += [f'fines.cut="{90 if aside else 105} um"'] if name == "half" else []
    folder = out / f"{name.replace(' ', '-')}-{seed}"
    case, there = read_case(CASE, assignments=keys), folder.exists()
    run = run_case(case, folder, resume=there, stages=("pack", "invade", "analyse"))
    summary, sections = run.summary, run.sections
    left = sections["k_damaged_m2"] / sections["k_initial_m2"]
    return {
        "cut": name,
        "seed": seed,
        "k_over_k0": summary["k_damaged_m2"] / summary["k_initial_m2"],
        "first_half_k_over_k0": left.iloc[0],
        "second_half_k_over_k0": left.iloc[1],
        "depth_p95_mm": 1e3 * summary["invasion_depth_p95_m"],
        "invaded_mm3": 1e9 * summary["invaded_volume_m3"],
        "filtrate_mm3": 1e9 * summary["filtrate_m3"],
        "stop_reason": summary["stop_reason"],
        "cpu_s": sum(summary["cpu_seconds"].values()),
    }


def main(arguments: Sequence[str]) -> int:
    """Run all, seed after seed, and write what is there so far after each."""
    parser = argparse.ArgumentParser(prog="validation.py both", description=__doc__)
    parser.add_argument("--out", type=path_option, default=Path("studies/both"))
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--aside", action="store_true")
    options = parser.parse_args(list(arguments))
    rows = []
    for seed in range(1, options.seeds + 1):
        rows += [row_of(seed, name, options.out, aside=options.aside) for name in CUTS]
        pd.DataFrame(rows).to_csv(options.out / "cuts.csv", index=False, float_format="%.4g")
    return 0
