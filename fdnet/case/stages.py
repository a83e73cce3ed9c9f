"""The stages of a run, in order."""

from typing import Literal, get_args

Stage = Literal["pack", "invade", "analyse", "report"]
STAGES: tuple[Stage, ...] = get_args(Stage)
