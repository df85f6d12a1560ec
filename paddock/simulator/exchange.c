/* One question to a model's process and its answer, by two pipes that do not block. What a referee does in each step is
   done here in one go while all goes well; whatever else happens is left to the one who called, see
   evaluation/sandbox/policy_client.py. So is the whole way of a cruising car from the end of a step to the next answer.
   Linux only; elsewhere there is no sandbox and nothing to call. */

#if defined(__linux__) && defined(__LP64__)

#include <stdint.h>

/* Of the C library that every Python on Linux has loaded. */
extern long read(int file, void *buffer, unsigned long size);
extern long write(int file, const void *buffer, unsigned long size);
struct polled {
    int file;
    short wanted, found;
};
extern int poll(struct polled *files, unsigned long count, int milliseconds);
struct moment {
    long seconds, nanoseconds;
};
extern int clock_gettime(int clock, struct moment *now);

#define MONOTONIC 1
#define READABLE 1
#define LONGEST_MS 2147483000.0

enum { WAYS = 4, HEAD = 8 }; /* paddock/network/policy_wire.py */

struct exchange { /* as evaluation/sandbox/exchange.py writes it down */
    int32_t write_file, read_file;
    uint8_t *reply; /* with room for a byte more than one has */
    int64_t reply_size;
    double step_deadline_s, total_s;
    /* what was used of these so far, and how many steps were answered in each way */
    double bank_s, seconds;
    int64_t counts[WAYS];
    /* the last step, and what came of it: */
    uint32_t step, unused;
    int64_t best; /* the place of the first of the greatest numbers */
    int64_t sent, received; /* bytes; none where a call failed */
    double started_s, left_s; /* by the clock of time.monotonic, and how long it might take from then on */
};

static double now_s(void)
{
    struct moment now;
    clock_gettime(MONOTONIC, &now);
    return (double)now.seconds + 1e-9 * (double)now.nanoseconds;
}

static uint32_t word(const uint8_t *bytes) /* little-endian, wherever it lies */
{
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static int64_t at_least_none(long count) { return count < 0 ? 0 : count; }

/* Whether this is one reply to the step, of finite numbers only; finds the first of the greatest. */
static int is_sound(struct exchange *all)
{
    const uint8_t *const reply = all->reply;
    if (all->received != all->reply_size || word(reply) != all->step || word(reply + 4) >= WAYS)
        return 0;
    int64_t most = 0;
    for (int64_t place = HEAD; place < all->reply_size; place += 4) {
        const uint32_t bits = word(reply + place), size = bits & 0x7fffffffu;
        if (size >= 0x7f800000u)
            return 0;
        const int64_t rank = bits >> 31 ? -(int64_t)size : size; /* in the order of the numbers, both zeros alike */
        if (place == HEAD || rank > most) {
            most = rank;
            all->best = (place - HEAD) / 4;
        }
    }
    return 1;
}

/* Send the number of the next step, wait for the reply as long as the budget allows, read it, and count what it took.
   Returns the way in which it was answered; or -1 where that is not all there is to say: then nothing is counted, and
   sent, received, started_s and left_s tell how far it came. */
int64_t paddock_exchange(struct exchange *all)
{
    const double most_s = all->step_deadline_s + all->bank_s, total_s = all->total_s - all->seconds;
    all->left_s = total_s > most_s ? most_s : total_s;
    all->step++;
    all->received = 0;
    all->started_s = now_s();
    all->sent = at_least_none(write(all->write_file, &all->step, sizeof all->step));
    if (all->sent != sizeof all->step)
        return -1;
    /* On one core the model has mostly answered by now. A byte more than wanted, to see a second reply with the first. */
    const unsigned long room = (unsigned long)all->reply_size + 1;
    all->received = at_least_none(read(all->read_file, all->reply, room));
    if (!all->received) {
        const double left_ms = all->left_s < 0.0 ? 0.0 : all->left_s * 1000.0;
        struct polled file = {all->read_file, READABLE, 0};
        if (poll(&file, 1, left_ms < LONGEST_MS ? (int)left_ms + 1 : (int)LONGEST_MS) == 1)
            all->received = at_least_none(read(all->read_file, all->reply, room));
    }
    if (!is_sound(all))
        return -1;
    const double taken_s = now_s() - all->started_s;
    all->seconds += taken_s;
    if (taken_s > all->step_deadline_s)
        all->bank_s -= taken_s - all->step_deadline_s;
    const int64_t way = word(all->reply + 4);
    all->counts[way]++;
    return way;
}

enum { NOTHING_HAPPENED = 1, UNSURE = 3, ANSWERED = 4 }; /* the first as in cruise.c */

struct stride { /* as paddock/simulator/cruise.py writes it down */
    void *car;                                    /* of cruise.c */
    const double *x, *y, *cosine, *sine;          /* of its base, in there */
    const void *view;                             /* of camera/warp.c */
    uint8_t *frame;                               /* where the model sees it */
    struct exchange *asked;
    double camera_s, policy_s;
};

extern int64_t paddock_cruise(void *car);
extern void paddock_see(const void *view, double cos, double sin, double x, double y, uint8_t *frame);

/* paddock_cruise; where nothing happened, draw what the car sees now and ask its model. Returns what paddock_cruise does,
   or UNSURE where the answer is left to the one who called; else ANSWERED and on, the place of the answer's greatest. */
int64_t paddock_stride(struct stride *all)
{
    const int64_t outcome = paddock_cruise(all->car);
    if (outcome != NOTHING_HAPPENED)
        return outcome;
    const double began_s = now_s(), before_s = all->asked->seconds;
    paddock_see(all->view, *all->cosine, *all->sine, *all->x, *all->y, all->frame);
    const int64_t way = paddock_exchange(all->asked);
    all->camera_s += all->asked->started_s - began_s;
    all->policy_s += all->asked->seconds - before_s;
    return way < 0 ? UNSURE : ANSWERED + all->asked->best;
}

#else
typedef int nothing; /* a source with nothing in it is none */
#endif
