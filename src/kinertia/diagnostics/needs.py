"""Names what checks need, by the codes whose ERROR says that it is not there: without it a check means nothing."""

LENGTH_UNIT = ("M141",)
"""In another unit of length no limit in metres means anything."""
AXES = ("M141", "M142")
"""Without a vertical and a unit of length, nothing is above or beside anything."""
MEASURED_FRAMES = ("M123",)
"""Where frames were interpolated, steps from frame to frame mean nothing."""
VERTICAL_FORCE = ("P201",)
"""In other axes there is no vertical force to judge by."""
LOADS_UNDER_FEET = ("P201", "P202", "P203", "P204", "P24", "T20", "T21")
"""Else it is not known where on a foot a load acts."""
VELOCITY = ("L20", "M12", "M14", "P10", "P11", "P20", "P24", "T201", "T211", "T212")
"""Else markers, forces or their times do not belong to one moving body."""
