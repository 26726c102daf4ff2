/* Inner loops of resolution studies, for any robot whose C file gives its distinct signals.

    fused_states      median-filtered positions -> q, qd, qdd: low-pass forward and backward, central differences (runtime/signals/filters.py)
    fused_gather      rows of q, qd, qdd from these
    fused_decimated   states -> signals -> kept samples of the zero-phase decimation (folding.py); the signals are never stored

Signals are rows of samples, U[s*stride + t]. All memory comes from the caller and nothing is kept between calls, so any number of threads may work, each on its own arrays. Functions return 0, 1 for arguments that cannot be, 2 where the
signals of the robot refuse theirs. Compile with -ffp-contract=fast, never with -ffast-math; -DPORTABLE leaves out what is for
one processor, -DSCALAR vector types too.
*/

#ifndef KERNELS
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define ABI 4
#define STATE 8   /* real numbers of a state of the decimation filter, of order 8; also the most kept samples of a block */
#define LANES 8   /* joints filtered together */
#define MOST 10   /* second-order sections of a low-pass */
#define CHUNK 256 /* samples that all sections of a low-pass treat in turn */
#define FOLD 32   /* pairs of samples that the decimation adds up at once */
#define SMALLER(a, b) ((a) < (b) ? (a) : (b))

/* What takes time is written once, for vectors of WIDTH numbers, and read in once for each width: see KERNELS. */
#if defined(__GNUC__) && !defined(SCALAR)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif
#if defined(__GNUC__) && defined(__x86_64__) && !defined(PORTABLE) && !defined(SCALAR)
#define WIDER
#endif

/* A product that has passed here is rounded before it is summed, not fused with the sum: filters agree with scipy in every bit. */
#ifdef WIDER
#define ROUNDED(x) __asm__("" : "+v"(x))
#else
#define ROUNDED(x) ((void)(x))
#endif

typedef int32_t signals_of(int64_t m, const double *q, const double *qd, const double *qdd, int64_t stride, const double *constants,
                           double *U, int64_t ustride);

/* Low-pass of `sections` second-order sections, at most MOST: sos (sections, 6), steady state zi (sections, 2), both as scipy gives them. 0: none. */
struct lowpass {
    int64_t sections, pad;
    const double *sos, *zi;
};

/* Positions, given (groups, N, LANES), moved by +step or -step as bit t*n + j of up, its high bits first, is 1 or 0, if it is there; filtered
positions, velocities and accelerations, (groups, N + 2 pad, LANES), the N samples in the middle. up: one byte more than its bits fill. pad: the larger
one of the two filters. ends: differences there are 1 one-sided, 2 of second order. */
struct states {
    int64_t N, n, pad, ends;
    double rate, step;
    struct lowpass on_q, on_qd;
    const double *given;
    const uint8_t *up;
    double *q, *qd, *qdd;
};

/* Signals of the robot: of `count`, S are wanted, a multiple of LANES. They are evaluated `tile` samples at a time, in scratch: U (count, tile), rows
(3, n, tile). The wanted ones are kept for up to `length` samples: sample t of the s-th is u[s*stride + t], with LANES numbers before and behind. */
struct source {
    signals_of *signals;
    const double *constants;
    int64_t count, S, tile, length, stride;
    const int32_t *wanted;
    double *U, *rows, *u;
};

/* Zero-phase decimation of N samples from `begin` on (folding.py): blocks from `phase` on, each of G kept samples and the
`factor` - 1 samples behind each of them, of which `most` are evaluated together. The state x runs forward, v back; k counts kept samples, t those of
an interval, s_t and a_t are sum and difference of u_t and u_(factor - 1 - t).

    [sigma; alpha] = [pairs(0)'s; pairs(1)'a]       x_(k+1) = lambda x_k + sigma - alpha       v_(k-1) = lambda v_k + sigma + alpha
    y_k = direct u_0 + along'x_k + behind'v_(k-1)

A block ends with v = 0; what its v changes, back'v, is added on the way back. x at the first kept sample is start'u of the first samples, v behind the
last block and y of the `rest` of kept samples are end'[u of the last samples; x]. States are real parts, then imaginary parts; outputs are filled up
with zeros to whole states.

modes: rows lambda (real parts twice), lambda (imaginary parts, those that are subtracted negative), along, behind, STATE numbers each. pairs (half,
2 STATE), half being (factor + 1)/2. start (first, STATE), back (STATE, 2 STATE), end (final + STATE, 2 STATE). d (blocks, S, 2 STATE), x (S, STATE); y (S, ystride) receives
the kept samples.
*/
struct decimation {
    int64_t begin, N, phase, factor, G, blocks, most, first, final, rest, ystride;
    double direct;
    const double *modes, *pairs, *start, *back, *end;
    double *d, *x, *y;
};

