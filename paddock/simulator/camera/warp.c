/* The compiled way to fill a frame, the same to the bit as NumpyWarp in warp.py, which says what is drawn and how
   numbers are written. Frames are drawn in whole numbers: no flag and no processor can change a result. Where a line
   begins takes a few doubles, each product and each sum rounded for itself (-ffp-contract=off). No C library is needed.

   On x86-64 everything is compiled twice, for every processor and for those with AVX2, which draw a tenth faster. */

#include <stdint.h>
#ifdef __x86_64__
#include <cpuid.h>
#endif

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "two neighbours are read as one little-endian number"
#endif

#define CHUNK 32 /* columns that are drawn together, so that vector instructions have something to do */
#define FRACTION 32
#define ONE ((int64_t)1 << FRACTION)
#define PART static inline __attribute__((always_inline)) /* of a function that is compiled for several processors */

typedef uint16_t __attribute__((may_alias, aligned(1))) pair; /* a pixel and its right neighbour */

struct strip { /* as CompiledWarp writes it down */
    const uint8_t *pixels;
    int64_t width, height;
    int64_t first, last; /* rows of the frame */
    int64_t doublings;
    int64_t flat; /* the only grey in the picture; less than 0 where there are several */
};

struct line {
    int64_t column, row, column_step, row_step;
};

/* What a line is reckoned from, side by side: they are read once a frame, mostly from far away. */
struct terms {
    double column[4], row[4]; /* times the cosine, the sine, the camera's place, and one */
    double column_step[2], row_step[2];
};

struct view { /* as CompiledWarp writes it down */
    const struct strip *strips;
    int64_t strip_count;
    const struct terms *terms;
    struct line *lines;
    int64_t line_count, columns, wall;
};

const char paddock_identity[] = IDENTITY;

PART int within(int64_t place, int64_t end) { return (uint64_t)place < (uint64_t)end; }

/* CHUNK places whose four pixels are all in the picture. */
PART void add_inside(const struct strip *strip, struct line at, uint32_t *sums)
{
    const uint32_t column = (uint32_t)at.column, row = (uint32_t)at.row;
    const uint32_t column_step = (uint32_t)at.column_step, row_step = (uint32_t)at.row_step;
    const uint8_t *const above = strip->pixels, *const below = strip->pixels + strip->width;
    const int64_t width = strip->width;
    uint32_t fours[CHUNK];
    for (int i = 0; i < CHUNK; i += 2) { /* two at once: a twentieth of a frame's time */
        const int64_t here = (at.row >> FRACTION) * width + (at.column >> FRACTION);
        const int64_t next =
            ((at.row + at.row_step) >> FRACTION) * width + ((at.column + at.column_step) >> FRACTION);
        fours[i] = *(const pair *)(above + here) | (uint32_t) * (const pair *)(below + here) << 16;
        fours[i + 1] = *(const pair *)(above + next) | (uint32_t) * (const pair *)(below + next) << 16;
        at.column += 2 * at.column_step;
        at.row += 2 * at.row_step;
    }
    for (int i = 0; i < CHUNK; i++) {
        const uint32_t across = (column + (uint32_t)i * column_step) >> 24, up = (row + (uint32_t)i * row_step) >> 24;
        const uint32_t four = fours[i];
        const uint32_t a = four & 255, b = four >> 8 & 255, c = four >> 16 & 255, d = four >> 24;
        const uint32_t low = (a << 8) + (b - a) * across, high = (c << 8) + (d - c) * across;
        sums[i] += (low << 8) + (high - low) * up;
    }
}

PART uint32_t grey(const struct strip *strip, int64_t column, int64_t row, uint32_t wall)
{
    const int inside = within(column, strip->width) && within(row, strip->height);
    return inside ? strip->pixels[row * strip->width + column] : wall;
}

/* Up to CHUNK places anywhere. */
PART void add_anywhere(const struct strip *strip, struct line at, int count, uint32_t wall, uint32_t *sums)
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
PART void add(const struct strip *strip, struct line at, int count, uint32_t wall, uint32_t *sums)
{
    const int64_t last_column = at.column + (count - 1) * at.column_step;
    const int64_t last_row = at.row + (count - 1) * at.row_step;
    const int64_t width = strip->width << FRACTION, height = strip->height << FRACTION;
    const int inside = within(at.column, width - ONE) && within(last_column, width - ONE) &&
                       within(at.row, height - ONE) && within(last_row, height - ONE);
    if (inside && strip->flat >= 0)
        for (int i = 0; i < count; i++)
            sums[i] += (uint32_t)strip->flat << 16;
    else if (inside && count == CHUNK)
        add_inside(strip, at, sums);
    else if ((at.column < -ONE && last_column < -ONE) || (at.column >= width && last_column >= width) ||
             (at.row < -ONE && last_row < -ONE) || (at.row >= height && last_row >= height))
        for (int i = 0; i < count; i++)
            sums[i] += wall << 16;
    else
        add_anywhere(strip, at, count, wall, sums);
}

