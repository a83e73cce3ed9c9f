"""The stages of a run, in order."""

from typing import Literal, get_args

Stage = Literal["pack", "invade", "clean_up", "analyse", "report"]
STAGES: tuple[Stage, ...] = get_args(Stage)
LIGGGHTS_STAGES = STAGES[:3]
"""The stages that LIGGGHTS carries out, each in a folder of its name."""
