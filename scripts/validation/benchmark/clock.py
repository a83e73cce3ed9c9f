"""Seconds and peak memory of the steps of a benchmark, in its own process."""

import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any


class Clock:
    """Seconds and peak memory of steps, in order."""

    def __init__(self) -> None:
        self.steps: dict[str, dict[str, float]] = {}

    def timed(self, step: str, work: Callable[[], Any]) -> Any:
        """The result of `work`; its seconds are added to `step`, and its peak memory is kept."""
        _forget_peak()
        cpu, wall = time.process_time(), time.perf_counter()
        result = work()
        values = self.steps.setdefault(step, {"cpu_s": 0.0, "wall_s": 0.0, "peak_MB": 0.0})
        values["cpu_s"] += time.process_time() - cpu
        values["wall_s"] += time.perf_counter() - wall
        values["peak_MB"] = max(values["peak_MB"], _peak())
        return result

    def total(self, names: list[str]) -> dict[str, float]:
        """Sum of the seconds and largest peak of the steps `names`."""
        steps = [self.steps[name] for name in names]
        sums = {key: sum(step[key] for step in steps) for key in ("cpu_s", "wall_s")}
        return sums | {"peak_MB": max(step["peak_MB"] for step in steps)}


def _forget_peak() -> None:
    """Linux starts the process's peak memory anew; elsewhere it stays that of all steps so far."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def _peak() -> float:
    try:
        status = Path("/proc/self/status").read_text()
        return int(status.split("VmHWM:")[1].split()[0]) / 1024
    except (OSError, IndexError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
