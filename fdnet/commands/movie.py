"""`fdnet movie`: the invasion of a finished run as a GIF or MP4, or as one picture."""

import argparse
from typing import Any

from fdnet.files.paths import path_option


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    movie = commands.add_parser(
        "movie", parents=[common], help="the invasion of a finished run as a GIF, MP4 or picture"
    )
    movie.add_argument("run", type=path_option, help="run folder")
    movie.add_argument(
        "--out",
        type=path_option,
        help="the movie, .gif or .mp4 (default RUN/invasion.gif), or one picture of before and "
        "after, .png",
    )
    movie.add_argument(
        "--show",
        choices=("fines", "flux", "streamlines"),
        default="fines",
        help="the fines alone (default), or with them the flux of every throat, or streamlines "
        "(half a minute and more)",
    )
    movie.add_argument(
        "--fps", type=float, default=4.0, metavar="N", help="frames a second (default 4)"
    )
    movie.add_argument("--force", action="store_true", help="replace a file that is there")
    movie.set_defaults(action=_movie)


def _movie(options: argparse.Namespace) -> int:
    from fdnet.run.movie import movie_of

    path = movie_of(
        options.run,
        options.out,
        per_second=options.fps,
        show=options.show,
        force=options.force,
    )
    print(f"{'picture' if path.suffix.lower() == '.png' else 'movie'}: {path}")
    return 0
