"""The force on each fine: carried along, standing in the pack, or part of the cake."""

from dataclasses import dataclass

import numpy as np

from fdnet.spheres.snapshot import Array, Snapshot


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Deposit:
    """The fines (N) that stand.

    Attributes:
        held: (N,) which stand in the pack.
        pressed: (N, 3) N, what the network's pressure does to them; also to fines of the cake that
            reach into the pack; 0 for all others.
    """

    held: Array
    pressed: Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FineForces:
    """The force C (u - v) + P on each fine (N) of velocity v.

    Attributes:
        coefficient: (N,) N s/m, C.
        velocity: (N, 3) m/s, u.
        push: (N, 3) N, P.
        held: (N,) which stand in the pack.
        pressed: (N, 3) N, of `Deposit`.
        crowd_drag: N, along x, what the law of the crowd would do to those that stand in the pack.
    """

    coefficient: Array
    velocity: Array
    push: Array
    held: Array
    pressed: Array
    crowd_drag: float


def forces_on(
    fines: Snapshot,
    deposit: Deposit,
    *,
    crowd: Array,
    lone: Array,
    carried: Array,
    intact: Array,
    push: Array,
    pace: float,
) -> FineForces:
    """The forces on `fines`.

    A fine that stands in the pack feels what the network's pressure does to it. When it comes
    loose its throat opens, so it is not pushed on by all that force, but goes on with the flow of
    the intact pack: C = F / u, with u the larger of the velocity there and the superficial one,
    and at least the coefficient of a lone fine.

    Args:
        fines: N of them.
        deposit: what stands.
        crowd: (N,) N s/m, coefficients by the law of the crowd.
        lone: (N,) N s/m, of a lone fine.
        carried: (N, 3) m/s, velocity of the fluid at each fine.
        intact: (N, 3) m/s, that of the intact pack at the same rate.
        push: (N, 3) N, by the gradient of the grains alone.
        pace: superficial velocity, m/s.
    """
    held, pressed = deposit.held, deposit.pressed
    force = np.linalg.norm(pressed, axis=1)
    speed = np.maximum(np.linalg.norm(intact, axis=1), pace)
    loose = np.divide(force, speed, out=np.zeros_like(force), where=speed > 0)
    coefficient = np.where(held, np.maximum(loose, lone), crowd)
    at_rest = pressed / coefficient[:, None]
    return FineForces(
        coefficient=coefficient,
        velocity=np.where(held[:, None], at_rest, carried),
        push=push + np.where(held[:, None], 0.0, pressed),
        held=held,
        pressed=pressed,
        crowd_drag=float(crowd[held] @ carried[held, 0]),
    )
