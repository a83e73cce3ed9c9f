"""What must hold between the table [contact] and the materials of a case."""

from collections.abc import Callable, Iterator

from fdnet.case.contact import DEEPEST_DAMPING, ContactLaw
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
