"""Finds out whether feet are seen from heel to forefoot and land on the heel, as loads are expected to."""

from kinertia.diagnostics.context import RecordingContext
from kinertia.diagnostics.evidence.plate_contacts import PlateContact
from kinertia.diagnostics.evidence.shared_plates import FOOT_ENDS


def goes_forwards(context: RecordingContext) -> bool:
    """Return whether loads can be expected between heel and toe: whole feet are visible and the person does not walk
    backwards."""
    return context.shows_whole_feet and not context.walks_backwards


def heel_steps(context: RecordingContext) -> list[PlateContact]:
    """Return the loads that can be expected to progress from heel to toe: of one foot that does not land on its
    forefoot, in strides that do not go backwards."""
    if not context.has_strides or not goes_forwards(context):
        return []
    return [one for one in one_foot_loads(context) if not one.trajectory.lands_on_forefoot(one.start_s, one.end_s)]


def one_foot_loads(context: RecordingContext) -> list[PlateContact]:
    """Return the loads without those that both feet bear on one plate; if these seem to be most, the loads are at a
    wrong position instead, and count."""
    shared = {id(one.contact) for one in context.shared_loads}
    own = [one for one in context.contacts if id(one) not in shared]
    return own if 2 * len(own) >= len(context.contacts) else list(context.contacts)


def shows_feet_equally(context: RecordingContext) -> bool:
    """Return whether the same markers of both feet are visible: else their lines from heel to toe differ."""
    if context.marker_set is None:
        return False
    landmarks, seen = context.marker_set.landmarks, context.seen_labels
    right, left = (
        [len(seen.intersection(landmarks.get(f"{name}_{side}", ()))) for end in FOOT_ENDS for name in end]
        for side in "rl"
    )
    return right == left
