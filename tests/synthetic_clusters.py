"""The synthetic laboratory's person with the markers of Rajagopal's set: clusters on thighs and shanks, markers on both
sides of knees, ankles and elbows, and two at the back of the pelvis.
"""

from dataclasses import replace

import numpy as np

from kinertia.io.marker_set_file import read_marker_set
from kinertia.model.skeleton import Marker, Skeleton
from kinertia.motion.inverse_kinematics import solve_ik
from kinertia.synthetic.walk import SyntheticSubject
from kinertia.trial.data import Markers, Recording

STATIC_ONLY = tuple(f"{side}.M{joint}" for side in "RL" for joint in ("Knee", "Ankle"))
"""Taken off after the static trial."""
_AS_BEFORE = {
    "Shoulder": "Acromium",
    "Biceps": "Bicep",
    "Elbow": "Elbow",
    "Wrist": "Wrist.Lat",
    "ASIS": "ASIS",
    "TH1": "Thigh.Upper",
    "TH2": "Thigh.Front",
    "TH3": "Thigh.Rear",
    "Knee": "Knee.Lat",
    "MKnee": "Knee.Med",
    "SH1": "Shank.Upper",
    "SH2": "Shank.Front",
    "SH3": "Shank.Rear",
    "Ankle": "Ankle.Lat",
    "MAnkle": "Ankle.Med",
    "Heel": "Heel",
    "MT5": "Toe.Lat",
    "Toe": "Toe.Tip",
}
"""Where the Cleveland Clinic has one, too."""


def with_clusters(person: SyntheticSubject) -> SyntheticSubject:
    """The same person with these markers."""
    markers = person.static.markers
    q = solve_ik(person.skeleton, markers).q[:1]
    skeleton = person.skeleton.with_markers(_clusters(person.skeleton))
    places = np.repeat(skeleton.marker_positions(skeleton.pose(q)), len(markers.time), axis=0)
    static = Recording("static", Markers(markers.time, skeleton.labels, places))
    return replace(person, static=static, skeleton=skeleton, marker_set=read_marker_set("rajagopal"))


def _clusters(skeleton: Skeleton) -> list[Marker]:
    """Where the set's markers are on the segments (m; X forward, Y up, Z right), by those of the Cleveland Clinic."""
    known = {marker.label: marker for marker in skeleton.markers}

    def beside(label: str, other: str, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Marker:
        return Marker(label, known[other].segment, known[other].position + np.array([x, y, z]))

    markers = [
        beside("S2", "V.Sacral", x=-0.01, y=-0.03),
        beside("R.SH4", "R.Shank.Rear", y=-0.06),
        beside("L.TH4", "L.Thigh.Upper", y=-0.06),
    ]
    for side, sign in (("R", 1.0), ("L", -1.0)):
        markers += [beside(f"{side}.{label}", f"{side}.{other}") for label, other in _AS_BEFORE.items()]
        markers += [
            beside(f"{side}.Clavicle", "Sternum", y=0.02, z=0.03 * sign),
            beside(f"{side}.MElbow", f"{side}.Elbow", z=-0.07 * sign),
            beside(f"{side}.Forearm", f"{side}.Wrist.Lat", y=0.1),
            beside(f"{side}.PSIS", "V.Sacral", z=0.045 * sign),
        ]
    return markers
