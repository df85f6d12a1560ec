"""Round robin: every car meets every other, from both starting orders.

A heat is a tuple of seeds in starting order, the front place first. A round is a list of heats in which no car drives
twice, so that the heats of a round may be driven in any order or at once.
"""

from itertools import combinations

Heat = tuple[int, ...]

MIN_CARS, MAX_CARS = 2, 4  # in one heat


def round_robin(entrants: int, cars: int = 2) -> list[list[Heat]]:
    """The rounds in which ``entrants`` cars (seeds 1 to ``entrants``) meet, ``cars`` of them in a heat.

    Two in a heat: every pair meets exactly twice, once from each starting order, the second time in the second half.
    More in a heat: every pair meets at least once from each order, the two of them equally often in front, and every
    car drives equally many heats from each starting place. Fewer entrants than ``cars`` share each heat all together.

    No rounds for fewer than two entrants. Raises ValueError for a number of cars that no heat takes.
    """
    if not MIN_CARS <= cars <= MAX_CARS:
        raise ValueError(f"a heat takes {MIN_CARS} to {MAX_CARS} cars, not {cars}")
    if entrants < 2:
        return []
    if cars == 2 or entrants == 2:
        return _pairs(entrants)
    if entrants <= cars:
        return [[order] for order in _orders(entrants)]
    return _packed(_groups(entrants, cars))


def _pairs(entrants: int) -> list[list[Heat]]:
    """The circle method: seed 1 stands still, the others move one chair on each round; then all with places swapped."""
    chairs: list[int | None] = [*range(1, entrants + 1), *([None] if entrants % 2 else [])]
    half = len(chairs) // 2
    first: list[list[Heat]] = []
    for number in range(len(chairs) - 1):
        heats: list[Heat] = []
        for table, (one, other) in enumerate(zip(chairs[:half], reversed(chairs[half:]), strict=True)):
            if one is not None and other is not None:
                # alternate the seats, so that no car starts in front all through a half
                heats.append((other, one) if (number if table == 0 else table) % 2 else (one, other))
        first.append(heats)
        chairs[1:] = [chairs[-1], *chairs[1:-1]]
    return first + [[heat[::-1] for heat in heats] for heats in first]


def _orders(entrants: int) -> list[Heat]:
    """All of 3 or 4 cars in one heat: each turns through every place, in a Latin square and its mirror image."""
    square = [tuple((place + shift) % entrants + 1 for place in range(entrants)) for shift in range(entrants)]
    return square + [heat[::-1] for heat in square]


def _groups(entrants: int, cars: int) -> list[Heat]:
    """Cyclic design: a pattern of starting places is shifted round the field, so each car has each place once.

    Seen from a car, the others are at distances 1 to entrants - 1; a pattern's differences are the distances at which
    two of its cars meet. Patterns are added until every distance is covered, each time the one that covers most and
    keeps the meetings even. Each pattern is driven backwards as well: every meeting then happens from both orders.
    """
    distances = range(1, entrants // 2 + 1)
    met = dict.fromkeys(distances, 0)
    patterns = []
    while not all(met.values()):
        pattern = min(_patterns(entrants, cars), key=lambda one: _worth(one, entrants, met))
        for distance in _distances(pattern, entrants):
            met[distance] += 1
        patterns.append(pattern)
    heats = []
    for pattern in patterns:
        shifted = [tuple((place + shift) % entrants + 1 for place in pattern) for shift in range(entrants)]
        heats += shifted + [heat[::-1] for heat in shifted]
    return heats


def _patterns(entrants: int, cars: int) -> list[Heat]:
    return [(0, *rest) for rest in combinations(range(1, entrants), cars - 1)]


def _distances(pattern: Heat, entrants: int) -> list[int]:
    """How far apart the cars of a pattern are round the field, the shorter way, for each pair of them."""
    return [min(later - earlier, entrants - later + earlier) for earlier, later in combinations(pattern, 2)]


def _worth(pattern: Heat, entrants: int, met: dict[int, int]) -> tuple:
    """Smaller is better: distances left uncovered, then how uneven the meetings become, then the pattern itself."""
    after = dict(met)
    for distance in _distances(pattern, entrants):
        after[distance] += 1
    uncovered = sum(not count for count in after.values())
    return uncovered, sum(count * count for count in after.values()), pattern


def _packed(heats: list[Heat]) -> list[list[Heat]]:
    """Put each heat into the first round in which none of its cars drives yet."""
    rounds: list[list[Heat]] = []
    busy: list[set[int]] = []
    for heat in heats:
        for round_, cars in zip(rounds, busy, strict=True):
            if cars.isdisjoint(heat):
                round_.append(heat)
                cars.update(heat)
                break
        else:
            rounds.append([heat])
            busy.append(set(heat))
    return rounds
