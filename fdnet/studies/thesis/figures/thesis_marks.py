"""The thesis's numbers as its figures show them: from values.toml to `ThesisMarks` by specimen."""

from fdnet.studies.thesis.figures.canvas import DISTANCE_CLASSES
from fdnet.studies.thesis.figures.marks import ThesisMarks, Told
from fdnet.studies.thesis.numbers.deposition import TOLD_OF
from fdnet.studies.thesis.numbers.values import (
    TABLE3,
    DepositionTold,
    Statistic,
    ThesisSpecimen,
    ThesisValues,
)

CLASS_BOUNDS = ((0.0, 0.4), (0.4, 0.6), (0.6, 1.0))
"""Throat porosities of the DISTANCE_CLASSES."""


def thesis_marks(values: ThesisValues) -> dict[str, ThesisMarks]:
    """By the names the figures use: "specimen1" to "specimen8" and "table3"."""
    return {_name(key): _marks(one, values) for key, one in values.specimens.items()}


def _name(key: str) -> str:
    return key if key == TABLE3 else f"specimen{key}"


def _marks(one: ThesisSpecimen, values: ThesisValues) -> ThesisMarks:
    return ThesisMarks(
        porosity_loss=one.porosity - one.damaged_porosity[0],
        depth_mm=one.invaded_depth_mm,
        count=one.invaded_count,
        count_first_mm=one.count_first_mm,
        fraction_first_bin=one.fraction_first_bin,
        fraction_beyond_0p5mm=one.fraction_beyond_0p5mm,
        face_porosity_loss=one.face_porosity_loss,
        reductions=one.reductions,
        size_classes_mm=one.size_classes_mm or (),
        statistics=tuple(_told(told) for told in values.statistics if told.specimen == one.id),
        deposition=_deposition(values.deposition) if one.id == TOLD_OF else {},
    )


def _told(one: Statistic) -> Told:
    return Told(quantity=one.quantity, value=one.value, sense=one.sense, between=one.between)


def _deposition(told: tuple[DepositionTold, ...]) -> dict[str, Told]:
    found = {one.throat_porosity: one for one in told if one.nearer}
    classes = zip(DISTANCE_CLASSES, CLASS_BOUNDS, strict=True)
    return {
        name: Told(
            quantity=found[bounds].nearer, value=found[bounds].value, sense=found[bounds].sense
        )
        for name, bounds in classes
        if bounds in found
    }
