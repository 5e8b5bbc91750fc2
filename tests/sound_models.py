"""Files of OpenSim models, synthetic and of six laboratories, none of which has a known mistake."""

from recordings import here

MODELS = here(
    [
        "synthetic/scaled.osim",
        "gait2354/subject01_scaled.osim",
        "gait2354/gait2354_simbody.osim",
        "gait2354/opensim_results/rra_adjusted.osim",
        "rajagopal_walk/scaled.osim",
        "rajagopal_walk/Rajagopal2016.osim",
        "subject4/addbiomechanics_scaled.osim",
        "field/hamner_treadmill_run/final.osim",
        "field/hamner_run/subject02_registered.osim",
        "field/laiarnold6_walk/LaiArnoldModified2017_poly_withArms_weldHand_scaled.osim",
        "field/laiarnold5_jump/LaiArnoldModified2017_poly_withArms_weldHand_scaled.osim",
    ]
)
