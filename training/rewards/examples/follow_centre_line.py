def reward_function(params):
    """Full marks near the centre line, less and less towards the borders."""
    share = params["distance_from_center"] / params["track_width"]

    if share <= 0.1:
        reward = 1.0
    elif share <= 0.25:
        reward = 0.5
    elif share <= 0.5:
        reward = 0.1
    else:
        reward = 1e-3  # almost off the road, or already

    return float(reward)
