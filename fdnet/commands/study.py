"""`fdnet study`: error against run time of one of fdnet's choices."""

from typing import Any


def add_study(commands: Any, common: Any) -> None:
    """Adds the command to the command line."""
    from fdnet.studies.command import add_arguments, run

    command = commands.add_parser(
        "study", parents=[common], help="error against run time of one of fdnet's choices"
    )
    add_arguments(command)
    command.set_defaults(action=run)
