"""Deposits of a mud as size classes: concentrations that a pore network carries and holds back."""
