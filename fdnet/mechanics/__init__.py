"""The mechanics of a pack without time steps: contacts and bonds as springs.

import fdnet

result = fdnet.elastic_moduli(fdnet.read_spheres("pack.csv", units="mm"), case)
result.averaged.young, result.tensor         Pa, (6, 6) Pa
"""
