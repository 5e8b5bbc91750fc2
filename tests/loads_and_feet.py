"""What is said of where loads and feet are."""

from kinertia.diagnostics.plates.load_places import LoadPlaces


def load_places_trouble(recording, feet):
    """Empty where nothing can be said, too."""
    places = LoadPlaces.of(recording, feet)
    return "" if places is None else places.trouble()


def load_places_doubts(recording, feet):
    """None where nothing can be said, too."""
    places = LoadPlaces.of(recording, feet)
    return [] if places is None else places.doubts()
