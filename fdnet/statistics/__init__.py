"""Means, bands and differences over seeds: pure functions of numbers."""
