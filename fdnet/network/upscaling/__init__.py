"""Conductance of throats between grains by the flow through the fines in them.

The words here: a *cell* is a polyhedron of the tessellation of the grains, a *pore* one of the
tessellation of grains and fines, a *facet* what separates two cells, a *link* a throat between
two pores.
"""
