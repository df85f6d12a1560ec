/* The lines of a trace's file, see trace.py: each number with the digits that Python's repr gives it. Whole numbers and
   truths are written as they are, texts as far as they go, doubles by their shortest digits that read back as the same
   double; of several such the nearest, of two as near the one that ends in an even digit. */

#include <stdint.h>

#ifdef __SIZEOF_INT128__

enum { WHOLE, TRUTH, DOUBLE, TEXT };

struct column { /* as trace.py writes it down */
    const uint8_t *values;
    int64_t kind, size; /* bytes of a value */
};

typedef unsigned __int128 wide;

static char *digits(char *out, uint64_t number)
{
    char turned[20];
    int count = 0;
    do
        turned[count++] = (char)('0' + number % 10);
    while (number /= 10);
    while (count)
        *out++ = turned[--count];
    return out;
}

static const uint64_t tens[] = {
    1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000, 1000000000, 10000000000, 100000000000,
    1000000000000, 10000000000000, 100000000000000, 1000000000000000, 10000000000000000, 100000000000000000,
    1000000000000000000, 10000000000000000000u,
};

/* A double that is 0 or from 0.0001 to 10^9 in size: then nothing here has more than 128 bits. */
static char *shortest(char *out, double value)
{
    union {
        double value;
        uint64_t bits;
    } of = {value};
    if (of.bits >> 63)
        *out++ = '-';
    const uint64_t bits = of.bits << 1 >> 1;
    if (!bits) {
        *out++ = '0', *out++ = '.', *out++ = '0';
        return out;
    }
    /* The double is 4 * whole / 2^shift, and all between low and high / 2^shift read back as it. */
    const uint64_t whole = (bits & 0xfffffffffffff) | 0x10000000000000;
    const int shift = 1077 - (int)(bits >> 52);
    const uint64_t low = 4 * whole - (whole == 0x10000000000000 ? 1 : 2), high = 4 * whole + 2;
    of.bits = bits;
    int places = 8; /* after the point, for 17 digits or one more */
    for (double reach = 1e8; places < 21 && of.value < reach; reach /= 10.0)
        places++;
    const wide ten = places < 20 ? tens[places] : (wide)tens[19] * tens[places - 19], exact = 4 * whole * ten;
    const wide least = low * ten, most = high * ten, rest = ((wide)1 << shift) - 1;
    const int open = whole & 1; /* the ends read back as the neighbours, which are even */
    const uint64_t first = (uint64_t)(least >> shift) + ((least & rest) || open);
    const uint64_t last = (uint64_t)(most >> shift) - (!(most & rest) && open);
    const uint64_t here = (uint64_t)(exact >> shift);
    uint64_t step = 1;
    while ((first + 10 * step - 1) / (10 * step) <= last / (10 * step))
        step *= 10;
    uint64_t best = here / step;
    const uint64_t over = 2 * (here % step);
    const int more = (exact & rest) != 0;
    if (step == 1) {
        const wide twice = 2 * (exact & rest);
        best += twice > rest + 1 || (twice == rest + 1 && (best & 1));
    } else
        best += over > step || (over == step && (more || (best & 1)));
    best *= step;
    if (best < first)
        best += step;
    if (places < 20) {
        out = digits(out, best / tens[places]);
        best %= tens[places];
    } else
        *out++ = '0'; /* 10^20 has more than 64 bits, and it is less than one */
    *out++ = '.';
    while (places > 1 && best % 10 == 0)
        best /= 10, places--;
    out += places;
    for (char *at = out; places--; best /= 10)
        *--at = (char)('0' + best % 10);
    return out;
}

static char *copied(char *out, const char *text, int64_t size)
{
    while (size-- && *text)
        *out++ = *text++;
    return out;
}

/* Write so many rows, with a comma between two values. Returns the number of bytes. */
int64_t paddock_rows(const struct column *columns, int64_t count, int64_t rows, char *const out)
{
    char *at = out;
    for (int64_t row = 0; row < rows; row++)
        for (int64_t number = 0; number < count; number++) {
            const struct column *of = columns + number;
            const uint8_t *value = of->values + row * of->size;
            if (of->kind == WHOLE) {
                const int64_t whole = *(const int64_t *)value;
                if (whole < 0)
                    *at++ = '-';
                at = digits(at, whole < 0 ? -(uint64_t)whole : (uint64_t)whole);
            } else if (of->kind == TRUTH)
                at = copied(at, *value ? "True" : "False", 5);
            else if (of->kind == DOUBLE)
                at = shortest(at, *(const double *)value);
            else
                at = copied(at, (const char *)value, of->size);
            *at++ = number + 1 < count ? ',' : '\n';
        }
    return at - out;
}

#else
typedef int nothing; /* a source with nothing in it is none */
#endif
