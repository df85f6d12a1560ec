"""Reference laps of tracks, and the medals that follow from them."""