int32_t fused_states(const struct states *a);
int32_t fused_gather(const struct states *a, int64_t t, int64_t m, double *q, double *qd, double *qdd, int64_t stride);
int32_t fused_decimated(const struct states *states, const struct source *from, const struct decimation *a);
int32_t fused_abi(void);
void fused_layout(int64_t layout[4]);

/* What takes time, for one width of vectors. */
struct kernels {
    void (*moved)(const struct states *a, int64_t j, int64_t t, int64_t m, double *x);
    void (*zero_phase)(const struct states *a, int64_t j, const struct lowpass *f, double *x, double *dx);
    void (*rows)(const double *x, int64_t m, int64_t used, double *to, int64_t stride);
    void (*keep)(const struct source *a, int64_t p, int64_t m);
    void (*block)(const struct decimation *a, const struct source *from, int64_t p, double *d);
    void (*begin)(const struct decimation *a, const struct source *from);
    void (*finish)(const struct decimation *a, const struct source *from);
    void (*backward)(const struct decimation *a, int64_t S);
};

/* States of all sections in the steady state of the sample x. */
static void steady(const struct lowpass *f, const double *x, double (*z)[LANES])
{
    for (int64_t s = 0; s < 2*f->sections; s++)
        for (int l = 0; l < LANES; l++)
            z[s][l] = f->zi[s]*x[l];
}

#define KERNELS
#if defined(WIDER) && defined(DOUBLES) && DOUBLES == 8 /* compiled for this processor: its width alone, in two thirds of the time */
#define WIDEST
#else
#define NAME(x) x##_plain
#define TARGET
#define TOGETHER 1
#if defined(__GNUC__) && !defined(SCALAR)
#define WIDTH 2
#else
#define WIDTH 1
#endif
#include "kernels.c"
#endif
#if defined(WIDER) && !defined(WIDEST)
#define NAME(x) x##_fma
#define TARGET __attribute__((target("fma")))
#define TOGETHER 2
#define WIDTH 4
#include "kernels.c"
#endif
#ifdef WIDER
#define NAME(x) x##_avx512
#define TARGET __attribute__((target("avx512f")))
#define TOGETHER 8
#define WIDTH 8
#include "kernels.c"
#endif

/* Those of this processor. */
static const struct kernels *best(void)
{
#ifdef WIDEST
    return &kernels_avx512;
#else
#ifdef WIDER
    if (__builtin_cpu_supports("avx512f"))
        return &kernels_avx512;
    if (__builtin_cpu_supports("fma"))
        return &kernels_fma;
#endif
    return &kernels_plain;
#endif
}

/* ------------------------------------------------------------------------------------------------------------------------- states */

/* One sample of the difference. */
INLINE void slope(const double *x, int64_t t, int64_t N, double h, int64_t ends, double *restrict dx)
{
    const double *now = x + t*LANES;
    for (int l = 0; l < LANES; l++)
        if (t > 0 && t < N - 1)
            dx[l] = (now[l + LANES] - now[l - LANES])/(2.0*h);
        else if (ends == 1)
            dx[l] = t ? (now[l] - now[l - LANES])/h : (now[l + LANES] - now[l])/h;
        else if (t)
            dx[l] = 0.5/h*now[l - 2*LANES] + -2.0/h*now[l - LANES] + 1.5/h*now[l];
        else
            dx[l] = -1.5/h*now[l] + 2.0/h*now[l + LANES] + -0.5/h*now[l + 2*LANES];
}

