import math


def reward_function(params):
    """Stay on the road, and keep away from whatever stands or drives ahead in the same lane."""
    to_border = params["track_width"] / 2 - params["distance_from_center"]
    on_road = 1.0 if params["all_wheels_on_track"] and to_border >= 0.05 else 1e-3

    clear = 1.0
    if params["objects_location"]:
        ahead = params["closest_objects"][1]
        if params["objects_left_of_center"][ahead] == params["is_left_of_center"]:
            x, y = params["objects_location"][ahead]
            distance = math.hypot(x - params["x"], y - params["y"])
            if distance < 0.3:
                clear = 1e-3
            elif distance < 0.5:
                clear = 0.2
            elif distance < 0.8:
                clear = 0.5
    if params["is_crashed"]:
        clear = 1e-3

    # Not to crash matters four times as much as to stay on the road.
    return float(1.0 * on_road + 4.0 * clear)
