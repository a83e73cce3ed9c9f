"""What must hold between the table [contact] and the materials of a case."""

from collections.abc import Callable, Iterator

from fdnet.case.contact import DEEPEST_DAMPING, ContactLaw
from fdnet.case.particles import Fines, Grains
from fdnet.case.spheres import Spheres


def of_the_model(name: str) -> Callable[[ContactLaw, Spheres], Iterator[str]]:
    """A check that the contact model takes what the table `name` ("grains", "fines") gives."""

    def check(contact: ContactLaw, spheres: Spheres) -> Iterator[str]:
        unread = sorted(contact.other_keys & spheres.model_fields_set)
        if unread:
            keys = ", ".join(f"{name}.{key}" for key in unread)
            yield (
                f"{keys}: not read by contact.model {contact.model!r}; leave out, or choose the "
                "other contact.model"
            )
        if contact.model == "hertz" and spheres.damping_ratio > DEEPEST_DAMPING:
            yield (
                f"{name}.damping_ratio: {spheres.damping_ratio:g} with contact.model 'hertz', "
                f"expected at most {DEEPEST_DAMPING:g} (LIGGGHTS takes a restitution above 0.05)"
            )

    return check


def of_cohesion(contact: ContactLaw) -> Iterator[str]:
    """Cohesion has something to act against."""
    if contact.cohesion_J_m3 is not None and contact.model == "hooke":
        yield (
            f"contact.cohesion_J_m3: {contact.cohesion_J_m3:g} with contact.model 'hooke': the "
            "attraction of LIGGGHTS's SJKR grows with the overlap as a linear spring does, so it "
            "would only soften the contact and never pull; take contact.model = 'hertz'"
        )


def of_rolling(contact: ContactLaw, grains: Grains, fines: Fines) -> Iterator[str]:
    """Rolling friction has sliding friction that makes fines roll."""
    least = min(grains.friction, fines.friction)
    if contact.rolling_friction is not None and least == 0:
        yield (
            f"contact.rolling_friction: {contact.rolling_friction:g} without friction "
            "(grains.friction or fines.friction is 0): spheres that slide do not roll; give both "
            "a friction, or leave contact.rolling_friction out"
        )
