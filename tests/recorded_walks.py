"""Files of sound measured walks, as the fixture `measured_recording` takes them: markers and forces."""

WALKS = {
    "gait2354": ("gait2354/subject01_walk1.trc", "gait2354/subject01_walk1_grf.mot"),
    "rajagopal": ("rajagopal_walk/motion_capture_walk.trc", "rajagopal_walk/grf_walk.mot"),
    "plug-in gait a": ("pig_c3d/subject_a_walk.c3d", None),
    "plug-in gait b": ("pig_c3d/subject_b_walk.c3d", None),
}