/* The filter, if there is one, of x, and the differences of what it gives. j: joint from which on moved positions take the place of x; -1: none. */
static void filtered_slope(const struct states *a, int64_t j, const struct lowpass *f, double *x, double *dx)
{
    const struct kernels *const use = best();
    if (f->sections)
        use->zero_phase(a, j, f, x, dx);
    else if (j >= 0)
        use->moved(a, j, 0, a->N, x);
    for (int64_t t = 0; t < a->N; t += f->sections ? a->N - 1 : 1)
        slope(x, t, a->N, 1.0/a->rate, a->ends, dx + t*LANES);
}

/* Whether a filter has more sections or fewer samples of padding than there is room for. */
static int refused(const struct lowpass *f, int64_t pad)
{
    return f->sections > MOST || f->pad > pad || (f->sections && f->pad < 2);
}

int32_t fused_states(const struct states *a)
{
    const int64_t N = a->N, size = (N + 2*a->pad)*LANES;
    if (a->n < 1 || a->ends < 1 || a->ends > 2 || N <= a->ends || N <= a->pad
        || refused(&a->on_q, a->pad) || refused(&a->on_qd, a->pad))
        return 1;
    for (int64_t j = 0, first = a->pad*LANES; j < a->n; j += LANES, first += size) {
        filtered_slope(a, j, &a->on_q, a->q + first, a->qd + first);
        filtered_slope(a, -1, &a->on_qd, a->qd + first, a->qdd + first);
    }
    return 0;
}

/* Samples t .. t + m - 1 of q, qd and qdd, rows `stride` apart. */
static void gather(const struct states *a, int64_t t, int64_t m, double *q, double *qd, double *qdd, int64_t stride)
{
    const struct kernels *const use = best();
    const double *const from[3] = {a->q, a->qd, a->qdd};
    double *const to[3] = {q, qd, qdd};
    for (int64_t j = 0; j < a->n; j += LANES) {
        const int64_t first = (j/LANES*(a->N + 2*a->pad) + a->pad + t)*LANES, used = a->n - j < LANES ? a->n - j : LANES;
        for (int k = 0; k < 3; k++)
            use->rows(from[k] + first, m, used, to[k] + j*stride, stride);
    }
}

int32_t fused_gather(const struct states *a, int64_t t, int64_t m, double *q, double *qd, double *qdd, int64_t stride)
{
    if (t < 0 || m < 0 || t + m > a->N || stride < m)
        return 1;
    gather(a, t, m, q, qd, qdd, stride);
    return 0;
}

/* --------------------------------------------------------------------------------------------------------------------- decimation */

/* The signals of samples t .. t + m - 1. */
static int32_t evaluate(const struct states *states, const struct source *a, int64_t t, int64_t m)
{
    double *q = a->rows, *qd = q + states->n*a->tile, *qdd = qd + states->n*a->tile;
    const struct kernels *const use = best();
    for (int64_t p = 0; p < m; p += a->tile) {
        const int64_t part = SMALLER(a->tile, m - p);
        gather(states, t + p, part, q, qd, qdd, a->tile);
        if (a->signals(part, q, qd, qdd, a->tile, a->constants, a->U, a->tile))
            return 2;
        use->keep(a, p, part);
    }
    return 0;
}

int32_t fused_decimated(const struct states *states, const struct source *from, const struct decimation *a)
{
    const int64_t L = a->G*a->factor, kept = a->blocks*a->G + a->rest;
    if (a->begin < 0 || a->begin + a->N > states->N || a->factor < 2 || a->G < 1 || a->G > STATE || a->rest > STATE || a->most < 1
        || a->most*L > from->length || a->first > from->length || a->final > from->length || a->first > a->N || a->final > a->N
        || a->phase + a->blocks*L > a->N || a->ystride < kept || from->S%LANES)
        return 1;
    const struct kernels *const use = best();
    int32_t status = evaluate(states, from, a->begin, a->first);
    if (!status)
        use->begin(a, from);
    for (int64_t b = 0; b < a->blocks && !status; b += a->most) {
        const int64_t some = a->blocks - b < a->most ? a->blocks - b : a->most;
        status = evaluate(states, from, a->begin + a->phase + b*L, some*L);
        for (int64_t i = 0; i < some && !status; i++)
            use->block(a, from, i*L, a->d + (b + i)*from->S*2*STATE);
    }
    if (!status)
        status = evaluate(states, from, a->begin + a->N - a->final, a->final);
    if (status)
        return status;
    use->finish(a, from);
    use->backward(a, from->S);
    return 0;
}

