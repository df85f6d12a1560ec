SAFE = 0.2  # metres to the border that cost nothing: the slope towards it is what a beginner learns from

before = {"steps": 0, "metres": 0.0}


def reward_function(params):
    """As many metres of the track as possible in every step: that is what a fast lap is made of."""
    metres = params["progress"] / 100 * params["track_length"]
    goes_on = params["steps"] > before["steps"]  # otherwise another episode or lap has begun
    gained = metres - before["metres"] if goes_on else 0.0
    before["steps"], before["metres"] = params["steps"], metres

    if params["is_offtrack"] or params["is_crashed"]:
        return -1.0

    # Metres are counted on the centre line, so the inside of a bend is worth more than the outside: the car finds a
    # racing line by itself. Close to the border they count less, and nothing where wheels hang over it.
    to_border = params["track_width"] / 2 - params["distance_from_center"]
    room = min(max(to_border / SAFE, 0.0), 1.0) if params["all_wheels_on_track"] else 0.0

    # Small numbers: with ten times as much a car learns more slowly and keeps less of what it learned.
    return float(gained * room)
