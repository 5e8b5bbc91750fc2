"""What is not held against sound recordings: walking backwards, feet without a marker at heel or toes."""

from dataclasses import replace

import numpy as np
import pytest

from kinertia.diagnostics.doubts import trial_doubts
from kinertia.io.marker_set_file import choose_marker_set
from recordings import WALKS


@pytest.mark.parametrize("name", [name for name in WALKS if name in ("synthetic c3d", "plug-in gait b")])
def test_loads_that_begin_under_the_toes_of_somebody_who_walks_backwards(recording_of, name):
    """Played backwards, a walk obeys the same laws."""
    walk = recording_of(*WALKS[name])
    plates, markers = walk.plates, walk.markers
    then = markers.time[0] + markers.time[-1] - plates.time
    turned = {
        name: np.stack([np.interp(then, plates.time, one) for one in part.reshape(len(part), -1).T], axis=1).reshape(
            part.shape
        )
        for name, part in (("force", plates.force), ("moment", plates.moment))
    }
    backwards = replace(
        walk, markers=replace(markers, positions=markers.positions[::-1]), plates=replace(plates, **turned)
    )
    marker_set = choose_marker_set(markers.labels)
    feet = {side: [one for one in own if one in markers.labels] for side, own in marker_set.foot_labels().items()}
    assert trial_doubts(walk, marker_set, None, feet) == []
    assert trial_doubts(backwards, marker_set, None, feet) == []


@pytest.mark.parametrize("name", [name for name in WALKS if name in ("synthetic", "gait2354")])
@pytest.mark.parametrize("lost", ["Toe", "Heel"])
def test_feet_without_a_marker_at_one_end_do_not_tell_where_loads_belong(recording_of, lost, name):
    """Seen from the rest of the markers, loads begin or end off the foot; the plates are where they were."""
    walk = recording_of(*WALKS[name])
    marker_set = choose_marker_set(walk.markers.labels)
    kept = [label for label in walk.markers.labels if lost not in label]
    assert len(kept) < len(walk.markers.labels)
    feet = {side: [one for one in own if one in kept] for side, own in marker_set.foot_labels().items()}
    assert trial_doubts(replace(walk, markers=walk.markers.select(kept)), marker_set, None, feet) == []


def test_a_single_frame_is_no_motion(recording_of):
    walk = recording_of("synthetic/walk.trc")
    (doubt,) = trial_doubts(replace(walk, markers=walk.markers.cut(0.0, 0.0)), None, None, None)
    assert doubt.refused
    assert "a single frame shows no motion" in doubt.sentence
