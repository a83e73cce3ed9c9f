"""`fdnet permeability`: permeability of a file of spheres, without LIGGGHTS."""

from typing import Any


def add_command(commands: Any, common: Any) -> None:
    """Adds the command to the command line."""
    from fdnet.permeability.command import run
    from fdnet.permeability.options import add_arguments

    command = commands.add_parser(
        "permeability",
        parents=[common],
        help="permeability of a file of spheres, without LIGGGHTS",
    )
    add_arguments(command)
    command.set_defaults(action=run)
