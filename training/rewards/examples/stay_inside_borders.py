MARGIN = 0.05  # metres between the car and the border that count as safe


def reward_function(params):
    """The car may choose its own line, as long as all of it stays on the road."""
    to_border = params["track_width"] / 2 - params["distance_from_center"]
    safe = params["all_wheels_on_track"] and to_border >= MARGIN

    return 1.0 if safe else 1e-3