int32_t fused_abi(void) { return ABI; }

/* LANES and the sizes of the structures: what a caller must agree on. */
void fused_layout(int64_t layout[4])
{
    const int64_t found[4] = {LANES, (int64_t)sizeof(struct states), (int64_t)sizeof(struct source), (int64_t)sizeof(struct decimation)};
    memcpy(layout, found, sizeof found);
}

#else /* KERNELS, for vectors of WIDTH numbers in functions NAME(...) for processors TARGET, `TOGETHER` signals at a time */

#if WIDTH > 1
typedef double NAME(V) __attribute__((vector_size(8*WIDTH), aligned(8), may_alias));
#else
typedef double NAME(V);
#endif
#define AT(p) (*(NAME(V) *)(p))
#define FROM(p) (*(const NAME(V) *)(p))

/* Positions of the group of joints from j on, samples t .. t + m - 1, moved. */
TARGET static void NAME(moved)(const struct states *a, int64_t j, int64_t t, int64_t m, double *restrict x)
{
    static const int64_t bit_of[LANES] = {128, 64, 32, 16, 8, 4, 2, 1};
    const double *given = a->given + j*a->N + t*LANES, step = a->step;
    if (!a->up)
        memcpy(x, given, (size_t)(m*LANES)*sizeof *x);
    for (uint64_t bit = (uint64_t)(t*a->n + j); a->up && m > 0; m--, bit += (uint64_t)a->n, given += LANES, x += LANES) {
        const int64_t up = (a->up[bit/8] << 8 | a->up[bit/8 + 1]) >> (8 - bit%8);
        for (int l = 0; l < LANES; l++) /* no branch on a bit: its outcome is random */
            x[l] = given[l] + (up & bit_of[l] ? step : -step);
    }
}

/* a*x, rounded. */
TARGET INLINE NAME(V) NAME(times)(double a, NAME(V) x)
{
    x *= a;
    ROUNDED(x);
    return x;
}

/* `count` sections, direct form II transposed, over R samples `step` apart, from state z on. dx, unless NULL: differences of a pass back,
(x_(t + 1) - x_(t - 1))/width. They are free beside the filter, which waits for itself. */
TARGET INLINE void NAME(sections)(double *x, int64_t R, const ptrdiff_t step, const double *sos, double (*z)[LANES], int l,
                                  const int count, double *restrict dx, double width)
{
    double c[12];
    NAME(V) state[4];
    memcpy(c, sos, (size_t)(6*count)*sizeof *c);
    for (int s = 0; s < 2*count; s++)
        state[s] = FROM(z[s] + l);
    for (int64_t t = 0; t < R; t++, x += step) {
        NAME(V) u = FROM(x);
        for (int s = 0; s < count; s++) {
            const double *b = c + 6*s, *a = b + 3;
            const NAME(V) y = NAME(times)(b[0], u) + state[2*s];
            state[2*s] = NAME(times)(b[1], u) - NAME(times)(a[1], y) + state[2*s + 1];
            state[2*s + 1] = NAME(times)(b[2], u) - NAME(times)(a[2], y);
            u = y;
        }
        AT(x) = u;
        if (dx) {
            AT(dx) = (FROM(x - 2*step) - u)/width;
            dx += step;
        }
    }
    for (int s = 0; s < 2*count; s++)
        AT(z[s] + l) = state[s];
}

/* All sections of a filter, two at a time, over R samples of LANES joints. */
TARGET INLINE void NAME(pass)(const struct lowpass *f, double *x, int64_t R, const ptrdiff_t step, double (*z)[LANES], double *dx,
                              double width)
{
    for (int64_t s = 0; s < f->sections; s += 2)
        for (int l = 0; l < LANES; l += WIDTH) {
            double *slopes = dx && s + 2 >= f->sections ? dx + l : NULL;
            if (s + 1 == f->sections)
                NAME(sections)(x + l, R, step, f->sos + 6*s, z + 2*s, l, 1, slopes, width);
            else
                NAME(sections)(x + l, R, step, f->sos + 6*s, z + 2*s, l, 2, slopes, width);
        }
}

