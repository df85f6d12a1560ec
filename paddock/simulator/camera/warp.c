/* The compiled way to fill a frame, the same to the bit as NumpyWarp in warp.py, which says what is drawn and how
   numbers are written. Whole numbers only: no flag and no processor can change a result. No C library is needed. */

#include <stdint.h>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "two neighbours are read as one little-endian number"
#endif

#define CHUNK 32 /* columns that are drawn together, so that vector instructions have something to do */
#define FRACTION 32
#define ONE ((int64_t)1 << FRACTION)

typedef uint16_t __attribute__((may_alias, aligned(1))) pair; /* a pixel and its right neighbour */

struct strip { /* as CompiledWarp writes it down */
    const uint8_t *pixels;
    int64_t width, height;
    int64_t first, last; /* rows of the frame */
    int64_t doublings;
};

struct line {
    int64_t column, row, column_step, row_step;
};

const char paddock_identity[] = IDENTITY;

static int within(int64_t place, int64_t end) { return (uint64_t)place < (uint64_t)end; }

/* CHUNK places whose four pixels are all in the picture. */
static void add_inside(const struct strip *strip, struct line at, uint32_t *sums)
{
    const uint32_t column = (uint32_t)at.column, row = (uint32_t)at.row;
    const uint32_t column_step = (uint32_t)at.column_step, row_step = (uint32_t)at.row_step;
    uint32_t fours[CHUNK];
    for (int i = 0; i < CHUNK; i++) {
        const uint8_t *pixel = strip->pixels + (at.row >> FRACTION) * strip->width + (at.column >> FRACTION);
        fours[i] = *(const pair *)pixel | (uint32_t) * (const pair *)(pixel + strip->width) << 16;
        at.column += at.column_step;
        at.row += at.row_step;
    }
    for (int i = 0; i < CHUNK; i++) {
        const uint32_t across = (column + (uint32_t)i * column_step) >> 24, up = (row + (uint32_t)i * row_step) >> 24;
        const uint32_t four = fours[i];
        const uint32_t a = four & 255, b = four >> 8 & 255, c = four >> 16 & 255, d = four >> 24;
        const uint32_t low = (a << 8) + (b - a) * across, high = (c << 8) + (d - c) * across;
        sums[i] += (low << 8) + (high - low) * up;
    }
}

static uint32_t grey(const struct strip *strip, int64_t column, int64_t row, uint32_t wall)
{
    const int inside = within(column, strip->width) && within(row, strip->height);
    return inside ? strip->pixels[row * strip->width + column] : wall;
}

/* Up to CHUNK places anywhere. */
static void add_anywhere(const struct strip *strip, struct line at, int count, uint32_t wall, uint32_t *sums)
{
    for (int i = 0; i < count; i++) {
        const int64_t column = at.column >> FRACTION, row = at.row >> FRACTION;
        const uint32_t across = (uint32_t)at.column >> 24, up = (uint32_t)at.row >> 24;
        const uint32_t low =
            grey(strip, column, row, wall) * (256 - across) + grey(strip, column + 1, row, wall) * across;
        const uint32_t high =
            grey(strip, column, row + 1, wall) * (256 - across) + grey(strip, column + 1, row + 1, wall) * across;
        sums[i] += low * (256 - up) + high * up;
        at.column += at.column_step;
        at.row += at.row_step;
    }
}

/* A place goes evenly from the first to the last of a chunk: what is true of both is true of all between them. */
static void add(const struct strip *strip, struct line at, int count, uint32_t wall, uint32_t *sums)
{
    const int64_t last_column = at.column + (count - 1) * at.column_step;
    const int64_t last_row = at.row + (count - 1) * at.row_step;
    const int64_t width = strip->width << FRACTION, height = strip->height << FRACTION;
    if (count == CHUNK && within(at.column, width - ONE) && within(last_column, width - ONE) &&
        within(at.row, height - ONE) && within(last_row, height - ONE))
        add_inside(strip, at, sums);
    else if ((at.column < -ONE && last_column < -ONE) || (at.column >= width && last_column >= width) ||
             (at.row < -ONE && last_row < -ONE) || (at.row >= height && last_row >= height))
        for (int i = 0; i < count; i++)
            sums[i] += wall << 16;
    else
        add_anywhere(strip, at, count, wall, sums);
}

/* lines: four arrays of line_count numbers, the members of struct line. */
void paddock_warp(const struct strip *strip, int64_t strips, const int64_t *lines, int64_t line_count, uint8_t *frame,
                  int64_t columns, int64_t wall)
{
    for (; strips > 0; strips--, strip++) {
        const int samples = 1 << strip->doublings, shift = 16 + (int)strip->doublings;
        for (int64_t row = strip->first; row < strip->last; row++, lines += samples)
            for (int64_t from = 0; from < columns; from += CHUNK) {
                const int count = columns - from < CHUNK ? (int)(columns - from) : CHUNK;
                uint32_t sums[CHUNK];
                for (int i = 0; i < CHUNK; i++)
                    sums[i] = (uint32_t)1 << (shift - 1);
                for (int sample = 0; sample < samples; sample++) {
                    const int64_t *line = lines + sample;
                    const struct line at = {
                        line[0] + from * line[2 * line_count],
                        line[line_count] + from * line[3 * line_count],
                        line[2 * line_count],
                        line[3 * line_count],
                    };
                    add(strip, at, count, (uint32_t)wall, sums);
                }
                uint8_t *pixels = frame + row * columns + from;
                for (int i = 0; i < count; i++)
                    pixels[i] = (uint8_t)(sums[i] >> shift);
            }
    }
}