/* Whether all of a line's places between its first and its last pixel have their four neighbours in the picture. */
PART int stays_inside(const struct strip *strip, const struct line *line, int64_t columns)
{
    const int64_t width = (strip->width - 1) << FRACTION, height = (strip->height - 1) << FRACTION;
    return within(line->column, width) && within(line->column + (columns - 1) * line->column_step, width) &&
           within(line->row, height) && within(line->row + (columns - 1) * line->row_step, height);
}

/* A row of one grey, which needs no looking up; 0 where it is none. */
PART int fill(const struct strip *strip, const struct line *lines, int samples, uint8_t *pixels, int64_t columns)
{
    if (strip->flat < 0)
        return 0;
    for (int sample = 0; sample < samples; sample++)
        if (!stays_inside(strip, lines + sample, columns))
            return 0;
    for (int64_t i = 0; i < columns; i++)
        pixels[i] = (uint8_t)strip->flat;
    return 1;
}

PART void warp(const struct view *view, uint8_t *frame)
{
    const struct line *lines = view->lines;
    const int64_t columns = view->columns;
    for (const struct strip *strip = view->strips; strip < view->strips + view->strip_count; strip++) {
        const int samples = 1 << strip->doublings, shift = 16 + (int)strip->doublings;
        for (int64_t row = strip->first; row < strip->last; row++, lines += samples) {
            if (fill(strip, lines, samples, frame + row * columns, columns))
                continue;
            for (int64_t from = 0; from < columns; from += CHUNK) {
                const int count = columns - from < CHUNK ? (int)(columns - from) : CHUNK;
                uint32_t sums[CHUNK];
                for (int i = 0; i < CHUNK; i++)
                    sums[i] = (uint32_t)1 << (shift - 1);
                for (int sample = 0; sample < samples; sample++) {
                    struct line at = lines[sample];
                    at.column += from * at.column_step;
                    at.row += from * at.row_step;
                    add(strip, at, count, (uint32_t)view->wall, sums);
                }
                uint8_t *pixels = frame + row * columns + from;
                if (count == CHUNK)
                    for (int i = 0; i < CHUNK; i++)
                        pixels[i] = (uint8_t)(sums[i] >> shift);
                else
                    for (int i = 0; i < count; i++)
                        pixels[i] = (uint8_t)(sums[i] >> shift);
            }
        }
    }
}

#ifdef __x86_64__
__attribute__((target("avx2"))) static void warp_avx2(const struct view *view, uint8_t *frame) { warp(view, frame); }

/* 1 where processor and system have AVX2, else 2: asked once. */
static int avx2(void)
{
    static int known;
    unsigned a, b, c, d, low, high;
    if (known)
        return known;
    known = 2;
    if (__get_cpuid(1, &a, &b, &c, &d) && (c & bit_OSXSAVE)) {
        __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
        if ((low & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & bit_AVX2))
            known = 1;
    }
    return known;
}
#endif

/* The frame of the lines as they are. */
void paddock_warp(const struct view *view, uint8_t *frame)
{
#ifdef __x86_64__
    if (avx2() == 1) {
        warp_avx2(view, frame);
        return;
    }
#endif
    warp(view, frame);
}

/* The nearest whole number; of two as near the even one. */
static int64_t whole(double number)
{
#ifdef __x86_64__
    int64_t found;
    __asm__("cvtsd2si %1, %0" : "=r"(found) : "x"(number));
    return found;
#else
    const double from = 4503599627370496.0; /* from here on all doubles are whole */
    const double size = number < 0.0 ? -number : number;
    const double rounded = size < from ? (size + from) - from : size;
    return (int64_t)(number < 0.0 ? -rounded : rounded);
#endif
}

/* The lines, see Warp.aim. */
void paddock_aim(const struct view *view, double cos, double sin, double x, double y)
{
    const struct terms *of = view->terms;
    for (struct line *line = view->lines; line < view->lines + view->line_count; line++, of++) {
        line->column = whole((of->column[0] * cos + of->column[1] * sin) + (of->column[2] * x + of->column[3]));
        line->row = whole((of->row[0] * cos + of->row[1] * sin) + (of->row[2] * y + of->row[3]));
        line->column_step = whole(of->column_step[0] * cos + of->column_step[1] * sin);
        line->row_step = whole(of->row_step[0] * cos + of->row_step[1] * sin);
    }
}

/* Both, in one call. */
void paddock_see(const struct view *view, double cos, double sin, double x, double y, uint8_t *frame)
{
    paddock_aim(view, cos, sin, x, y);
    paddock_warp(view, frame);
}
