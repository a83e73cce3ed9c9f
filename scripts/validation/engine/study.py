"""What a study is: points to run, what one of them measures, and rows of errors and costs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

Value = float | str
COSTS = ("wall_s", "core_s", "steps", "peak_memory_bytes")
"""Keys of a measurement that are costs, not observations; costs that it lacks are measured."""
DONE = "done"


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One run of a study.

    Attributes:
        series: the curve that it belongs to.
        knob: name of what is varied.
        value: value of the knob.
        seed: of the pack and the fines.
        settings: whatever else distinguishes it from other points.
    """

    series: str
    knob: str
    value: Value
    seed: int = 0
    settings: Mapping[str, Value] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """Names the point among all of its study."""
        parts = {self.knob: self.value, **self.settings, "seed": self.seed}
        return " ".join(
            [self.series, *(f"{name}={shown(value)}" for name, value in parts.items())]
        )

    @property
    def slug(self) -> str:
        """The key as a folder's name."""
        return "".join(c if c.isalnum() or c in ".=-+" else "_" for c in self.key)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What one point gave.

    Attributes:
        point: the point.
        status: "done", or why there is no result: refused, failed, over time, over memory.
        observed: observations by name.
        wall_s: seconds by the clock.
        core_s: CPU seconds.
        steps: number of steps; nan where it has no meaning.
        peak_memory_bytes: largest memory; nan where it has no meaning.
    """

    point: Point
    status: str
    observed: Mapping[str, float]
    wall_s: float
    core_s: float
    steps: float
    peak_memory_bytes: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the table: the error of one quantity of one run.

    Attributes:
        series: the curve.
        knob: name of what is varied.
        value: value of the knob.
        seed: of the run.
        quantity: name of what was observed.
        observed: its value.
        error: difference from the reference, over the reference or another scale.
        error_uncertainty: one standard deviation of the error.
        reference_band: half of the 95 % band of the mean that the error is taken from; 0 where
            that is exact or of the same seed.
        wall_s: seconds by the clock.
        core_s: CPU seconds.
        steps: number of steps, nan where it has no meaning.
        peak_memory_mb: largest memory, MB, nan where it has no meaning.
        status: "done", or why there is no result.
        role: "reference" for the runs that the error is taken from.
        run: key of the point.
    """

    series: str
    knob: str
    value: Value
    seed: int
    quantity: str
    observed: float
    error: float
    error_uncertainty: float
    reference_band: float
    wall_s: float
    core_s: float
    steps: float
    peak_memory_mb: float
    status: str
    role: str
    run: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """One axes of the figure: the error of a quantity against cost.

    Attributes:
        quantity: name of what was observed.
        title: of the axes.
        series: the curves; all that have the quantity when empty.
        label: of the error's axis.
        cost: column of the rows that is the cost, or "value" for the knob itself.
        common: ending of all series' names, which the legend leaves out.
        knob: label of the cost's axis where the cost is "value".
    """

    quantity: str
    title: str
    series: tuple[str, ...] = ()
    label: str = "relative error"
    cost: str = "core_s"
    common: str = ""
    knob: str = "value"


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A study of error against run time.

    Attributes:
        name: of the study and its files.
        title: of its page.
        knob_label: what is varied, in words.
        points: the points of the quick (True) or the full form, cheapest first.
        measure: runs one point and returns its observations and, under the names in `COSTS`, its
            costs; the folder is shared by all points (packs are made once).
        judge: turns all measurements into rows.
        panels: of the figure.
        defaults: fdnet's own value of the knob, by series.
        summary: Markdown that takes the place of the knees; None for knees.
        isolated: whether a point of the full form runs in a process of its own; those of the
            quick form all run in one.
        inputs: text of whatever else decides the numbers (a base case), so that a study is not
            continued with another.
        needs_liggghts: whether LIGGGHTS must be there.
        seconds: limit of an isolated point.
        bytes: memory limit of an isolated point.
        page: Markdown of the whole page, in place of knees and tables; None for these.
        draw: draws the figure to a path, in place of the panels; None for these.
    """

    name: str
    title: str
    knob_label: str
    points: Callable[[bool], Sequence[Point]]
    measure: Callable[[Point, Path], Mapping[str, float]]
    judge: Callable[[Sequence[Measured]], Sequence[Row]]
    panels: tuple[Panel, ...]
    defaults: Mapping[str, Value] = field(default_factory=dict)
    summary: Callable[[Sequence[Row]], str] | None = None
    isolated: bool | Callable[[Point], bool] = True
    inputs: Callable[[], str] = str
    needs_liggghts: bool = False
    seconds: float = 3600.0
    bytes: float = 16 * 2.0**30
    page: Callable[[Sequence[Row]], str] | None = None
    draw: Callable[[Sequence[Row], Path], None] | None = None


def ladder(
    series: str, knob: str, values: Sequence[float], *, seeds: int, settings: Mapping[str, Value]
) -> list[Point]:
    """Points at these values of the knob, each with seeds 1 to `seeds`."""
    return [
        Point(series=series, knob=knob, value=value, seed=seed, settings=settings)
        for value in values
        for seed in range(1, seeds + 1)
    ]


def shown(value: Value) -> str:
    """A knob's value in words."""
    return value if isinstance(value, str) else f"{value:.6g}"


def row_of(
    measured: Measured,
    quantity: str,
    *,
    error: float,
    uncertainty: float,
    band: float = 0.0,
    role: str = "",
) -> Row:
    """The row of one quantity of one run; `uncertainty` is one standard deviation of the error."""
    point = measured.point
    return Row(
        series=point.series,
        knob=point.knob,
        value=point.value,
        seed=point.seed,
        quantity=quantity,
        observed=measured.observed.get(quantity, float("nan")),
        error=error,
        error_uncertainty=uncertainty,
        reference_band=band,
        wall_s=measured.wall_s,
        core_s=measured.core_s,
        steps=measured.steps,
        peak_memory_mb=measured.peak_memory_bytes / 1e6,
        status=measured.status,
        role=role,
        run=point.key,
    )
