"""`fdnet ensemble`, `sweep`, `compare` and `design`: commands on many runs."""

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.commands.run import add_file_and_set, add_program, add_ranks, case_of, stages_of
from fdnet.errors import CaseError
from fdnet.files import path_option
from fdnet.names import STAGES

if TYPE_CHECKING:
    from fdnet.campaign.engine import HowToRun
    from fdnet.campaign.plan import Plan
    from fdnet.campaign.result import Comparison

SOME_FAILED = 5
"""Exit code when some of the runs have no result."""
MOST_SEEDS = 32


def _add_result(parser: argparse.ArgumentParser) -> None:
    """Adds --out, --rank-by, --json and --quiet to a parser."""
    parser.add_argument(
        "--out", type=path_option, required=True, metavar="DIR", help="folder of the results"
    )
    parser.add_argument(
        "--rank-by",
        default="k_reduction",
        metavar="QUANTITY",
        help="number of the summaries that orders the variants, smallest first (default "
        "k_reduction)",
    )
    parser.add_argument("--json", action="store_true", help="print summary.json")
    parser.add_argument("--quiet", action="store_true", help="no progress")


def _add_engine(parser: argparse.ArgumentParser) -> None:
    """Adds the options of the result, and what decides where and how the runs are carried out."""
    _add_result(parser)
    add_ranks(parser)
    add_program(parser)
    parser.add_argument(
        "--stages",
        default=",".join(STAGES),
        help="comma-separated (default: all; without report a run draws nothing)",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="runs at the same time (default: cores over ranks; 100 on a cluster)",
    )
    parser.add_argument(
        "--engine",
        choices=("auto", "local", "snakemake"),
        default="auto",
        help="what starts the runs: Snakemake if it is installed, or processes of fdnet (local)",
    )
    parser.add_argument(
        "--slurm",
        nargs="?",
        const="",
        metavar="RESOURCES",
        help="submit the runs to Slurm through Snakemake, with its default resources, e.g. "
        "slurm_partition=short,runtime=60",
    )
    parser.add_argument(
        "--until",
        metavar="GOAL",
        help="add seeds until the 95 %% band is as narrow, e.g. 'k_reduction ± 5 %%' or "
        "'k_damaged_m2 +- 10 %%'",
    )
    parser.add_argument(
        "--max-seeds",
        type=int,
        default=MOST_SEEDS,
        metavar="N",
        help=f"most seeds that --until may spend (default {MOST_SEEDS})",
    )
    parser.add_argument(
        "--jobs-limit",
        type=int,
        default=1000,
        metavar="N",
        help="most runs of a plan that are accepted (default 1000)",
    )
    parser.add_argument(
        "--gather", action="store_true", help="run nothing; gather the runs that are there"
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

    made = page.write_comparison(comparison, limits)
    if options.json:
        print(json.dumps(made.summary, indent=1))
    else:
        print(made, f"page: {made.path / 'compare.html'}", sep="\n")
    for line in page.failure_lines(comparison):
        print(f"fdnet: {line}", file=sys.stderr)
    return SOME_FAILED if comparison.failed else 0


def _run_campaign(
    options: argparse.Namespace, plan: "Plan", limits: Mapping[str, float] | None = None
) -> int:
    """Carry out a plan and write its results; returns the exit code."""
    from fdnet.campaign.api import carry_out

    comparison = carry_out(
        Path(options.out),
        plan,
        _how_of(options),
        options.until,
        options.rank_by,
        most_seeds=options.max_seeds,
        run=not options.gather,
    )
    return _finish(options, comparison, limits)


# ------------------------------------------------------------------------------------------------
# The commands.


def add_ensemble(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds `fdnet ensemble`: one case with several seeds, and the band of every number."""
    parser = commands.add_parser(
        "ensemble", parents=[common], help="one case with several seeds, with 95 %% bands"
    )
    add_file_and_set(parser)
    parser.add_argument(
        "--seeds",
        type=int,
        default=4,
        metavar="N",
        help="number of seeds, from that of the case on (default 4)",
    )
    _add_engine(parser)
    parser.set_defaults(action=_run_ensemble)


def _run_ensemble(options: argparse.Namespace) -> int:
    from fdnet.campaign.plan import ensemble_plan

    plan = ensemble_plan(case_of(options), options.seeds, **_plan_options(options))
    return _run_campaign(options, plan)


def add_sweep(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds `fdnet sweep`: every combination of keys, variants, cases and seeds of a file."""
    parser = commands.add_parser(
        "sweep", parents=[common], help="many cases and seeds, compared with 95 %% bands"
    )
    parser.add_argument("sweep", type=path_option, metavar="SWEEP.toml", help="the sweep file")
    _add_engine(parser)
    parser.set_defaults(action=_run_sweep)


def _run_sweep(options: argparse.Namespace) -> int:
    from fdnet.campaign.plan import sweep_plan

    return _run_campaign(options, sweep_plan(options.sweep, **_plan_options(options)))


def add_compare(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds `fdnet compare`: finished runs, grouped by what differs in their cases."""
    parser = commands.add_parser(
        "compare", parents=[common], help="compare finished runs, with 95 %% bands over seeds"
    )
    parser.add_argument(
        "runs",
        nargs="+",
        type=path_option,
        metavar="RUN",
        help="run folders; the folder of an ensemble or a sweep stands for all its runs, and its "
        "own results are written anew where it is --out too",
    )
    _add_result(parser)
    parser.set_defaults(action=_run_compare)


def _run_compare(options: argparse.Namespace) -> int:
    from fdnet.campaign.api import gathered

    return _finish(options, gathered(options.runs, options.out, options.rank_by))


def add_design(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds `fdnet design`: candidate muds for a sand, ranked by targets with their reasons."""
    parser = commands.add_parser(
        "design", parents=[common], help="rank candidate muds for a sand by targets"
    )
    parser.add_argument(
        "sweep",
        type=path_option,
        metavar="DESIGN.toml",
        help="a sweep file with the table [targets]",
    )
    _add_engine(parser)
    parser.set_defaults(action=_run_design)


def _run_design(options: argparse.Namespace) -> int:
    from fdnet.campaign.plan import sweep_plan
    from fdnet.campaign.result import read_targets

    plan = sweep_plan(options.sweep, **_plan_options(options))
    return _run_campaign(options, plan, read_targets(plan.targets))
