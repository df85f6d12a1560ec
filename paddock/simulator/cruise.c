/* A control step of a car alone on a loop in which nothing happens: a row is written down, the car is followed along the
   track, and the referee has nothing to say. The same sums in the same order as in Python's own way, see cruise.py, so
   the same to the bit; whatever may be anything else is left to Python, and then nothing has changed here. */

#include <stdint.h>

enum { NOT_THIS_ONE, NOTHING_HAPPENED, LOOK_AT_WHEELS };

struct segment { /* paddock/geometry/segments.py */
    double ax, ay, ex, ey, tx, ty, ux, uy, along, bend, start, size, reach;
};

struct edge { /* of a border, paddock/geometry/road.py */
    double ax, ay, dx, dy, square;
};

struct row { /* paddock/simulator/trace.py; what is not written here stays the same from row to row */
    int64_t lap, lap_steps;
    double x, y, yaw, steering_deg, speed_mps;
    int64_t index;
    double reward;
    uint8_t ends, all_wheels, finished, unused[5];
    double metres, distance;
    int64_t segment, step;
    uint32_t status[12];
    int64_t pause_steps, crashes;
};

struct cruise { /* as cruise.py writes it down; metres and radians */
    /* the track */
    const struct segment *segments;
    const double *gains, *half_widths; /* of each waypoint, to the left and to the right */
    int64_t count;
    double length;
    const struct edge *edges;
    const int64_t *bands;
    int64_t band_count;
    double low_m, band_m, on_line_m, rounding_m, window_m;
    /* what the referee goes by */
    double nose_m, front_m, rear_m, side_m, surely_m, clear_m, clear_from, clear_to, line_m;
    int64_t last_step, patience;
    /* a step: where the base is now, cosine and sine of its heading, and the command that it was given before */
    double new_x, new_y, new_yaw, cos, sin, steering_deg, speed_mps;
    int64_t index;
    /* the car: its nose now and a step before, its base now and a step before */
    double x, y, older_x, older_y;
    double base_x, base_y, yaw, before_x, before_y, before_yaw;
    double metres, before_m;
    double distance, offset, tx, ty;
    int64_t segment, step, lap_steps, reversing, clear, all_wheels;
    /* its trace */
    struct row *rows;
    int64_t room, used;
};

static double size_of(double number) { return number < 0.0 ? -number : number; }

struct place {
    double distance, offset, tx, ty;
    int64_t segment;
};

/* TrackGeometry.project where it is quick. */
static int project(const struct cruise *car, double x, double y, struct place *found)
{
    int64_t index = car->segment;
    double walked = 0.0;
    for (;;) {
        const struct segment *at = car->segments + index;
        const double px = x - at->ax, py = y - at->ay;
        double behind = px * at->tx + py * at->ty;
        if (behind < 0.0) {
            if (behind < -car->rounding_m) {
                if (walked > 0.0 || walked < -car->window_m)
                    return 0;
                index = (index ? index : car->count) - 1;
                walked -= at->size;
                continue;
            }
            behind = 0.0;
        }
        const double slope = px * at->ux + py * at->uy - at->along;
        if (behind + slope - at->bend >= 0.0) {
            if (walked < 0.0 || walked > car->window_m)
                return 0;
            index = index + 1 == car->count ? 0 : index + 1;
            walked += at->size;
            continue;
        }
        const double below = __builtin_sqrt(slope * slope + 4.0 * behind * at->bend) - slope;
        const double t = below > 0.0 ? 2.0 * behind / below : 0.0;
        const double tx = at->tx + t * at->ux, ty = at->ty + t * at->uy;
        const double offset =
            (tx * (py - t * at->ey) - ty * (px - t * at->ex)) / __builtin_sqrt(tx * tx + ty * ty);
        if (!(-at->reach <= offset && offset <= at->reach))
            return 0;
        const double distance = at->start + t * at->size;
        *found = (struct place){distance >= car->length ? 0.0 : distance, offset, tx, ty, index};
        return 1;
    }
}

/* Metres from -length / 2 to length / 2, by Python's remainder of doubles. */
static double wrapped(double metres, double length)
{
    double sum = metres + length / 2;
    if (sum < 0.0)
        sum += length;
    else if (sum >= length)
        sum -= length; /* without rounding: it is less than two lengths */
    return sum - length / 2;
}

enum { BESIDE, ON_ROAD, UNSURE };

