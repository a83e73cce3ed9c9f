"""The slabs that are cut from the specimens which LIGGGHTS makes, for the Stokes truth."""

from collections.abc import Sequence
from pathlib import Path

from fdnet.run.open_run import run_case
from fdnet.studies.truth.slabs import LATER, YES, Slab, write_specimen
from fdnet.studies.truth.specimens import SPECIMENS

COARSE, MIDDLE, FINE = (60, 72, 96), (72, 96, 120), (84, 96, 120)
FINEST, BEYOND = (96, 120, 144), (144, 192, 240)
"""Cells on the edge of 1.2 mm. Two more heavy deposits of fine fines are solved at 144 too. Those
of `BEYOND` were solved on `FINEST` before, and the three finest of their grids count."""
FACE, TWICE, DEEP = (0.0, 0.5), (0.0, 1.0), (0.5, 1.0)
"""Where slabs begin and end, mm from the face."""
CUTS: tuple[tuple[str, tuple[float, float], tuple[int, ...], str], ...] = (
    ("slabA_r5", FACE, MIDDLE, YES),
    ("slabA_r5", DEEP, MIDDLE, YES),
    ("slabB_r5_cake", FACE, MIDDLE, YES),
    ("slabC_r5_mu0_cake", TWICE, COARSE, YES),
    ("slabD_r5_range_mu0", FACE, MIDDLE, YES),
    ("slabE_r3", FACE, COARSE, YES),
    ("slabF_r3_mu0_cake", FACE, MIDDLE, YES),
    ("slabG_r3_range_cake", FACE, COARSE, YES),
    ("slabH_r8_cake", FACE, MIDDLE, YES),
    ("slabI_r8_mu0", FACE, FINE, YES),
    ("slabJ_r8_ranges", FACE, MIDDLE, YES),
    ("slabK_r10_cake", FACE, FINE, YES),
    ("slabK_r10_cake", DEEP, FINE, YES),
    ("slabL_r10", FACE, FINE, YES),
    ("slabP_r10", FACE, FINE, YES),
    ("slabM_r5_ranges_cake", FACE, MIDDLE, YES),
    ("slabN_r3_mu0", TWICE, COARSE, YES),
    ("slabO_r5_light", FACE, MIDDLE, YES),
    ("slabQ_r5_mu0_light", TWICE, COARSE, YES),
    ("slabR_r8", FACE, MIDDLE, YES),
    ("slabS_r10_mu0_light", TWICE, FINE, YES),
    ("slabT_r8_cake", FACE, FINEST, YES),
    ("slabT_r8_cake", DEEP, FINE, YES),
    ("slabU_r10_range_cake", FACE, FINEST, YES),
    ("slabU_r10_range_cake", DEEP, FINE, YES),
    ("slabV_r5_ranges_cake", FACE, MIDDLE, YES),
    ("slabW_r8_light", FACE, FINE, YES),
    ("slabX_r10", FACE, FINEST, YES),
    ("slabY_r5_mu0", FACE, MIDDLE, YES),
    ("slabZ_r3", TWICE, MIDDLE, YES),
    ("slabAA_r8_mu0", FACE, FINE, YES),
    ("slabAC_r5_followed", TWICE, MIDDLE, YES),
    ("slabAD_r8_cake", FACE, FINEST, YES),
    ("slabAD_r8_cake", DEEP, FINE, YES),
    ("slabAE_r8_cake", FACE, FINEST, YES),
    ("slabAF_r5_followed_cake", FACE, MIDDLE, YES),
    ("slabAG_r3_range_followed_cake", FACE, MIDDLE, YES),
    ("slabAH_r8", FACE, FINEST, YES),
    ("slabAH_r8", DEEP, FINE, YES),
    ("slabAI_r10", FACE, FINEST, YES),
    ("slabAJ_r5", FACE, MIDDLE, YES),
    ("slabAK_r4", FACE, MIDDLE, YES),
    ("slabAL_r4_mu0_cake", TWICE, MIDDLE, YES),
    ("slabAM_r8_ranges", FACE, FINEST, YES),
    ("slabAN_r6", TWICE, MIDDLE, YES),
    ("slabAO_r8_followed", FACE, FINEST, YES),
    ("slabAP_r3", TWICE, MIDDLE, YES),
    ("slabAQ_r5_mu0", TWICE, MIDDLE, YES),
    ("slabAR_r10_mu0", FACE, FINEST, YES),
    ("slabAS_r8", FACE, FINEST, YES),
    ("slabAS_r8", DEEP, FINE, YES),
    ("slabAT_r10", FACE, FINEST, YES),
    ("slabAU_r5", FACE, MIDDLE, YES),
    ("slabAV_r5_range", TWICE, MIDDLE, YES),
    ("slabAW_r3", TWICE, MIDDLE, YES),
    ("slabAX_r8_mu0", FACE, FINEST, YES),
    ("slabAY_r6", FACE, MIDDLE, YES),
    ("slabAZ_r10_followed", FACE, FINEST, YES),
    ("slabBA_r5_followed", FACE, MIDDLE, YES),
    ("slabBB_r3_range_mu0", TWICE, MIDDLE, YES),
    ("slabBC_r8_ranges", FACE, FINEST, YES),
    ("slabBD_r4", TWICE, MIDDLE, YES),
    ("slabBE_r8", FACE, FINEST, YES),
    ("slabBE_r8", DEEP, FINE, YES),
    ("slabBF_r10", FACE, FINEST, YES),
    ("slabBG_r5", FACE, MIDDLE, YES),
    ("slabBH_r5_range", TWICE, MIDDLE, YES),
    ("slabBI_r3", TWICE, MIDDLE, YES),
    ("slabBJ_r8_mu0", FACE, FINEST, YES),
    ("slabBK_r6", FACE, MIDDLE, YES),
    ("slabBL_r10_followed", FACE, FINEST, YES),
    ("slabBM_r5_followed", FACE, MIDDLE, YES),
    ("slabBN_r3_range_mu0", TWICE, MIDDLE, YES),
    ("slabBO_r8_ranges", FACE, FINEST, YES),
    ("slabBP_r4", TWICE, MIDDLE, YES),
    ("slabBQ_r5_followed", FACE, MIDDLE, YES),
    ("slabBR_r8", FACE, FINEST, YES),
    ("slabBS_r8_ranges", FACE, FINEST, YES),
    ("slabBT_r10", FACE, FINEST, YES),
    ("slabBU_r6", FACE, MIDDLE, YES),
    ("slabBV_r5_range", TWICE, MIDDLE, YES),
    ("slabBW_r3", TWICE, MIDDLE, YES),
    ("slabBX_r8_followed", FACE, FINEST, YES),
    ("slabBY_r5_mu0", TWICE, MIDDLE, YES),
    ("slabBZ_r4", TWICE, MIDDLE, YES),
    ("slabCA_r5", FACE, MIDDLE, YES),
    ("slabCB_r8", FACE, FINEST, YES),
    ("slabCC_r10", FACE, BEYOND, YES),
    ("slabCD_r5_followed", FACE, MIDDLE, YES),
    ("slabCE_r8_followed", FACE, FINEST, YES),
    ("slabCF_r6", TWICE, MIDDLE, YES),
    ("slabCG_r8_ranges", FACE, FINEST, YES),
    ("slabCH_r5_range", TWICE, MIDDLE, YES),
    ("slabCI_r3", TWICE, MIDDLE, YES),
    ("slabCJ_r4", FACE, MIDDLE, YES),
    ("slabCK_r8_mu0", FACE, FINEST, YES),
    ("slabCL_r10", FACE, BEYOND, YES),
    ("slabDA_r5", FACE, MIDDLE, YES),
    ("slabDB_r8", FACE, FINEST, YES),
    ("slabDC_r10", FACE, BEYOND, YES),
    ("slabDD_r5_followed", FACE, MIDDLE, YES),
    ("slabDE_r8_followed", FACE, FINEST, YES),
    ("slabDF_r6", TWICE, MIDDLE, YES),
    ("slabDG_r8_ranges", FACE, FINEST, YES),
    ("slabDH_r5_range", TWICE, MIDDLE, YES),
    ("slabDI_r3", TWICE, MIDDLE, YES),
    ("slabDJ_r4", FACE, MIDDLE, YES),
    ("slabDK_r8_mu0", FACE, FINEST, YES),
    ("slabDL_r10", FACE, BEYOND, YES),
    ("slabDM_r3_range_mu0", TWICE, MIDDLE, YES),
    ("slabDN_r6_cake", FACE, MIDDLE, YES),
    ("slabEA_r5", FACE, MIDDLE, YES),
    ("slabEB_r8", FACE, FINEST, YES),
    ("slabEC_r10", FACE, FINEST, YES),
    ("slabED_r5_followed", FACE, MIDDLE, YES),
    ("slabEE_r8_followed", FACE, FINEST, YES),
    ("slabEF_r6", TWICE, MIDDLE, YES),
    ("slabEG_r8_ranges", FACE, FINEST, YES),
    ("slabEH_r5_range", TWICE, MIDDLE, YES),
    ("slabEI_r3", TWICE, MIDDLE, YES),
    ("slabEJ_r4", FACE, MIDDLE, YES),
    ("slabEK_r8_mu0", FACE, FINEST, YES),
    ("slabEL_r10", FACE, FINEST, YES),
    ("slabFA_r5", FACE, MIDDLE, YES),
    ("slabFB_r8", FACE, FINEST, YES),
    ("slabFC_r10", FACE, FINEST, YES),
    ("slabFD_r5_followed", FACE, MIDDLE, YES),
    ("slabFE_r8_followed", FACE, FINEST, YES),
    ("slabFF_r6", TWICE, MIDDLE, YES),
    ("slabFG_r8_ranges", FACE, FINEST, YES),
    ("slabFH_r5_range", TWICE, MIDDLE, YES),
    ("slabFI_r3", TWICE, MIDDLE, YES),
    ("slabFJ_r4", FACE, MIDDLE, YES),
    ("slabFK_r8_mu0", FACE, FINEST, YES),
    ("slabFL_r10", FACE, FINEST, YES),
    ("slabGA_r5", FACE, MIDDLE, LATER),
    ("slabGB_r8", FACE, FINEST, LATER),
    ("slabGC_r10", FACE, FINEST, LATER),
    ("slabGD_r5_followed", FACE, MIDDLE, LATER),
    ("slabGE_r8_followed", FACE, FINEST, LATER),
    ("slabGF_r6", TWICE, MIDDLE, LATER),
    ("slabGG_r8_ranges", FACE, FINEST, LATER),
    ("slabGH_r5_range", TWICE, MIDDLE, LATER),
    ("slabGI_r3", TWICE, MIDDLE, LATER),
    ("slabGJ_r4", FACE, MIDDLE, LATER),
    ("slabGK_r8_mu0", FACE, FINEST, LATER),
    ("slabGL_r10", FACE, FINEST, LATER),
    ("slabHA_r5", FACE, MIDDLE, LATER),
    ("slabHB_r8", FACE, FINEST, LATER),
    ("slabHC_r10", FACE, FINEST, LATER),
    ("slabHD_r5_followed", FACE, MIDDLE, LATER),
    ("slabHE_r8_followed", FACE, FINEST, LATER),
    ("slabHF_r6", TWICE, MIDDLE, LATER),
    ("slabHG_r8_ranges", FACE, FINEST, LATER),
    ("slabHH_r5_range", TWICE, MIDDLE, LATER),
    ("slabHI_r3", TWICE, MIDDLE, LATER),
    ("slabHJ_r4", FACE, MIDDLE, LATER),
    ("slabHK_r8_mu0", FACE, FINEST, LATER),
    ("slabHL_r10", FACE, FINEST, LATER),
)
"""Specimen, slab, grids, and whether its truth was known when the laws were shaped."""
SLABS = {
    slab.name: slab
    for slab in (
        Slab(
            name=name + ("_deep" if edges == DEEP else ""),
            specimen=name,
            x_lo_mm=edges[0],
            x_hi_mm=edges[1],
            cells=cells,
            known_before=known,
        )
        for name, edges, cells, known in CUTS
    )
}


def make_specimens(names: Sequence[str], runs: Path, folder: Path) -> None:
    """Lets LIGGGHTS make specimens and writes their files.

    Args:
        names: of `SPECIMENS`; all of them if empty.
        runs: where the run folders are; a finished run is not repeated.
        folder: of the files.
    """
    for name in names or SPECIMENS:
        specimen = SPECIMENS[name]
        run = run_case(specimen.case(name), runs / name, stages=("pack", "invade", "analyse"))
        spheres = run.spheres()
        write_specimen(folder / f"{name}.csv", spheres, f"made by LIGGGHTS, seed {specimen.seed}")
        summary = run.summary
        print(
            f"{name}: {len(spheres.grains())} grains, porosity "
            f"{summary['porosity_initial']:.4f}, {summary['invaded_count']} fines in it, "
            f"{summary['upstream_count']} upstream, {summary['passed_count']} passed",
            flush=True,
        )
