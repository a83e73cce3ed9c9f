"""fdnet: formation damage from the grains up.

    case = read_case(path)                       what the specimen is (TOML)
    scales = scales_of(case)                     what follows in closed form
    pack = make_pack(case, scales, ...)          LIGGGHTS: small spheres grown to a dense pack
    invasion = invade(case, scales, ...)         LIGGGHTS: fines driven in under Stokes drag until plugged
    analysis = analyse(grains, damaged, ...)     two-scale pore network: permeability before and after, by depth
    run_case(case, options)                      all of it in a run folder, with tables, figures and a report

Nouns: Case, Scales, Deck, Run, Snapshot, Network, Occupancy, Flow, Analysis. Each lives in the module of its stage;
importing `fdnet` itself loads nothing heavy.
"""
