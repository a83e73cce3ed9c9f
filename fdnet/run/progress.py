"""Progress of a run of LIGGGHTS: a live bar on a terminal, elsewhere a line every few seconds."""

import re
import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

_THERMO = re.compile(r"^\s*(\d+)\s+\d+\s+[-+.\deE]+\s+[-+.\deE]+\s*$")
_QUIET_SECONDS = 5.0


class Progress:
    """Follows the screen of a run; a stage is `expected` to take about that many steps."""

    def __init__(self, stage: str, expected: int, *, show: bool = True) -> None:
        self.stage, self.expected, self.show = stage, max(1, expected), show
        self.start = self.last = time.monotonic()
        self.first_step: int | None = None
        self.step, self.note = 0, ""
        self._draw: Callable[[], None] = self._line
        self._stop: Callable[[], None] = lambda: None

    def __enter__(self) -> Self:
        if self.show and sys.stderr.isatty():
            self._open_bar()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stop()

    def _open_bar(self) -> None:
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
        task = bar.add_task(self.stage, total=self.expected, note="")
        self._draw = lambda: bar.update(
            task, completed=min(self.step, self.expected), note=self._text()
        )
        self._stop = bar.stop

    def __call__(self, line: str) -> None:
        """Take one line of the screen."""
        if line.startswith("FDNET checkpoint"):
            step, upstream, invaded, passed = line.split()[3:7]
            self.note = f"upstream {upstream}, invaded {invaded}, passed {passed}"
            self._at(int(step))
        elif line.startswith("FDNET"):
            self.note = " ".join(line.split()[1:4])
            self._at(self.step)
        elif match := _THERMO.match(line):
            self._at(int(match.group(1)))

    def _at(self, step: int) -> None:
        self.step = step
        if self.first_step is None:
            self.first_step, self.start = step, time.monotonic()
        if self.show:
            self._draw()

    def _text(self) -> str:
        elapsed, done = time.monotonic() - self.start, self.step - (self.first_step or 0)
        left = (
            (self.expected - self.step) * elapsed / done
            if done > 0 and self.step < self.expected
            else 0.0
        )
        eta = f", ~{_clock(left)} left" if left else ""
        return f"step {self.step} of ~{self.expected}, {self.note}{eta}"

    def _line(self) -> None:
        now = time.monotonic()
        if now - self.last >= _QUIET_SECONDS:
            self.last = now
            try:
                print(f"{self.stage}: {self._text()}", file=sys.stderr, flush=True)
            except BrokenPipeError:  # nobody reads the progress any more; the run goes on
                self.show = False


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return (
        f"{minutes // 60} h {minutes % 60} min"
        if minutes >= 60
        else (f"{minutes} min {rest} s" if minutes else f"{rest} s")
    )
