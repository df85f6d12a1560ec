/* One question to a model's process and its answer, by two pipes that do not block. What a referee does in each step is
   done here in one go while all goes well; whatever else happens is left to the one who called, see
   evaluation/sandbox/policy_client.py. Linux only; elsewhere there is no sandbox and nothing to call. */

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

struct exchange { /* as policy_client.py writes it down */
    int32_t write_file, read_file;
    const uint32_t *request; /* the number of the step, which is all of it */
    uint8_t *reply; /* with room for a byte more than one has */
    int64_t reply_size;
    /* and what came of it: */
    int64_t sent, received; /* bytes; none where a call failed */
    double started_s, taken_s; /* by the clock of time.monotonic */
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

/* Whether this is one reply to the step, of finite numbers only. */
static int is_sound(const struct exchange *all, uint32_t step)
{
    const uint8_t *const reply = all->reply;
    if (all->received != all->reply_size || word(reply) != step || word(reply + 4) >= WAYS)
        return 0;
    for (int64_t place = HEAD; place < all->reply_size; place += 4)
        if ((word(reply + place) & 0x7f800000u) == 0x7f800000u)
            return 0;
    return 1;
}

/* Send the request, wait at most left_s seconds for the reply, and read it. Returns the way in which it was answered; or
   -1 where that is not all there is to say: sent, received and started_s tell how far it came. */
int64_t paddock_exchange(struct exchange *all, double left_s)
{
    all->received = 0;
    all->started_s = now_s();
    all->sent = at_least_none(write(all->write_file, all->request, sizeof *all->request));
    if (all->sent != sizeof *all->request)
        return -1;
    /* On one core the model has mostly answered by now. A byte more than wanted, to see a second reply with the first. */
    const unsigned long room = (unsigned long)all->reply_size + 1;
    all->received = at_least_none(read(all->read_file, all->reply, room));
    if (!all->received) {
        const double left_ms = left_s < 0.0 ? 0.0 : left_s * 1000.0;
        struct polled file = {all->read_file, READABLE, 0};
        if (poll(&file, 1, left_ms < LONGEST_MS ? (int)left_ms + 1 : (int)LONGEST_MS) == 1)
            all->received = at_least_none(read(all->read_file, all->reply, room));
    }
    if (!is_sound(all, *all->request))
        return -1;
    all->taken_s = now_s() - all->started_s;
    return word(all->reply + 4);
}

#else
typedef int nothing; /* a source with nothing in it is none */
#endif
