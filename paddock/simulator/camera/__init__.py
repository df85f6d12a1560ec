"""What a car's camera sees: the track's texture warped into perspective, walls and sky drawn over it."""
