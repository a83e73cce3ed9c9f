"""What must hold between the keys of an invasion whose forces fdnet computes."""

from collections.abc import Iterator

from fdnet.case.control import Run
from fdnet.case.particles import Grains
from fdnet.case.parts import Drag


def flow_field(drag: Drag) -> Iterator[str]:
    """The network moves the mud at the rate over the cross-section; it alone knows the drive."""
    if drag.field == "network" and drag.upstream != "darcy":
        yield (
            f"drag.upstream: {drag.upstream!r}, but with drag.field 'network' the mud moves at "
            "the rate over the cross-section; set drag.upstream = 'darcy'"
        )
    if drag.field != "network" and drag.drive is not None:
        yield (
            f"drag.drive: {drag.drive!r} belongs to drag.field 'network'; the uniform field "
            "always has its first velocity; leave it out"
        )


def network_grains(drag: Drag, grains: Grains) -> Iterator[str]:
    """The pores of the network are those of grains that stay."""
    if drag.field == "network" and grains.motion == "mobile":
        yield (
            "grains.motion: 'mobile' with drag.field 'network', whose pores are those of grains "
            "that stay; take 'fixed'"
        )


def stop_rate(run: Run, drag: Drag) -> Iterator[str]:
    """Only a rate that falls can end a run."""
    if run.stop_rate is not None and not drag.slowed:
        yield (
            f"run.stop_rate: {run.stop_rate:g} needs a rate that falls; leave it out, or set "
            "drag.field = 'network' with drag.drive = 'pressure'"
        )


def stop_volume(run: Run, drag: Drag) -> Iterator[str]:
    """The uniform field keeps no account of the volume: it is the rate times the time."""
    if run.stop_pore_volumes is not None and drag.field != "network":
        yield (
            f"run.stop_pore_volumes: {run.stop_pore_volumes:g} needs drag.field = 'network', but "
            f"it is {drag.field!r}; set run.duration_ms, since the uniform field keeps its rate"
        )


def crowd_scheme(drag: Drag) -> Iterator[str]:
    """One damping for all fines cannot carry a coefficient of each."""
    if drag.coupled and drag.scheme == "viscous":
        yield (
            "drag.scheme: 'viscous' has one damping for all fines, drag.crowd "
            f"{drag.crowd!r} one for each; take 'implicit' or 'held'"
        )


def update_travel(drag: Drag) -> Iterator[str]:
    """Only coupled forces are computed anew."""
    if drag.update_travel is not None and not drag.coupled:
        yield (
            f"drag.update_travel: {drag.update_travel:g} belongs to a drag that is computed while "
            "LIGGGHTS waits; leave it out, or set drag.crowd = 'beetstra'"
        )


def coupled_inertia(drag: Drag) -> Iterator[str]:
    """The Reynolds number of coupled drag is that of the law of the crowd."""
    if drag.field == "network" and drag.crowd == "none" and drag.inertia != "none":
        yield (
            f"drag.inertia: {drag.inertia!r} with drag.field 'network' is part of the law of the "
            "crowd; set drag.crowd = 'beetstra', or drag.inertia = 'none'"
        )
