"""Conductances of throats, clean and among fines; `named` lists the laws by their names."""
