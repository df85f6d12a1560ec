"""docs/tracks.md lists the catalogue as it is."""

from .track_table import PAGE, replaced


def test_the_table_of_tracks_is_up_to_date():
    assert PAGE.read_text() == replaced(PAGE.read_text()), "run python -m tests.docs.track_table"
