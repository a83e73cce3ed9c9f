"""What a study is: points to run, what one of them measures, and the rows that say error against run time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

Value = float | str
COSTS = ("wall_s", "core_s", "steps", "peak_memory_bytes")
"""Keys of what a measurement returns that are costs, not observations; those it leaves out are measured around it."""
DONE = "done"


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One run: the curve it belongs to, the knob with its value, the seed, and whatever else tells it apart."""

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
    """What one point gave. `status` is "done" or why there is nothing: refused, failed, over time, over memory.

    `steps` and `peak_memory_bytes` are nan where they have no meaning.
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
    """One line of the table: the error of one quantity of one run, with the error's own (one sigma) uncertainty.

    `reference_band` is the 95 % half-width of the mean the error is taken from, 0 where it is exact or the same seed's;
    `role` is "reference" for the runs that are that mean themselves; `run` is the point's key.
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
    """One axes of the figure: a quantity's error against cost for some series (all that have it when empty).

    `cost` is a column of the rows: a cost, or "value", the knob itself, called `knob` there; `common` is what all its
    series' names end in, left out of the legend.
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

    `points(quick)` lists what to run, cheapest first. `measure(point, work)` runs one and returns its observations
    and, under the names in COSTS, costs of its own; `work` is a folder all points share (packs made once).
    `judge(measured)` turns all of them into rows. `defaults` gives fdnet's own value of the knob by series, `remarks`
    what the numbers cannot say, `summary(rows)` what is told of the rows in place of knees (Markdown). Points of the
    full form run in a process of their own, limited to `seconds` and `bytes`, unless not `isolated` (or, a function,
    not for that point); those of the quick form all in one. `inputs()` names whatever else decides the numbers (a base
    case), so that a study is not continued with another.
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
