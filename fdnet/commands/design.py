"""`fdnet design`: candidate muds for a sand, ranked by targets with their reasons."""

import argparse
from typing import TYPE_CHECKING, Any

from fdnet.commands.campaign_options import add_engine, add_result, plan_options, run_campaign
from fdnet.files.paths import path_option

if TYPE_CHECKING:
    from fdnet.campaign.result.comparison import Comparison


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    parser = commands.add_parser(
        "design", parents=[common], help="rank candidate muds for a sand by targets"
    )
    parser.add_argument(
        "sweep",
        type=path_option,
        metavar="DESIGN.toml",
        help="a sweep file with the table [targets]",
    )
    add_result(parser)
    add_engine(parser)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    from fdnet.campaign.plan.sweep import plan_of, read_sweep
    from fdnet.campaign.result.targets import candidate_lines, candidates, read_targets

    sweep = read_sweep(options.sweep)
    limits = read_targets(sweep.targets)

    def judged(comparison: "Comparison") -> dict[str, Any]:
        muds = candidates(comparison, limits)
        return {
            "ranked": candidate_lines(muds),
            "design": [{"name": mud.name, "state": mud.state} for mud in muds],
            "targets": limits,
        }

    return run_campaign(options, plan_of(sweep, **plan_options(options)), judged)
