"""`fdnet compare`: finished runs against each other, grouped by what differs in their cases."""

import argparse
from typing import Any

from fdnet.commands.campaign_options import add_result, finish
from fdnet.files.paths import path_option


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    parser = commands.add_parser(
        "compare", parents=[common], help="compare finished runs, with 95 %% bands over seeds"
    )
    parser.add_argument(
        "runs",
        nargs="+",
        type=path_option,
        metavar="RUN",
        help="run folders; the folder of an ensemble or a sweep stands for all its runs",
    )
    add_result(parser)
    parser.set_defaults(action=_run)


def _run(options: argparse.Namespace) -> int:
    from fdnet.campaign.result.comparison import refuse_unknown
    from fdnet.campaign.result.gather import gather_runs, result_folder

    comparison = gather_runs(options.runs, options.out, ranked_by=options.rank_by)
    refuse_unknown(comparison, options.rank_by, "--rank-by")
    with result_folder(options.out):
        return finish(options, comparison)