/* Forward and back over N samples of LANES joints in pieces that stay in cache, and the central differences of the result; f->pad samples on
either side of x and dx are there for the odd reflections. */
TARGET static void NAME(zero_phase)(const struct states *a, int64_t j, const struct lowpass *f, double *x, double *dx)
{
    const int64_t N = a->N, pad = f->pad;
    const double width = 2.0*(1.0/a->rate);
    double z[2*MOST][LANES];
    if (j >= 0) {
        NAME(moved)(a, j, 0, pad + 1, x);
        NAME(moved)(a, j, N - 1 - pad, pad + 1, x + (N - 1 - pad)*LANES);
    }
    for (int64_t t = 1; t <= pad; t++)
        for (int l = 0; l < LANES; l++) {
            x[l - t*LANES] = 2.0*x[l] - x[l + t*LANES];
            x[(N - 1 + t)*LANES + l] = 2.0*x[(N - 1)*LANES + l] - x[(N - 1 - t)*LANES + l];
        }
    steady(f, x - pad*LANES, z);
    for (int64_t t = -pad, m; t < N + pad; t += m) {
        m = t < 0 ? pad : t < N ? SMALLER(CHUNK, N - t) : pad;
        if (j >= 0 && t >= 0 && t < N)
            NAME(moved)(a, j, t, m, x + t*LANES);
        NAME(pass)(f, x + t*LANES, m, LANES, z, NULL, 0.0);
    }
    steady(f, x + (N - 1 + pad)*LANES, z);
    NAME(pass)(f, x + (N - 1 + pad)*LANES, pad, -LANES, z, NULL, 0.0);
    for (int64_t t = N, m; t > 0; t -= m) {
        m = SMALLER(CHUNK, t);
        NAME(pass)(f, x + (t - 1)*LANES, m, -LANES, z, dx + t*LANES, width);
    }
}

/* Parts of two vectors in turn; a vector from its end on; the imaginary parts of part i of a state x where real ones are, and the other way round. */
#if WIDTH == STATE
#define OTHER(x, i) (NAME(V)){x[i][4], x[i][5], x[i][6], x[i][7], x[i][0], x[i][1], x[i][2], x[i][3]}
#else
#define OTHER(x, i) x[(i) ^ STATE/WIDTH/2]
#endif
#if WIDTH == 8
#define LOW(a, b) (NAME(V)){a[0], b[0], a[1], b[1], a[2], b[2], a[3], b[3]}
#define HIGH(a, b) (NAME(V)){a[4], b[4], a[5], b[5], a[6], b[6], a[7], b[7]}
#define REVERSED(a) (NAME(V)){a[7], a[6], a[5], a[4], a[3], a[2], a[1], a[0]}
#elif WIDTH == 4
#define LOW(a, b) (NAME(V)){a[0], b[0], a[1], b[1]}
#define HIGH(a, b) (NAME(V)){a[2], b[2], a[3], b[3]}
#define REVERSED(a) (NAME(V)){a[3], a[2], a[1], a[0]}
#elif WIDTH == 2
#define LOW(a, b) (NAME(V)){a[0], b[0]}
#define HIGH(a, b) (NAME(V)){a[1], b[1]}
#define REVERSED(a) (NAME(V)){a[1], a[0]}
#else
#define REVERSED(a) (a)
#endif

/* m samples of x, shape (m, LANES), as `used` rows of `to`, `stride` apart. */
TARGET static void NAME(rows)(const double *x, int64_t m, int64_t used, double *to, int64_t stride)
{
    int64_t t = 0;
#if WIDTH > 1
    for (; t + WIDTH <= m; t += WIDTH, x += WIDTH*LANES)
        for (int l = 0; l < LANES; l += WIDTH) {
            NAME(V) row[WIDTH], next[WIDTH];
            for (int i = 0; i < WIDTH; i++)
                row[i] = FROM(x + i*LANES + l);
            for (int half = WIDTH; half > 1; half /= 2) { /* a square of numbers, transposed */
                for (int i = 0; i < WIDTH/2; i++) {
                    next[2*i] = LOW(row[i], row[i + WIDTH/2]);
                    next[2*i + 1] = HIGH(row[i], row[i + WIDTH/2]);
                }
                memcpy(row, next, sizeof row);
            }
            for (int i = 0; i < WIDTH && l + i < used; i++)
                AT(to + (l + i)*stride + t) = row[i];
        }
#endif
    for (; t < m; t++, x += LANES)
        for (int64_t l = 0; l < used; l++)
            to[l*stride + t] = x[l];
}

