"""`fdnet render`: write the decks without LIGGGHTS and print the scales."""

import argparse
from typing import Any

from fdnet.commands.case_options import add_case, case_of
from fdnet.commands.check import looked_at
from fdnet.errors import CaseError
from fdnet.files.paths import path_option


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    render = commands.add_parser(
        "render", parents=[common], help="write the decks without LIGGGHTS and print the scales"
    )
    add_case(render)
    render.add_argument("--out", type=path_option, required=True, help="folder for the decks")
    render.set_defaults(action=_render)


def _render(options: argparse.Namespace) -> int:
    from fdnet.dem.render import render_decks
    from fdnet.run.mark import is_run_folder
    from fdnet.scales.scales import scales_of
    from fdnet.scales.table import scale_rows

    case = case_of(options)
    scales = scales_of(case)
    if is_run_folder(options.out):
        raise CaseError(
            f"{options.out}: is a run folder; give another --out (nothing was changed)"
        )
    decks = render_decks(case, options.out, ranks=options.np)
    for row in scale_rows(case, scales):
        print(
            f"{row.name:<36} {row.symbol:<11} {row.value:>12.4g} {row.unit:<5} "
            f"{row.formula:<40} {row.source}"
        )
    print("\n".join(looked_at(case, scales).lines()))
    for deck in decks:
        print(f"deck: {deck}")
    return 0
