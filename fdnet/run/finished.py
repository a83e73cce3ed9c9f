"""A finished run as an object: its numbers, tables, spheres, network and meshes."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property, partial
from html import escape
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal

from fdnet.case.case import Case, InvasionCase
from fdnet.errors import CaseError
from fdnet.files import expanded
from fdnet.names import ALL_SPHERES
from fdnet.network.laws.named import LAWS
from fdnet.network.network import Network, build_network
from fdnet.network.states import all_conductances
from fdnet.report import tables
from fdnet.report.figures import fill_depth, shown
from fdnet.report.text import text_lines
from fdnet.run.folder import ANALYSE_AGAIN, START_OVER, check_one, finished_manifest
from fdnet.spheres.readers import read_spheres
from fdnet.spheres.snapshot import Snapshot

if TYPE_CHECKING:
    import pandas as pd

HISTORY_COLUMNS = ("chunk", "step", "upstream", "invaded", "passed")
"""Of invade/history.csv, which the deck writes."""
State = Literal["initial", "damaged"]  # Without the fines, or with them


@dataclass(frozen=True, eq=False, kw_only=True)
class FinishedRun:
    """A finished run. Tables are read when they are first used, as the run wrote them.

    Attributes:
        path: the run folder.
        case: the case with every default written out.
        manifest: what made the run: versions, digests, commands, seeds, seconds of each stage.

    `print(run)` shows the result in mD and m2, mm and percent. Every key of `summary` is an
    attribute too, a permeability in mD as well: `run.k_damaged_m2`, `run.k_damaged_mD`,
    `run.porosity_initial`, `run.stop_reason`, `run.warnings`.
    """

    path: Path
    case: Case
    manifest: Mapping[str, Any]

    def __getattr__(self, name: str) -> Any:
        """A number of the summary by its key; a permeability also in mD."""
        if name.startswith("_") or name in FinishedRun.__dataclass_fields__:
            raise AttributeError(name)
        if name in self.summary:
            return self.summary[name]
        in_m2 = f"{name.removesuffix('_mD')}_m2"
        if name.startswith("k_") and name.endswith("_mD") and in_m2 in self.summary:
            k = self.summary[in_m2]
            return None if k is None else k / tables.MILLIDARCY
        near = get_close_matches(name, dir(self), 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise AttributeError(f"a run of fdnet has no {name!r}{hint}")

    def __dir__(self) -> list[str]:
        keys = [*self.summary, *(f"{k[:-3]}_mD" for k in self.summary if re.match("k_.*_m2$", k))]
        return sorted({*super().__dir__(), *keys})

    @property
    def lost(self) -> float | None:
        """Share of the permeability that is lost, `k_reduction`; None where k was 0."""
        return self.summary["k_reduction"]

    def plot(self) -> Any:
        """Permeability in place (mD) and porosity against depth (mm), as in report.html.

        Returns:
            The two axes of matplotlib, (2,); `plt.show()` or `plt.savefig(...)` follow.
        """
        box = [[0.0, self.case.size_m[0]]]
        parts: Any = SimpleNamespace(  # named as in an `Analysis`
            sections=[*_without_units(self.sections).itertuples()],
            profile=_with_edges(self.profile),
            layers=_with_edges(self.layers) if len(self.layers) else None,
            occupancy=self.summary["supplied_count"] or None,
            porosity_initial=self.summary["porosity_initial"],
            porosity_damaged=self.summary["porosity_damaged"],
            network=SimpleNamespace(box=box),
        )
        return shown(partial(fill_depth, analysis=parts))

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """The numbers of summary.json, SI; a length is in m, a permeability in m2."""
        return self._read("summary.json", tables.read_summary)

    @cached_property
    def sections(self) -> "pd.DataFrame":
        """One row for each slab along the flow, with edges (m), porosity, k (m2) and fines."""
        return self._table("sections")

    @cached_property
    def profile(self) -> "pd.DataFrame":
        """One row for each bin of depth, with edges (m), porosities and share of the fines."""
        return self._table("profile")

    @cached_property
    def layers(self) -> "pd.DataFrame":
        """Thin layers of the first millimetre: edges (m), k (m2) in place, pressure drops, fines.

        They are from the network of all spheres; where that was not solved there are no rows.
        """
        if "layers.csv" in self.manifest["files"]:
            return self._table("layers")
        return tables.empty_table(tables.LAYER_COLUMNS)

    @cached_property
    def pores(self) -> "pd.DataFrame":
        """One row for each pore, with centre (m), radius (m), volume (m3), fines, pressures."""
        return self._table("pores")

    @cached_property
    def throats(self) -> "pd.DataFrame":
        """One row for each throat, with pores, radius (m), conductances and fluxes (m3), law."""
        return self._table("throats")

    @cached_property
    def history(self) -> "pd.DataFrame":
        """The invasion over time, one row for each checkpoint, `time_s` of the simulation first.

        It joins history.csv of the run folder with the counts that the deck wrote to
        invade/history.csv. A run without fines has no history: the table has no rows.
        """
        if not isinstance(self.case, InvasionCase):
            return tables.empty_table(["time_s", *HISTORY_COLUMNS])
        check_one(self.path / "invade", self.manifest["invade"], "history.csv", START_OVER)
        counts = tables.read_table(self.path / "invade" / "history.csv", HISTORY_COLUMNS)
        return self._table("history").merge(counts, on="step", how="left")

    def spheres(self, state: State = "damaged") -> Snapshot:
        """Grains and fines at the end of the run, or the grains alone before it.

        `state` is "damaged" or "initial". The spheres are read from spheres_damaged.csv or
        spheres_initial.csv; the box is that of the case, m. Fines upstream of the formation face
        (x < 0) are among the damaged ones.
        """
        if state not in ("initial", "damaged"):
            raise CaseError(f"state: {state!r}, expected 'initial' (no fines) or 'damaged'")
        box = [(0.0, side) for side in self.case.size_m]
        return self._read(f"spheres_{state}.csv", lambda path: read_spheres(path, box=box))

    def network(self) -> Network:
        """The pore network of the grains where they ended, built anew from spheres_damaged.csv.

        Its pores and throats are in the order of `pores` and `throats`. It is the network that the
        run used: the file holds every digit of the spheres.
        """
        return build_network(
            self.spheres().grains(), periodic=self.case.periodic, walls=self.case.analysis.walls
        )

    def to_openpnm(self, state: State = "damaged") -> Any:
        """The network that gives `k_initial_m2` or `k_damaged_m2`, for OpenPNM, SI units.

        With fines that is the network of `damage_law_used` of the summary: for "all-spheres" the
        pores and throats between grains and fines alike, else those between the grains. Where
        fines appeared to raise the permeability (`all_spheres_above_grains` in `network_counts` is
        1), `k_damaged_m2` is the permeability of the grains, and this network has a little more.

        The viscosity is that of the case. Raises CaseError where OpenPNM is not installed.
        """
        analysis, spheres = self.case.analysis, self.spheres(state)
        if state == "initial" or self.summary.get("damage_law_used") == ALL_SPHERES:
            network = build_network(spheres, periodic=self.case.periodic, walls=analysis.walls)
            law = LAWS[analysis.law] if state == "initial" else all_conductances
            conductance = law(network)
        else:
            network = self.network()
            conductance = self.throats[f"conductance_{state}_m3"].to_numpy()
        return tables.to_openpnm(network, conductance, viscosity=self.case.fluid.viscosity_Pa_s)

    def _table(self, name: str) -> "pd.DataFrame":
        check_one(self.path, self.manifest, f"{name}.csv", ANALYSE_AGAIN)
        return tables.read_table(self.path / f"{name}.csv")

    def _read(self, name: str, read: Callable[[Path], Any]) -> Any:
        """A file of the run as `read` gives it; CaseError where the run wrote another one."""
        content = read(self.path / name)
        check_one(self.path, self.manifest, name, ANALYSE_AGAIN)
        return content

    def __str__(self) -> str:
        return "\n".join(text_lines(self.path, self.summary))

    def __repr__(self) -> str:
        return f"FinishedRun({self.case.name!r}, {str(self.path)!r})"

    def _repr_html_(self) -> str:
        return f"<pre>{escape(str(self))}</pre>"


def _without_units(table: "pd.DataFrame") -> "pd.DataFrame":
    return table.rename(columns=lambda name: name.removesuffix("_m2").removesuffix("_m"))


def _with_edges(table: "pd.DataFrame") -> SimpleNamespace:
    """The columns of a table by depth, and the edges (m) of its rows."""
    columns = {str(name): one.to_numpy() for name, one in _without_units(table).items()}
    return SimpleNamespace(**columns, edges=[*columns["x_lo"], columns["x_hi"][-1]])


def open_run(path: str | Path) -> FinishedRun:
    """A finished run, read from its folder.

    Args:
        path: the run folder, for example "runs/quick".

    Returns:
        The run: its `summary` (mapping), tables (pandas, SI) and spheres (m); see `FinishedRun`.

    Raises:
        CaseError: there is no folder, it holds no run or an unfinished one, or its records cannot
            be read. The message names the path and what to do.

    Examples:
        >>> import fdnet
        >>> run = fdnet.open_run("runs/quick")
        >>> run.k_damaged_mD < run.k_initial_mD
        True
        >>> run.lost == run.summary["k_reduction"]
        True
        >>> list(run.sections.columns[:5])
        ['section', 'x_lo_m', 'x_hi_m', 'porosity_initial', 'porosity_damaged']
        >>> [axes.get_ylabel() for axes in run.plot()]
        ['permeability in place (mD)', 'porosity (–)']
    """
    folder = expanded(path)
    manifest, case = finished_manifest(folder)
    return FinishedRun(path=folder, case=case, manifest=manifest)
