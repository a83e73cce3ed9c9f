"""`fdnet ensemble`, `sweep` and `compare`: commands on many runs."""

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.commands.options import OUTPUT, THE_CASE, case_of, new_command, stages_of
from fdnet.errors import CaseError
from fdnet.files import path_option

if TYPE_CHECKING:
    from fdnet.campaign.engine import HowToRun
    from fdnet.campaign.plan import Plan
    from fdnet.campaign.result import Comparison

SOME_FAILED = 5  # Exit code when some of the runs have no result


_ENGINE = (
    *("--out", "--stages", "--rank-by", "--json", "--quiet"),
    *("--np", "--liggghts", "--launcher", "--timeout"),
    *("--jobs", "--jobs-limit", "--engine", "--slurm", "--gather"),
)
_DRY = (
    "--dry-run",
    "write nothing; print the time of the runs, what they leave out, what would start them",
)


def _how_of(options: argparse.Namespace) -> "HowToRun":
    """How to run the jobs. Raises CaseError on options that do not fit together."""
    from fdnet.campaign.engine import HowToRun, has_snakemake
    from fdnet.run.records import cores

    if options.jobs is not None and options.jobs < 1:
        raise CaseError(f"--jobs {options.jobs}: expected 1 or more")
    cluster, engine = options.slurm is not None, options.engine
    if cluster and engine == "local":
        raise CaseError("--slurm: needs Snakemake; leave --engine local out")
    if engine == "auto":
        engine = "snakemake" if has_snakemake() else "local"
    return HowToRun(
        jobs=options.jobs or (100 if cluster else max(1, cores() // options.np)),
        liggghts=options.liggghts,
        launcher=options.launcher,
        timeout=options.timeout,
        engine="slurm" if cluster else engine,
        resources=tuple(part for part in (options.slurm or "").split(",") if part),
        quiet=options.quiet,
    )


def _plan_options(options: argparse.Namespace) -> dict[str, Any]:
    """Limit, ranks and stages of a plan."""
    stages = stages_of(options.stages)
    if "analyse" not in stages:
        raise CaseError(
            f"--stages {options.stages}: without analyse there is no number to compare; add it"
        )
    return {"limit": options.jobs_limit, "ranks": options.np, "stages": stages}


def _finish(
    options: argparse.Namespace,
    comparison: "Comparison",
    limits: Mapping[str, float] | None = None,
) -> int:
    """Write tables and page, print the ranking; returns the exit code.

    With `limits` of targets, the variants are ranked by them first.
    """
    from fdnet.campaign import page

    made = page.write_comparison(comparison, limits or {})
    if options.json:
        print(json.dumps(made.summary, indent=1))
    else:
        print(made, f"page: {made.path / 'compare.html'}", sep="\n")
    for line in page.failure_lines(comparison):
        print(f"fdnet: {line}", file=sys.stderr)
    return SOME_FAILED if comparison.failed else 0


def _run_campaign(options: argparse.Namespace, plan: "Plan") -> int:
    """Carry out a plan and write its results; returns the exit code."""
    from fdnet.campaign.api import carry_out
    from fdnet.campaign.plan import plan_lines
    from fdnet.campaign.result import read_targets

    how, limits = _how_of(options), read_targets(plan.targets)
    if options.dry_run:
        how.refuse()
        by = "fdnet itself" if how.engine == "local" else "Snakemake"
        by = f"Slurm with {', '.join(how.resources)}" if how.engine == "slurm" else by
        way = f"would run in {options.out}: {how.jobs} at a time, by {by}"
        print(*plan_lines(plan), way, sep="\n")
        return 0
    comparison = carry_out(Path(options.out), plan, how, options.rank_by, run=not options.gather)
    return _finish(options, comparison, limits)


# ---- The commands.
def add_campaign_commands(commands: Any) -> None:
    """Adds `fdnet ensemble`, `sweep` and `compare` to the command line."""
    about = "run one case with several seeds, and give every number with its 95 % band"
    example = "fdnet ensemble mine.toml --seeds 8 --out runs/mine-8"
    parser = new_command(commands, "ensemble", _run_ensemble, about, example)
    parser.share("case", "--seed", "--set")
    number = "number of seeds, from that of the case on (default 4)"
    parser.add(THE_CASE, "--seeds N", number, int, 4)
    parser.share("--fast", *_ENGINE)
    parser.add(OUTPUT, *_DRY)

    about = "run and compare the cases and seeds of a file, and rank them by its targets"
    example = "fdnet sweep cases/sweeps/bridging.toml --out runs/bridging"
    parser = new_command(commands, "sweep", _run_sweep, about, example)
    file = "the sweep file; with [targets] the variants are ranked by whether they meet them"
    parser.add(THE_CASE, "sweep SWEEP.toml", file, path_option)
    parser.share("--fast", *_ENGINE)
    parser.add(OUTPUT, *_DRY)

    about = "compare finished runs, with 95 % bands over seeds"
    example = "fdnet compare runs/thin runs/thick --out runs/compared"
    parser = new_command(commands, "compare", _run_compare, about, example)
    folders = "run folders; the folder of an ensemble or a sweep stands for all its runs"
    parser.add(THE_CASE, "runs RUN", folders, path_option, nargs="+")
    parser.share("--out", "--rank-by", "--json")


def _run_ensemble(options: argparse.Namespace) -> int:
    from fdnet.campaign.plan import ensemble_plan

    plan = ensemble_plan(case_of(options), options.seeds, **_plan_options(options))
    return _run_campaign(options, plan)


def _run_sweep(options: argparse.Namespace) -> int:
    from fdnet.campaign.plan import sweep_plan

    return _run_campaign(
        options, sweep_plan(options.sweep, fast=options.fast, **_plan_options(options))
    )


def _run_compare(options: argparse.Namespace) -> int:
    from fdnet.campaign.api import gathered

    return _finish(options, gathered(options.runs, options.out, options.rank_by))
