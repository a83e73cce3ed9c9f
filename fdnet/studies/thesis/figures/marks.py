"""What the thesis says, as its figures show it beside ours; all of it optional, for not every specimen has each."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import SupportsFloat


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """A number of the thesis: `value` of `quantity`, or with `between` (low, high) the share of throats or pores whose
    `quantity` lies there, mm or mm3. `sense` "exact", "about", "at least" or "at most".

    Drawn are: with `between`, "throat radius", "pore radius", "throat length" and "pore volume"; without, "throats
    without fines", "throats with fines", "mean porosity of throats with fines", "throats blocked".
    """

    quantity: str
    value: float
    sense: str = "about"
    between: tuple[float, float] | None = None

    @property
    def words(self) -> str:
        """ "about 70 %"."""
        return (
            percent(self.value) if self.sense == "exact" else f"{self.sense} {percent(self.value)}"
        )

    @property
    def what(self) -> str:
        """ "throat radius 0 to 0.05 mm"."""
        if self.between is None:
            return self.quantity
        unit = "mm³" if self.quantity.endswith("volume") else "mm"
        return f"{self.quantity} {self.between[0]:g} to {self.between[1]:g} {unit}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisMarks:
    """Numbers of the thesis on one specimen; fractions, lengths mm.

    `porosity_loss` initial less damaged; `fraction_first_bin` of the invaded fines in its first bin, whose width it
    does not give; `face_porosity_loss` at the formation face; `reductions` 1 - k/k0 of 1 mm sections from the face, as
    many as it gives; `size_classes_mm` radii (low, high) of the fines it colours. The rest is of the first millimetre:
    `count_first_mm` fines, `statistics` of throats and pores, and `deposition` by class of throat porosity, the
    (quantity, value) of fines nearer the "axis" or the "wall".
    """

    porosity_loss: float | None = None
    depth_mm: float | None = None
    count: int | None = None
    count_first_mm: float | None = None
    fraction_first_bin: float | None = None
    fraction_beyond_0p5mm: float | None = None
    face_porosity_loss: float | None = None
    reductions: tuple[float, ...] = ()
    size_classes_mm: tuple[tuple[float, float], ...] = ()
    statistics: tuple[Told, ...] = ()
    deposition: Mapping[str, Told] = field(default_factory=dict)


NONE = ThesisMarks()


def said(sentence: str, thesis: Mapping[str, ThesisMarks]) -> str:
    """The sentence with the numbers of the thesis put in, such as "{specimen1.depth_mm:g} mm"; empty without them."""
    try:
        return sentence.format(**thesis)
    except (KeyError, IndexError, TypeError):
        return ""


def percent(value: SupportsFloat) -> str:
    """A fraction in per cent, two digits."""
    whole = 100 * float(value)
    return f"{whole:.2g} %" if whole < 99.5 else f"{whole:.0f} %"
