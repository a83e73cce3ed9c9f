"""What a run says while it goes on, and when it is expected to end."""

import math
import re
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Self

from fdnet.scales.clock import spoken_time

_THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
ONE_CORE: Mapping[str, str] = MappingProxyType(dict.fromkeys(_THREADS, "1"))
"""What numpy, scipy and numba read when they are loaded, for a process that works on one core."""


# ---- When a stage ends, from what is known before it and from what its screen says.
QUIET_SHARE, LEAST_LEFT, GROWTH = 0.3, 0.05, 0.4
"""Part of the plug time without crossings from which the stop rule is expected to hold; least
part of it that is left; and steps that are expected beyond the forecast, over those done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Forecast:
    """What is known of a stage before it, in steps of its first length."""

    expected: int  # at which it is expected to end
    plug: int = 0  # without a crossing of the face, after which it ends; 0 without such a rule
    cap: int | None = None  # at which it ends at the latest; None without such a step
    allowed: float = 0.0  # crossings a step that the rule lets pass
    # steps of a chunk, where later chunks may take more; 0 where all steps are alike
    chunk: int = 0

    def end(self, seen: Sequence[tuple[int, int]]) -> int:
        """The step at which it ends, never one that is past.

        It is the expected one, until the run has passed it. Once the face is quiet, the stop rule
        ends the run; while it is not, the rule holds no earlier than a plug time from now.

        Args:
            seen: step and number of fines that have crossed the face, of each checkpoint.
        """
        step, crossed = seen[-1]
        quiet = 0  # steps back from now in which no more have crossed than the rule lets pass
        for before, then in reversed(seen[:-1]):
            if crossed - then > self.allowed * (step - before):
                break
            quiet = step - before
        if self.plug and quiet >= QUIET_SHARE * self.plug:
            end = step + max(self.plug - quiet, LEAST_LEFT * self.plug)
        elif not self.plug and step < self.expected:
            end = self.expected
        else:
            end = max(self.expected, step + max(self.plug, GROWTH * step))
        most = math.inf if self.cap is None else self.cap
        return max(step, round(min(most, end)))


# ---- Progress of a run of LIGGGHTS: a live bar on a terminal, elsewhere a line every few seconds.
_THERMO = re.compile(r"^\s*(\d+)\s+\d+\s+[-+.\deE]+\s+[-+.\deE]+\s*$")
_QUIET_SECONDS = 5.0
_NOTES = {
    "grown": "grown {} of {}",
    "relaxing": "coming to rest, {} times, energy {} J",
    "restless": "not at rest, energy {} J",
    "energy": "at rest, energy {} J",
    "lifted": "{} fines of the cake lifted off",
    "cleaned": "chunk {}",
}
"""What the lines of a deck say, by their first word; a line without an entry says nothing."""


class Progress:
    """Follows the screen of a run, whose end is forecast anew at every line.

    The forecast is one, or the expected number of steps.

    The time left goes by the speed of the last third of the steps, because fines that come make
    steps slower. The bar is never full before the stage has ended. Chunks take one time: where one
    took more steps than the first, it counts as the first, and so do steps of its length.
    """

    def __init__(self, stage: str, forecast: Forecast | int, *, show: bool = True) -> None:
        self.stage, self.show = stage, show
        self.forecast = Forecast(expected=forecast) if isinstance(forecast, int) else forecast
        self.last = time.monotonic()
        self.crossed: list[tuple[int, int]] = []
        self.clock: list[tuple[int, float]] = []
        self.step, self.note = 0, ""
        self.begun, self.done, self.finer = 0, 0, 1.0  # of the chunk; steps, also of first length
        self._draw: Callable[[], None] = self._line
        self._stop: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        """Opens a bar on a terminal."""
        if not (self.show and sys.stderr.isatty()):
            return self
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as Bar

        bar = Bar(
            TextColumn("{task.description:>8}"),
            BarColumn(bar_width=10),
            TextColumn("{task.fields[note]}"),
            TimeElapsedColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        bar.start()
        task = bar.add_task(self.stage, total=max(1, self.forecast.expected), note="")
        self._draw = lambda: bar.update(
            task, completed=self.step, total=max(self.end, self.step + 1), note=self._text()
        )
        self._stop = bar.stop
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()

    def __call__(self, line: str) -> None:
        """Take one line of the screen."""
        if line.startswith("FDNET checkpoint"):
            chunk, step, upstream, invaded, passed = line.split()[2:7]
            self.note = f"upstream {upstream}, invaded {invaded}, passed {passed}"
            each = self.forecast.chunk
            done = int(chunk) * each or int(step)
            if each and done == self.done + each:
                self.finer = (int(step) - self.begun) / each
            self.begun, self.done = int(step), done
            self.crossed.append((done, int(invaded) + int(passed)))
            self._at(int(step))
        elif line.startswith("FDNET"):
            name, *numbers = line.split()[1:] or [""]
            if name in _NOTES:
                self.note = _NOTES[name].format(*map(_short, numbers), "", "")
                self._at(self.step)
        elif match := _THERMO.match(line):
            self._at(int(match.group(1)))

    @property
    def even(self) -> int:
        """The step in steps of the first length."""
        return self.done + round((self.step - self.begun) / self.finer)

    @property
    def end(self) -> int:
        """The step at which the stage is expected to end, with steps as long as now."""
        last = self.crossed[-1][1] if self.crossed else 0
        end = self.forecast.end([*self.crossed, (self.even, last)])
        return self.step + round((end - self.even) * self.finer)

    def _at(self, step: int) -> None:
        if step < self.step:  # another attempt at a pack counts from zero
            self.clock, self.crossed = [], []
        self.step = step
        self.clock.append((step, time.monotonic()))
        if self.show:
            self._draw()

    def left(self) -> float:
        """Seconds left by the speed of the last third of the steps; 0 where it is not known."""
        step, now = self.clock[-1]
        since = self.clock[0][0] + 2 * (step - self.clock[0][0]) / 3
        before, then = next(one for one in self.clock if one[0] >= since)
        if before == step:
            before, then = self.clock[0]
        done = step - before
        return (self.end - step) * (now - then) / done if done > 0 else 0.0

    def _text(self) -> str:
        left = self.left() if self.clock else 0.0
        eta = f"~{spoken_time(left)} left" if left else ""
        steps = f"step {_short(str(self.step))} of ~{_short(str(self.end))}"
        return ", ".join(filter(None, (steps, self.note, eta)))

    def _line(self) -> None:
        now = time.monotonic()
        if now - self.last >= _QUIET_SECONDS:
            self.last = now
            try:
                print(f"{self.stage}: {self._text()}", file=sys.stderr, flush=True)
            except BrokenPipeError:  # nobody reads the progress any more; the run goes on
                self.show = False


def _short(number: str) -> str:
    """A whole number below 10^9 as it is, others with three digits; a word stays."""
    if number.isdecimal() and len(number) < 10:
        return number
    try:
        return f"{float(number):.3g}"
    except ValueError:
        return number
