"""`fdnet sweep`: every combination of keys, variants, cases and seeds of a sweep file."""

import argparse
from typing import Any

from fdnet.commands.campaign_options import add_engine, add_result, plan_options, run_campaign
from fdnet.files.paths import path_option


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    parser = commands.add_parser(
        "sweep", parents=[common], help="many cases and seeds, compared with 95 %% bands"
    )
    parser.add_argument("sweep", type=path_option, metavar="SWEEP.toml", help="the sweep file")
    add_result(parser)
    add_engine(parser)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    from fdnet.campaign.plan.sweep import plan_of, read_sweep

    plan = plan_of(read_sweep(options.sweep), **plan_options(options))
    return run_campaign(options, plan)