/* sum += M'u: M (length, outs). */
TARGET INLINE void NAME(product)(const double *u, int64_t length, const double *M, NAME(V) *sum, const int outs)
{
    for (int64_t i = 0; i < length; i++, M += outs)
        for (int v = 0; v < outs/WIDTH; v++)
            sum[v] += FROM(M + v*WIDTH)*u[i];
}

/* Samples p .. p + m - 1 of the wanted signals, from the tile where they have just been evaluated. */
TARGET static void NAME(keep)(const struct source *a, int64_t p, int64_t m)
{
    for (int64_t s = 0; s < a->S; s++) {
        const double *row = a->U + a->wanted[s]*a->tile;
        double *u = a->u + s*a->stride + p;
        int64_t t = 0;
        for (; t + WIDTH <= m; t += WIDTH)
            AT(u + t) = FROM(row + t);
        for (; t < m; t++)
            u[t] = row[t];
    }
}

/* u_t + u_(m - 1 - t) and u_t - u_(m - 1 - t) for `count` samples t from `first` on. */
TARGET INLINE void NAME(fold)(const double *u, int64_t m, int64_t first, int64_t count, double (*folded)[FOLD])
{
    for (int64_t t = 0; t < count; t += WIDTH) {
        const NAME(V) near = FROM(u + first + t), back = FROM(u + m - first - t - WIDTH), far = REVERSED(back);
        AT(folded[0] + t) = near + far;
        AT(folded[1] + t) = near - far;
    }
}

/* Sums of WIDTH states. */
TARGET INLINE NAME(V) NAME(totals)(NAME(V) (*x)[STATE/WIDTH])
{
    NAME(V) sum[WIDTH];
    for (int k = 0; k < WIDTH; k++) {
        sum[k] = x[k][0];
        for (int v = 1; v < STATE/WIDTH; v++)
            sum[k] += x[k][v];
    }
#if WIDTH > 1
    for (int half = WIDTH/2; half > 0; half /= 2)
        for (int k = 0; k < half; k++)
            sum[k] = LOW(sum[k], sum[k + half]) + HIGH(sum[k], sum[k + half]);
#endif
    return sum[0];
}

/* lambda x, for part i of a state x. */
TARGET INLINE NAME(V) NAME(turned)(const double *modes, const NAME(V) *x, int i)
{
    const int v = i*WIDTH;
    return FROM(modes + v)*x[i] + FROM(modes + STATE + v)*OTHER(x, i);
}

/* One block of TOGETHER signals from s on, from sample p on: v, y of its kept samples, in d; x. */
TARGET INLINE void NAME(forward)(const struct decimation *a, const struct source *from, int64_t s, int64_t p, double *d)
{
    enum { PARTS = STATE/WIDTH };
    const int64_t m = a->factor, half = (m + 1)/2;
    const double *modes = a->modes, *u = from->u + s*from->stride + p;
    double folded[TOGETHER][2][FOLD];
    NAME(V) x[TOGETHER][PARTS], q[TOGETHER][STATE][PARTS], y[TOGETHER][STATE][PARTS];
    memcpy(x, a->x + s*STATE, sizeof x);
    memset(y, 0, sizeof y);
    for (int64_t k = 0; k < a->G; k++) {
        NAME(V) sum[2*PARTS][TOGETHER];
        for (int v = 0; v < 2*PARTS; v++)
            for (int i = 0; i < TOGETHER; i++)
                sum[v][i] = (NAME(V)){0};
        for (int64_t first = 0; first < half; first += FOLD) {
            const int64_t count = SMALLER(FOLD, half - first);
            for (int i = 0; i < TOGETHER; i++)
                NAME(fold)(u + i*from->stride + k*m, m, first, count, folded[i]);
            const double *pairs = a->pairs + 2*STATE*first;
            for (int64_t t = 0; t < count; t++, pairs += 2*STATE)
                for (int v = 0; v < 2*PARTS; v++) {
                    const NAME(V) pair = FROM(pairs + v*WIDTH);
                    for (int i = 0; i < TOGETHER; i++)
                        sum[v][i] += pair*folded[i][v/PARTS][t];
                }
        }
        for (int i = 0; i < TOGETHER; i++) {
            NAME(V) next[PARTS];
            for (int v = 0; v < PARTS; v++) {
                q[i][k][v] = sum[v][i] + sum[PARTS + v][i];
                y[i][k][v] = FROM(modes + 2*STATE + v*WIDTH)*x[i][v];
                next[v] = NAME(turned)(modes, x[i], v) + (sum[v][i] - sum[PARTS + v][i]);
            }
            memcpy(x[i], next, sizeof next);
        }
    }
    memcpy(a->x + s*STATE, x, sizeof x);
    for (int i = 0; i < TOGETHER; i++, d += 2*STATE) {
        NAME(V) state[PARTS], next[PARTS];
        memset(state, 0, sizeof state);
        for (int64_t k = a->G - 1; k >= 0; k--) {
            for (int v = 0; v < PARTS; v++)
                next[v] = NAME(turned)(modes, state, v) + q[i][k][v];
            for (int v = 0; v < PARTS; v++)
                y[i][k][v] += FROM(modes + 3*STATE + v*WIDTH)*next[v];
            memcpy(state, next, sizeof state);
        }
        memcpy(d, state, sizeof state);
        for (int k = 0; k < STATE; k += WIDTH)
            AT(d + STATE + k) = NAME(totals)(y[i] + k);
        for (int64_t k = 0; k < a->G; k++)
            d[STATE + k] += a->direct*u[i*from->stride + k*m];
    }
}

