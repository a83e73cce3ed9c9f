"""The specimens of the Stokes truth whose deposits LIGGGHTS makes.

Every specimen is a run of fdnet's own chain: a pack in a box whose sides are periodic, then an
invasion under a uniform drag, or by a flow that follows the deposit. The seeds are those of the
specimens, so that a specimen is made again by one command (docs/stokes.md).
"""

from dataclasses import dataclass

from fdnet.case.case import Case
from fdnet.case.file import case_from

BOX_MM = (2.5, 1.2, 1.2)
DARCY_LENGTH_MM = 8.0
SECTIONS = 5
GRAIN_RANGE = [0.2, 0.3]
UNIFORM = {"upstream": "interstitial", "pressure_gradient": False}
FOLLOWED = {
    "field": "network",
    "update_travel": 0.5,
    "upstream": "darcy",
    "crowd": "beetstra",
    "pressure_gradient": True,
    "scheme": "implicit",
}
STIFF = {"stiffness_N_m": 1e5}
Radius = float | list[float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Specimen:
    """What the case of a specimen says; the rest of it is the same for all.

    Attributes:
        seed: of the case.
        fine_mm: radius of the fines, or smallest and largest, mm.
        supplied: number of fines.
        friction: of grains and fines.
        pack: porosity of the grains, or their number where no whole number of grains meets the
            porosity within fdnet's bound of 0.003.
        grain_mm: radius of the grains, or smallest and largest, mm.
        followed: whether the flow follows the deposit (`drag.field = "network"`), with contacts
            ten times as stiff, so that its larger forces press no fine far into another.
    """

    seed: int
    fine_mm: Radius
    supplied: int
    friction: float
    pack: float | int
    grain_mm: Radius = 0.25
    followed: bool = False

    def case(self, name: str) -> Case:
        """The case of the specimen, with the default of every key that is not named here."""
        grains = {"radius_mm": self.grain_mm, "friction": self.friction}
        grains["count" if isinstance(self.pack, int) else "porosity"] = self.pack
        return case_from(
            {
                "name": name,
                "seed": self.seed,
                "box": {"size_mm": list(BOX_MM), "sides": "periodic", "wall_friction": 0.0},
                "grains": grains,
                "fines": {
                    "radius_mm": self.fine_mm,
                    "count": self.supplied,
                    "supply": "slab",
                    "friction": self.friction,
                },
                "fluid": {"darcy_length_mm": DARCY_LENGTH_MM},
                "drag": FOLLOWED if self.followed else UNIFORM,
                "run": {"time_step_factor": 0.1} | (STIFF if self.followed else {}),
                "analysis": {"sections": SECTIONS},
            }
        )


SPECIMENS = {
    "slabA_r5": Specimen(seed=211, fine_mm=0.05, supplied=220, friction=0.55, pack=0.40),
    "slabB_r5_cake": Specimen(seed=212, fine_mm=0.05, supplied=700, friction=0.55, pack=35),
    "slabC_r5_mu0_cake": Specimen(seed=213, fine_mm=0.05, supplied=700, friction=0.0, pack=0.40),
    "slabD_r5_range_mu0": Specimen(
        seed=214, fine_mm=[0.04, 0.06], supplied=220, friction=0.0, pack=0.33
    ),
    "slabE_r3": Specimen(seed=215, fine_mm=0.0833, supplied=60, friction=0.55, pack=30),
    "slabF_r3_mu0_cake": Specimen(seed=216, fine_mm=0.0833, supplied=150, friction=0.0, pack=0.38),
    "slabG_r3_range_cake": Specimen(
        seed=217, fine_mm=[0.07, 0.095], supplied=150, friction=0.55, pack=38
    ),
    "slabH_r8_cake": Specimen(seed=218, fine_mm=0.03125, supplied=2400, friction=0.55, pack=35),
    "slabI_r8_mu0": Specimen(seed=219, fine_mm=0.03125, supplied=2500, friction=0.0, pack=38),
    "slabJ_r8_ranges": Specimen(
        seed=220,
        fine_mm=[0.025, 0.0375],
        supplied=900,
        friction=0.55,
        pack=0.40,
        grain_mm=GRAIN_RANGE,
    ),
    "slabK_r10_cake": Specimen(seed=221, fine_mm=0.025, supplied=3500, friction=0.55, pack=36),
    "slabL_r10": Specimen(seed=222, fine_mm=0.025, supplied=2500, friction=0.55, pack=31),
    "slabP_r10": Specimen(seed=226, fine_mm=0.025, supplied=1500, friction=0.55, pack=36),
    "slabM_r5_ranges_cake": Specimen(
        seed=223,
        fine_mm=[0.035, 0.065],
        supplied=700,
        friction=0.55,
        pack=0.40,
        grain_mm=GRAIN_RANGE,
    ),
    "slabN_r3_mu0": Specimen(seed=224, fine_mm=0.0833, supplied=30, friction=0.0, pack=0.35),
    "slabO_r5_light": Specimen(seed=225, fine_mm=0.05, supplied=60, friction=0.55, pack=30),
    "slabQ_r5_mu0_light": Specimen(seed=231, fine_mm=0.05, supplied=120, friction=0.0, pack=31),
    "slabR_r8": Specimen(seed=232, fine_mm=0.03125, supplied=900, friction=0.55, pack=33),
    "slabS_r10_mu0_light": Specimen(seed=233, fine_mm=0.025, supplied=2000, friction=0.0, pack=37),
    "slabT_r8_cake": Specimen(seed=234, fine_mm=0.03125, supplied=1900, friction=0.55, pack=34),
    "slabU_r10_range_cake": Specimen(
        seed=235, fine_mm=[0.022, 0.03], supplied=2500, friction=0.55, pack=0.38
    ),
    "slabV_r5_ranges_cake": Specimen(
        seed=236,
        fine_mm=[0.04, 0.06],
        supplied=300,
        friction=0.55,
        pack=0.36,
        grain_mm=GRAIN_RANGE,
    ),
    "slabW_r8_light": Specimen(seed=301, fine_mm=0.03125, supplied=700, friction=0.55, pack=34),
    "slabX_r10": Specimen(seed=302, fine_mm=0.025, supplied=1800, friction=0.55, pack=35),
    "slabY_r5_mu0": Specimen(seed=303, fine_mm=0.05, supplied=180, friction=0.0, pack=33),
    "slabZ_r3": Specimen(seed=304, fine_mm=0.0833, supplied=40, friction=0.55, pack=36),
    "slabAA_r8_mu0": Specimen(seed=305, fine_mm=0.03125, supplied=2000, friction=0.0, pack=36),
    "slabAC_r5_followed": Specimen(
        seed=307, fine_mm=0.05, supplied=400, friction=0.55, pack=0.40, followed=True
    ),
    "slabAD_r8_cake": Specimen(seed=308, fine_mm=0.03125, supplied=1700, friction=0.55, pack=32),
    "slabAE_r8_cake": Specimen(seed=309, fine_mm=0.03125, supplied=2400, friction=0.55, pack=0.38),
    "slabAF_r5_followed_cake": Specimen(
        seed=310, fine_mm=0.05, supplied=700, friction=0.55, pack=34, followed=True
    ),
    "slabAG_r3_range_followed_cake": Specimen(
        seed=311, fine_mm=[0.07, 0.095], supplied=150, friction=0.55, pack=36, followed=True
    ),
    "slabAH_r8": Specimen(seed=312, fine_mm=0.03125, supplied=1200, friction=0.55, pack=33),
    "slabAI_r10": Specimen(seed=313, fine_mm=0.025, supplied=2000, friction=0.55, pack=34),
    "slabAJ_r5": Specimen(seed=314, fine_mm=0.05, supplied=160, friction=0.55, pack=35),
    "slabAK_r4": Specimen(seed=315, fine_mm=0.0625, supplied=130, friction=0.55, pack=34),
    "slabAL_r4_mu0_cake": Specimen(
        seed=316, fine_mm=0.0625, supplied=350, friction=0.0, pack=0.38
    ),
    "slabAM_r8_ranges": Specimen(
        seed=317,
        fine_mm=[0.025, 0.0375],
        supplied=1200,
        friction=0.3,
        pack=32,
        grain_mm=GRAIN_RANGE,
    ),
    "slabAN_r6": Specimen(seed=318, fine_mm=0.04167, supplied=350, friction=0.55, pack=0.40),
    "slabAO_r8_followed": Specimen(
        seed=319, fine_mm=0.03125, supplied=1200, friction=0.55, pack=34, followed=True
    ),
    "slabAP_r3": Specimen(seed=320, fine_mm=0.0833, supplied=60, friction=0.55, pack=36),
    "slabAQ_r5_mu0": Specimen(seed=321, fine_mm=0.05, supplied=280, friction=0.0, pack=34),
    "slabAR_r10_mu0": Specimen(seed=322, fine_mm=0.025, supplied=3000, friction=0.0, pack=37),
    "slabAS_r8": Specimen(seed=323, fine_mm=0.03125, supplied=1500, friction=0.55, pack=35),
    "slabAT_r10": Specimen(seed=324, fine_mm=0.025, supplied=1600, friction=0.55, pack=36),
    "slabAU_r5": Specimen(seed=325, fine_mm=0.05, supplied=200, friction=0.55, pack=34),
    "slabAV_r5_range": Specimen(
        seed=326, fine_mm=[0.04, 0.06], supplied=300, friction=0.55, pack=37
    ),
    "slabAW_r3": Specimen(seed=327, fine_mm=0.0833, supplied=70, friction=0.55, pack=34),
    "slabAX_r8_mu0": Specimen(seed=328, fine_mm=0.03125, supplied=1800, friction=0.0, pack=38),
    "slabAY_r6": Specimen(seed=329, fine_mm=0.04167, supplied=500, friction=0.55, pack=35),
    "slabAZ_r10_followed": Specimen(
        seed=330, fine_mm=0.025, supplied=1500, friction=0.55, pack=35, followed=True
    ),
    "slabBA_r5_followed": Specimen(
        seed=331, fine_mm=0.05, supplied=300, friction=0.55, pack=36, followed=True
    ),
    "slabBB_r3_range_mu0": Specimen(
        seed=332, fine_mm=[0.07, 0.095], supplied=100, friction=0.0, pack=33
    ),
    "slabBC_r8_ranges": Specimen(
        seed=333,
        fine_mm=[0.025, 0.0375],
        supplied=1000,
        friction=0.55,
        pack=32,
        grain_mm=GRAIN_RANGE,
    ),
    "slabBD_r4": Specimen(seed=334, fine_mm=0.0625, supplied=250, friction=0.55, pack=38),
    "slabBE_r8": Specimen(seed=341, fine_mm=0.03125, supplied=1400, friction=0.55, pack=34),
    "slabBF_r10": Specimen(seed=342, fine_mm=0.025, supplied=1700, friction=0.55, pack=35),
    "slabBG_r5": Specimen(seed=343, fine_mm=0.05, supplied=240, friction=0.55, pack=36),
    "slabBH_r5_range": Specimen(
        seed=344, fine_mm=[0.04, 0.06], supplied=260, friction=0.55, pack=33
    ),
    "slabBI_r3": Specimen(seed=345, fine_mm=0.0833, supplied=60, friction=0.55, pack=37),
    "slabBJ_r8_mu0": Specimen(seed=353, fine_mm=0.03125, supplied=2500, friction=0.0, pack=39),
    "slabBK_r6": Specimen(seed=347, fine_mm=0.04167, supplied=420, friction=0.55, pack=34),
    "slabBL_r10_followed": Specimen(
        seed=348, fine_mm=0.025, supplied=1600, friction=0.55, pack=36, followed=True
    ),
    "slabBM_r5_followed": Specimen(
        seed=349, fine_mm=0.05, supplied=260, friction=0.55, pack=34, followed=True
    ),
    "slabBN_r3_range_mu0": Specimen(
        seed=350, fine_mm=[0.07, 0.095], supplied=80, friction=0.0, pack=36
    ),
    "slabBO_r8_ranges": Specimen(
        seed=351,
        fine_mm=[0.025, 0.0375],
        supplied=1100,
        friction=0.3,
        pack=33,
        grain_mm=GRAIN_RANGE,
    ),
    "slabBP_r4": Specimen(seed=352, fine_mm=0.0625, supplied=200, friction=0.55, pack=35),
    "slabBQ_r5_followed": Specimen(
        seed=354, fine_mm=0.05, supplied=260, friction=0.55, pack=35, followed=True
    ),
    "slabBR_r8": Specimen(seed=355, fine_mm=0.03125, supplied=1000, friction=0.55, pack=36),
    "slabBS_r8_ranges": Specimen(
        seed=356,
        fine_mm=[0.025, 0.0375],
        supplied=1000,
        friction=0.55,
        pack=34,
        grain_mm=GRAIN_RANGE,
    ),
    "slabBT_r10": Specimen(seed=357, fine_mm=0.025, supplied=1200, friction=0.55, pack=34),
    "slabBU_r6": Specimen(seed=358, fine_mm=0.04167, supplied=350, friction=0.55, pack=36),
    "slabBV_r5_range": Specimen(
        seed=359, fine_mm=[0.04, 0.06], supplied=220, friction=0.3, pack=35
    ),
    "slabBW_r3": Specimen(seed=360, fine_mm=0.0833, supplied=70, friction=0.55, pack=35),
    "slabBX_r8_followed": Specimen(
        seed=361, fine_mm=0.03125, supplied=1000, friction=0.55, pack=35, followed=True
    ),
    "slabBY_r5_mu0": Specimen(seed=362, fine_mm=0.05, supplied=200, friction=0.0, pack=37),
    "slabBZ_r4": Specimen(seed=363, fine_mm=0.0625, supplied=160, friction=0.55, pack=34),
    "slabCA_r5": Specimen(seed=371, fine_mm=0.05, supplied=230, friction=0.55, pack=35),
    "slabCB_r8": Specimen(seed=372, fine_mm=0.03125, supplied=900, friction=0.3, pack=35),
    "slabCC_r10": Specimen(seed=373, fine_mm=0.025, supplied=1300, friction=0.55, pack=36),
    "slabCD_r5_followed": Specimen(
        seed=374, fine_mm=0.05, supplied=250, friction=0.55, pack=36, followed=True
    ),
    "slabCE_r8_followed": Specimen(
        seed=375, fine_mm=0.03125, supplied=900, friction=0.55, pack=34, followed=True
    ),
    "slabCF_r6": Specimen(seed=376, fine_mm=0.04167, supplied=330, friction=0.55, pack=35),
    "slabCG_r8_ranges": Specimen(
        seed=377,
        fine_mm=[0.025, 0.0375],
        supplied=1100,
        friction=0.55,
        pack=33,
        grain_mm=GRAIN_RANGE,
    ),
    "slabCH_r5_range": Specimen(
        seed=378, fine_mm=[0.04, 0.06], supplied=250, friction=0.55, pack=34
    ),
    "slabCI_r3": Specimen(seed=379, fine_mm=0.0833, supplied=65, friction=0.55, pack=36),
    "slabCJ_r4": Specimen(seed=380, fine_mm=0.0625, supplied=180, friction=0.55, pack=36),
    "slabCK_r8_mu0": Specimen(seed=381, fine_mm=0.03125, supplied=2000, friction=0.0, pack=38),
    "slabCL_r10": Specimen(seed=382, fine_mm=0.025, supplied=1000, friction=0.55, pack=35),
    "slabDA_r5": Specimen(seed=391, fine_mm=0.05, supplied=260, friction=0.55, pack=36),
    "slabDB_r8": Specimen(seed=392, fine_mm=0.03125, supplied=800, friction=0.55, pack=34),
    "slabDC_r10": Specimen(seed=393, fine_mm=0.025, supplied=1200, friction=0.3, pack=35),
    "slabDD_r5_followed": Specimen(
        seed=394, fine_mm=0.05, supplied=220, friction=0.55, pack=34, followed=True
    ),
    "slabDE_r8_followed": Specimen(
        seed=395, fine_mm=0.03125, supplied=1000, friction=0.55, pack=35, followed=True
    ),
    "slabDF_r6": Specimen(seed=396, fine_mm=0.04167, supplied=300, friction=0.55, pack=36),
    "slabDG_r8_ranges": Specimen(
        seed=397,
        fine_mm=[0.025, 0.0375],
        supplied=900,
        friction=0.55,
        pack=34,
        grain_mm=GRAIN_RANGE,
    ),
    "slabDH_r5_range": Specimen(
        seed=398, fine_mm=[0.04, 0.06], supplied=220, friction=0.55, pack=36
    ),
    "slabDI_r3": Specimen(seed=399, fine_mm=0.0833, supplied=75, friction=0.55, pack=35),
    "slabDJ_r4": Specimen(seed=400, fine_mm=0.0625, supplied=150, friction=0.55, pack=35),
    "slabDK_r8_mu0": Specimen(seed=401, fine_mm=0.03125, supplied=1600, friction=0.0, pack=37),
    "slabDL_r10": Specimen(seed=402, fine_mm=0.025, supplied=900, friction=0.55, pack=36),
    "slabDM_r3_range_mu0": Specimen(
        seed=403, fine_mm=[0.07, 0.095], supplied=75, friction=0.0, pack=37
    ),
    "slabDN_r6_cake": Specimen(seed=404, fine_mm=0.04167, supplied=900, friction=0.55, pack=34),
}
"""The specimens by name: r5 are fines of a fifth of a grain, mu0 is no friction, a range is one of
radii (ranges: of grains too), a cake remains upstream of the face; followed: by the flow."""
