import math

ALLOWED = 10  # degrees between the car's heading and the road's direction; more than this costs half


def reward_function(params):
    """Point the car where the road goes, and stay on it."""
    if not params["all_wheels_on_track"]:
        return 1e-3

    # The road's direction is that of the line from the waypoint just behind the car to the one just ahead.
    behind, ahead = (params["waypoints"][index] for index in params["closest_waypoints"])
    direction = math.degrees(math.atan2(ahead[1] - behind[1], ahead[0] - behind[0]))

    # Both are angles: 179 and -179 degrees are 2 degrees apart.
    apart = abs(params["heading"] - direction) % 360
    apart = min(apart, 360 - apart)

    reward = 1.0 - params["distance_from_center"] / params["track_width"]
    if apart > ALLOWED:
        reward *= 0.5
    return float(reward)
