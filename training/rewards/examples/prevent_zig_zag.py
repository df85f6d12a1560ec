CALM_STEERING = 15  # degrees; more than this costs something


def reward_function(params):
    """Follow the centre line, and do it with a calm hand."""
    share = params["distance_from_center"] / params["track_width"]
    reward = 1e-3
    for limit, value in ((0.1, 1.0), (0.25, 0.5), (0.5, 0.1)):
        if share <= limit:
            reward = value
            break

    if abs(params["steering_angle"]) > CALM_STEERING:
        reward *= 0.8

    return float(reward)