/* Road.contains of the point so far ahead of the base and to its left. */
static int is_on_road(const struct cruise *car, double ahead, double left)
{
    const double x = car->new_x + ahead * car->cos - left * car->sin;
    const double y = car->new_y + ahead * car->sin + left * car->cos;
    const double bands = (y - car->low_m) / car->band_m;
    if (!(bands >= 0.0 && bands < (double)car->band_count))
        return UNSURE;
    const int64_t band = (int64_t)bands;
    int odd = 0;
    for (const struct edge *at = car->edges + car->bands[band]; at < car->edges + car->bands[band + 1]; at++) {
        const double px = x - at->ax, py = y - at->ay;
        const double turn = at->dx * py - at->dy * px;
        if (turn * turn <= car->on_line_m * car->on_line_m * at->square)
            return UNSURE; /* as good as on the line */
        odd ^= (py >= 0.0) != (py >= at->dy) && (turn < 0.0) == (at->dy < 0.0);
    }
    return odd ? ON_ROAD : BESIDE;
}

/* A car that is not clear of the borders: whether it still has a wheel on the road, beside which it surely is. Then
   finds out about all of them. */
static int is_on_its_road(struct cruise *car)
{
    const int64_t after = car->segment + 1 == car->count ? 0 : car->segment + 1;
    const double *here = car->half_widths + 2 * car->segment, *next = car->half_widths + 2 * after;
    /* The referee lets the nose be farther out, by what it is away from the wheels; so near roundings do not matter. */
    if (car->offset > here[0] || car->offset > next[0] || -car->offset > here[1] || -car->offset > next[1])
        return 0;
    int on_road = 0;
    for (int wheel = 0; wheel < 4; wheel++) {
        const int found = is_on_road(car, wheel < 2 ? car->front_m : car->rear_m, wheel % 2 ? -car->side_m : car->side_m);
        if (found == UNSURE)
            return 0;
        on_road += found == ON_ROAD;
    }
    car->all_wheels = on_road == 4;
    return on_road > 0;
}

/* Write down the present state with the command that it was given, and follow the car to where its base is now. */
int64_t paddock_cruise(struct cruise *car)
{
    const double cos = car->cos, sin = car->sin;
    if (car->used == car->room || car->step + 1 >= car->last_step)
        return NOT_THIS_ONE;
    const double x = car->new_x + car->nose_m * cos - 0.0 * sin, y = car->new_y + car->nose_m * sin + 0.0 * cos;
    struct place place;
    if (!project(car, x, y, &place))
        return NOT_THIS_ONE;
    const double gained = wrapped(place.distance - car->distance, car->length);
    if (!(size_of(gained) <= car->gains[car->segment])) /* not driven */
        return NOT_THIS_ONE;
    const int moved = size_of(x - car->x) > car->surely_m || size_of(y - car->y) > car->surely_m;
    if (!moved || !(size_of(x - car->older_x) > car->surely_m || size_of(y - car->older_y) > car->surely_m))
        return NOT_THIS_ONE;
    const double metres = car->metres + gained;
    const int64_t reversing = metres < car->metres ? car->reversing + 1 : 0;
    if (!(metres < car->line_m) || reversing >= car->patience)
        return NOT_THIS_ONE;

    struct row *row = car->rows + car->used++;
    row->lap_steps = car->lap_steps++;
    row->x = car->x;
    row->y = car->y;
    row->yaw = car->yaw;
    row->steering_deg = car->steering_deg;
    row->speed_mps = car->speed_mps;
    row->index = car->index;
    row->all_wheels = (uint8_t)car->all_wheels;
    row->metres = car->metres;
    row->distance = car->distance;
    row->segment = car->segment;
    row->step = car->step++;

    car->older_x = car->x;
    car->older_y = car->y;
    car->x = x;
    car->y = y;
    car->before_x = car->base_x;
    car->before_y = car->base_y;
    car->before_yaw = car->yaw;
    car->base_x = car->new_x;
    car->base_y = car->new_y;
    car->yaw = car->new_yaw;
    car->before_m = car->metres;
    car->metres = metres;
    car->reversing = reversing;
    car->distance = place.distance;
    car->offset = place.offset;
    car->tx = place.tx;
    car->ty = place.ty;
    car->segment = place.segment;
    car->clear = car->all_wheels = -car->clear_m < place.offset && place.offset < car->clear_m &&
                                   car->clear_from < place.distance && place.distance < car->clear_to;
    return car->clear || is_on_its_road(car) ? NOTHING_HAPPENED : LOOK_AT_WHEELS;
}
