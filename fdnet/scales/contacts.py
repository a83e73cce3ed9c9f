"""The contacts of a case by its contact model."""

from fdnet.case.case import Case
from fdnet.scales.hertz_contacts import hertz_contacts, hertz_factor
from fdnet.scales.springs import Contact, hooke_contacts, hooke_factor


def contacts_of(case: Case, velocity: float) -> dict[str, Contact]:
    """The contact of each pair of materials, by its name, in a fluid of a velocity in m/s."""
    contacts = hertz_contacts if case.contact.model == "hertz" else hooke_contacts
    return contacts(case, velocity)


def stiffness_factor(case: Case) -> float:
    """Factor from the materials' stiffness, or moduli, to those that are used."""
    return hertz_factor(case) if case.contact.model == "hertz" else hooke_factor(case)
