"""`fdnet movie`: the invasion of a finished run as a GIF or MP4."""

import argparse
from typing import Any

from fdnet.files.paths import path_option


def add_command(commands: Any, common: argparse.ArgumentParser) -> None:
    """Adds the command to the command line."""
    movie = commands.add_parser(
        "movie", parents=[common], help="the invasion of a finished run as a GIF or MP4"
    )
    movie.add_argument("run", type=path_option, help="run folder")
    movie.add_argument(
        "--out", type=path_option, help="the movie, .gif or .mp4 (default RUN/invasion.gif)"
    )
    movie.add_argument(
        "--fps", type=float, default=4.0, metavar="N", help="frames a second (default 4)"
    )
    movie.set_defaults(action=_movie)


def _movie(options: argparse.Namespace) -> int:
    from fdnet.run.movie import movie_of

    print(f"movie: {movie_of(options.run, options.out, per_second=options.fps)}")
    return 0
