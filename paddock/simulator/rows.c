/* The rows of a sim-trace as text, the same to the byte as Python's own: str of whole numbers and truths, repr of
   doubles, which is the shortest decimal that reads back as the same double, and of these the nearest.

   Digits as in Raffaello Giulietti, "The Schubfach way to render doubles" (2020): whole numbers only, so no flag and no
   processor can change a result. The powers of ten come from Python, see rows.py. No C library is needed. */

#include <stdint.h>

struct column { /* as rows.py writes it down */
    int64_t kind;
    const void *values;
    int64_t width; /* of a text, in characters of four bytes */
};

enum { DOUBLES, WHOLES, TRUTHS, TEXTS };

struct power { /* of ten: the upper 128 bits, rounded up */
    uint64_t high, low;
};

struct decimal {
    uint64_t digits;
    int64_t exponent; /* of ten */
};

#define LEAST_POWER (-292)
#define FRACTION_BITS 52
#define MOST_FIXED 16 /* digits before the point, and */
#define LEAST_FIXED (-4) /* zeros behind it, from which on Python writes an exponent */

static int64_t shifted(int64_t value, int bits) { return value < 0 ? ~(~value >> bits) : value >> bits; }

/* The upper half of power times number, its last bit set where anything was cut off. */
static uint64_t scaled(const struct power *power, uint64_t number)
{
    const unsigned __int128 lower = (unsigned __int128)power->low * number;
    const unsigned __int128 upper = (unsigned __int128)power->high * number + (uint64_t)(lower >> 64);
    return (uint64_t)(upper >> 64) | ((uint64_t)upper > 1);
}

/* The shortest decimal of a double that is finite and above zero. */
static struct decimal shortest(uint64_t fraction, int64_t exponent, const struct power *powers)
{
    const uint64_t number = exponent ? fraction | (uint64_t)1 << FRACTION_BITS : fraction;
    const int64_t two = (exponent ? exponent : 1) - 1075; /* the value is number times two to this */
    if (two <= 0 && two > -53 && (number & (((uint64_t)1 << -two) - 1)) == 0)
        return (struct decimal){number >> -two, 0}; /* whole */
    const uint64_t odd = number & 1;
    const int narrow = fraction == 0 && exponent > 1; /* the next double below is nearer than the one above */
    const int64_t ten = shifted(two * 1262611 - (narrow ? 524031 : 0), 22); /* floor of the logarithm */
    const int shift = (int)(two + shifted(-ten * 1741647, 19) + 1);
    const struct power *power = powers + (-ten - LEAST_POWER);
    const uint64_t low = scaled(power, (4 * number - 2 + (uint64_t)narrow) << shift) + odd;
    const uint64_t exact = scaled(power, (4 * number) << shift);
    const uint64_t high = scaled(power, (4 * number + 2) << shift) - odd;
    const uint64_t whole = exact / 4;
    if (whole >= 10) { /* one digit less */
        const uint64_t tens = whole / 10;
        const int below = low <= 40 * tens, above = 40 * tens + 40 <= high;
        if (below != above)
            return (struct decimal){tens + (uint64_t)above, ten + 1};
    }
    const int below = low <= 4 * whole, above = 4 * whole + 4 <= high;
    if (below != above)
        return (struct decimal){whole + (uint64_t)above, ten};
    const uint64_t middle = 4 * whole + 2;
    return (struct decimal){whole + (exact > middle || (exact == middle && (whole & 1))), ten};
}

static uint8_t *put_word(uint8_t *out, const char *word)
{
    while (*word)
        *out++ = (uint8_t)*word++;
    return out;
}

static uint8_t *put_zeros(uint8_t *out, int64_t count)
{
    for (; count > 0; count--)
        *out++ = '0';
    return out;
}

static uint8_t *put_whole(uint8_t *out, uint64_t number)
{
    uint8_t digits[20];
    int count = 0;
    do
        digits[count++] = (uint8_t)('0' + number % 10);
    while (number /= 10);
    while (count)
        *out++ = digits[--count];
    return out;
}

static uint8_t *put_double(uint8_t *out, uint64_t bits, const struct power *powers)
{
    const uint64_t fraction = bits & (((uint64_t)1 << FRACTION_BITS) - 1);
    const int64_t exponent = (int64_t)(bits >> FRACTION_BITS & 2047);
    if (exponent == 2047 && fraction)
        return put_word(out, "nan");
    if (bits >> 63)
        *out++ = '-';
    if (exponent == 2047)
        return put_word(out, "inf");
    if (!(fraction | (uint64_t)exponent))
        return put_word(out, "0.0");
    struct decimal found = shortest(fraction, exponent, powers);
    uint8_t backwards[20];
    int count = 0, first = 1;
    for (; found.digits; found.digits /= 10) {
        const uint8_t digit = (uint8_t)(found.digits % 10);
        if (first && !digit) { /* zeros at the end say nothing */
            found.exponent++;
            continue;
        }
        first = 0;
        backwards[count++] = (uint8_t)('0' + digit);
    }
    const int64_t point = count + found.exponent; /* digits before it */
    if (point <= LEAST_FIXED || point > MOST_FIXED) {
        *out++ = backwards[--count];
        if (count)
            *out++ = '.';
        while (count)
            *out++ = backwards[--count];
        const int64_t shown = point - 1;
        *out++ = 'e';
        *out++ = shown < 0 ? '-' : '+';
        const uint64_t size = (uint64_t)(shown < 0 ? -shown : shown);
        if (size < 10)
            *out++ = '0';
        return put_whole(out, size);
    }
    if (point <= 0) {
        out = put_word(out, "0.");
        out = put_zeros(out, -point);
    }
    for (int64_t place = 1; count; place++) {
        *out++ = backwards[--count];
        if (place == point && count)
            *out++ = '.';
    }
    if (found.exponent >= 0) {
        out = put_zeros(out, found.exponent);
        out = put_word(out, ".0");
    }
    return out;
}

/* Rows, each ended by a line break, into out, which has room for them. The bytes written; -1 for a text that is not
   ASCII. */
int64_t paddock_write_rows(const struct column *columns, int64_t count, int64_t rows, const struct power *powers,
                           uint8_t *out)
{
    uint8_t *const begin = out;
    for (int64_t row = 0; row < rows; row++) {
        for (const struct column *column = columns; column < columns + count; column++) {
            if (column->kind == DOUBLES)
                out = put_double(out, ((const uint64_t *)column->values)[row], powers);
            else if (column->kind == WHOLES) {
                const int64_t number = ((const int64_t *)column->values)[row];
                if (number < 0)
                    *out++ = '-';
                out = put_whole(out, number < 0 ? 0 - (uint64_t)number : (uint64_t)number);
            } else if (column->kind == TRUTHS)
                out = put_word(out, ((const uint8_t *)column->values)[row] ? "True" : "False");
            else {
                const uint32_t *text = (const uint32_t *)column->values + row * column->width;
                for (int64_t place = 0; place < column->width && text[place]; place++) {
                    if (text[place] > 127)
                        return -1;
                    *out++ = (uint8_t)text[place];
                }
            }
            *out++ = ',';
        }
        out[-1] = '\n';
    }
    return out - begin;
}