/* One block of every signal, from sample p on; d is its part. */
TARGET static void NAME(block)(const struct decimation *a, const struct source *from, int64_t p, double *d)
{
    for (int64_t s = 0; s < from->S; s += TOGETHER)
        NAME(forward)(a, from, s, p, d + s*2*STATE);
}

/* The steady state of the padding, and what comes before the first kept sample. */
TARGET static void NAME(begin)(const struct decimation *a, const struct source *from)
{
    for (int64_t s = 0; s < from->S; s++) {
        NAME(V) sum[STATE/WIDTH];
        memset(sum, 0, sizeof sum);
        NAME(product)(from->u + s*from->stride, a->first, a->start, sum, STATE);
        memcpy(a->x + s*STATE, sum, sizeof sum);
    }
}

/* The last samples: their y, and v in place of x. */
TARGET static void NAME(finish)(const struct decimation *a, const struct source *from)
{
    for (int64_t s = 0; s < from->S; s++) {
        const double *x = a->x + s*STATE;
        NAME(V) sum[2*STATE/WIDTH];
        memset(sum, 0, sizeof sum);
        NAME(product)(from->u + s*from->stride, a->final, a->end, sum, 2*STATE);
        NAME(product)(x, STATE, a->end + a->final*2*STATE, sum, 2*STATE);
        memcpy(a->x + s*STATE, sum, STATE*sizeof *a->x);
        memcpy(a->y + s*a->ystride + a->blocks*a->G, sum + STATE/WIDTH, (size_t)a->rest*sizeof *a->y);
    }
}

/* The backward filter, from the last block to the first. */
TARGET static void NAME(backward)(const struct decimation *a, int64_t S)
{
    for (int64_t b = a->blocks - 1; b >= 0; b--)
        for (int64_t s = 0; s < S; s++) {
            const double *v = a->x + s*STATE;
            NAME(V) sum[2*STATE/WIDTH];
            memcpy(sum, a->d + (b*S + s)*2*STATE, sizeof sum);
            NAME(product)(v, STATE, a->back, sum, 2*STATE);
            memcpy(a->x + s*STATE, sum, STATE*sizeof *a->x);
            memcpy(a->y + s*a->ystride + b*a->G, sum + STATE/WIDTH, (size_t)a->G*sizeof *a->y);
        }
}

static const struct kernels NAME(kernels) = {NAME(moved), NAME(zero_phase), NAME(rows), NAME(keep), NAME(block), NAME(begin), NAME(finish), NAME(backward)};

#undef AT
#undef LOW
#undef HIGH
#undef REVERSED
#undef OTHER
#undef FROM
#undef WIDTH
#undef TOGETHER
#undef NAME
#undef TARGET
#endif
