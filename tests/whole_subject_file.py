"""A subject file with everything, to be changed, and how tests read it."""

from kinertia.io.subject.reader import read_subject

GOOD = """\
[subject]
sex = "female"
mass_kg = 61.5
height_m = 1.68

[model]
static = "static.trc"
markers = "plug-in-gait"

[[trial]]
markers = "data/walk1.trc"
forces = "data/walk1.mot"   # comment
loads = "data/walk1.xml"
window_s = [0.4, 2]

[[trial]]
markers = "data/walk2.c3d"
name = "second"

[settings]
bsp = "deleva"
symmetry = false
cutoff_hz = 6
hip_centre = "harrington"
force_cutoff_hz = "none"
"""


def read(folder, text):
    (folder / "subject.toml").write_text(text, encoding="utf-8")
    return read_subject(folder / "subject.toml")


def changed(old, new):
    assert GOOD.count(old) == 1, old
    return GOOD.replace(old, new)
