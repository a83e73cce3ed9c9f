"""`fdnet movie` and `fdnet stokes`: commands on a finished run."""

import argparse
import json
import sys
from collections.abc import Mapping
from typing import Any

from fdnet.commands.options import OUTPUT, THE_FLOW, THE_PICTURE, new_command
from fdnet.files import path_option


def add_commands_on_runs(commands: Any) -> None:
    """Adds `fdnet stokes` and `movie` to the command line."""
    about = "compute sections of a finished run by resolved flow, to check the network"
    parser = new_command(commands, "stokes", _stokes, about, "fdnet stokes runs/mine --section 2")
    parser.add(THE_FLOW, "run RUN", "run folder", path_option)
    number = "number of a section, 1 at the face (default 1); may be given again"
    parser.add(THE_FLOW, "--section N", number, int, action="append")
    cells = "cells across the mean radius of a fine, on the finer of two grids (default 3.5)"
    parser.add(THE_FLOW, "--across CELLS", cells, float)
    parser.share("--json", "--quiet")

    about = "draw the invasion of a finished run as a movie, or a picture of before and after"
    movie = new_command(commands, "movie", _movie, about, "fdnet movie runs/mine --show flux")
    movie.add(OUTPUT, "run RUN", "run folder", path_option)
    what = "the fines alone (default), or with them the flux of every throat"
    movie.add(THE_PICTURE, "--show", what, default="fines", choices=("fines", "flux"))
    movie.add(THE_PICTURE, "--fps N", "frames a second (default 4)", float, 4.0)
    file = "the movie, .gif or .mp4 (default RUN/invasion.gif), or a .png of before and after"
    movie.add(OUTPUT, "--out FILE", file, path_option)
    movie.share("--force", "--quiet")


def _movie(options: argparse.Namespace) -> int:
    from fdnet.run.movie import movie_of

    path = movie_of(
        options.run,
        options.out,
        per_second=options.fps,
        flux=options.show == "flux",
        force=options.force,
        progress=not options.quiet,
    )
    print(f"{'picture' if path.suffix.lower() == '.png' else 'movie'}: {path}")
    return 0


def _stokes(options: argparse.Namespace) -> int:
    from fdnet.run.stokes_sections import ACROSS_A_FINE, stokes_sections

    def follow(line: str) -> None:
        if not options.quiet:
            print(line, file=sys.stderr, flush=True)

    across = ACROSS_A_FINE if options.across is None else options.across
    rows = stokes_sections(options.run, options.section or (1,), across=across, follow=follow)
    if options.json:
        print(json.dumps(rows, indent=2))
    else:
        print("\n\n".join(map(_text, rows)))
    return 0


def _text(row: Mapping[str, Any]) -> str:
    from fdnet.report.tables import in_millidarcy

    keys = ("k_initial_m2", "k_damaged_m2")
    lines: list[tuple[str, ...]] = [("", "before, mD", "after, mD", "lost")]
    for name, prefix in (("resolved flow", ""), ("network", "network_")):
        lost = row[f"{prefix}k_reduction"]
        both = (in_millidarcy(row[f"{prefix}{key}"]) for key in keys)
        lines.append((name, *both, "-" if lost is None else f"{lost:.1%}"))
    errors = (f"{row[f'{key}_error']:.1%}" for key in ("k_initial", "k_damaged"))
    cells = (f"{1e6 * row[f'cell_{state}_m']:.3g}" for state in ("initial", "damaged"))
    over = (f"{float(row[f'network_{key}'] / row[key] - 1.0):+.1%}" for key in keys)
    lines += [
        ("error of the flow", *errors, ""),
        ("its finer cells, µm", *cells, ""),
        ("network over flow", *over, ""),
    ]
    slab = f"{1e3 * row['x_lo_m']:g} to {1e3 * row['x_hi_m']:g} mm"
    head = f"section {row['section']}, {slab}, cut out"
    law = f"damage law of the network: {row['network_damage_law']}"
    table = (f"{one[0]:<20}{one[1]:>14}{one[2]:>14}{one[3]:>10}".rstrip() for one in lines)
    return "\n".join([head, law, *table])
