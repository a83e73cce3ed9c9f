"""`fdnet ensemble`: one case with several seeds, and the band of every number."""

import argparse
from typing import Any

from fdnet.commands.campaign_options import add_engine, add_result, plan_options, run_campaign
from fdnet.commands.case_options import add_file_and_set, case_of


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
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
    add_result(parser)
    add_engine(parser)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    from fdnet.campaign.plan.ensemble import ensemble_plan

    plan = ensemble_plan(case_of(options), options.seeds, **plan_options(options))
    return run_campaign(options, plan)
