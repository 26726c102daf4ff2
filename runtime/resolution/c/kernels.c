/* Inner loops of resolution studies, for any robot whose C file gives its distinct signals.

    fused_states      median-filtered positions -> q, qd, qdd: low-pass forward and backward, central differences (runtime/observation/filters.py)
    fused_gather      rows of q, qd, qdd from these
    fused_decimated   states -> signals -> kept samples of the zero-phase decimation (runtime/observation/decimation.py); the signals are never stored
    fused_normal      rows -> A_j = [W_j Y_j]'[W_j Y_j] of every joint on its own columns
    fused_residual    rows, X -> W_j'(Y_j - W_j X) and ||Y_j - W_j X||^2: one refinement
    fused_rows        rows of [W_j Y_j] themselves, column by column, for a QR

Signals are rows of samples, U[s*stride + t]; entry e of joint j is sign[e]*U[signal[e]]. All memory comes from the caller and nothing is kept
between calls, so any number of threads may work, each on its own arrays. Functions return 0, 1 for arguments that cannot be, 2 where the
signals of the robot refuse theirs. Compile with -ffp-contract=fast, never with -ffast-math; -DPORTABLE leaves out what is for
one processor, -DSCALAR vector types too.
*/

#ifndef KERNELS
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define ABI 2
#define STATE 8   /* real numbers of a state of the decimation filter, of order 8; also the most kept samples of a block */
#define LANES 8   /* joints filtered together, samples summed together */
#define SIDE 4    /* rows and columns of one tile of a Gram matrix */
#define SPAN 512  /* samples of one block of rows */
#define WHOLE (SIDE*LANES) /* samples that sums take at once, at most */
#define APART (SPAN + LANES)

/* The sums of products are written once, for vectors of WIDTH numbers, and read in once for each width: see KERNELS. The filters of the states
are plain loops and PLAIN: no version of them has an instruction that fuses product and sum, so they agree with scipy in every bit. */
#if defined(__GNUC__) && !defined(SCALAR)
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif
#if defined(__GNUC__) && defined(__x86_64__) && !defined(PORTABLE) && !defined(SCALAR)
#define WIDER
#endif
#if defined(WIDER) && !defined(__clang__) && defined(__GLIBC__)
#define PLAIN __attribute__((target_clones("avx2", "default")))
#else
#define PLAIN
#endif

typedef int32_t signals_of(int64_t m, const double *q, const double *qd, const double *qdd, int64_t stride, const double *constants,
                           double *U, int64_t ustride);

/* Low-pass of `sections` second-order sections: sos (sections, 6), steady state zi (sections, 2), both as scipy gives them. 0: none. */
struct lowpass {
    int64_t sections, pad;
    const double *sos, *zi;
};

/* Positions, given[t*sample + j*joint], moved by +step or -step as up (N, n) says if it is there; filtered positions, velocities and
accelerations, in groups of LANES joints: (groups, N + 2 pad, LANES), the N samples in the middle. pad: the larger one of the two filters. ends: differences there are
1 one-sided, 2 of second order. */
struct states {
    int64_t N, n, sample, joint, pad, ends;
    double rate, step;
    struct lowpass on_q, on_qd;
    const double *given;
    const uint8_t *up;
    double *q, *qd, *qdd;
};

/* Signals of the robot: of `count`, S are wanted. They are evaluated TILE = `tile` samples at a time: sample p of a block of samples is
U[(p/tile*count + s)*tile + p%tile], up to p = length - 1. rows (3, n, tile) is scratch. */
struct source {
    signals_of *signals;
    const double *constants;
    int64_t count, S, tile, length;
    const int32_t *wanted;
    double *U, *rows;
};

/* Zero-phase decimation of N samples from `begin` on by the matrices of runtime/observation/decimation.py: blocks of L samples from `phase` on, each of G
kept ones, of which `most` are evaluated together.

    x_0 = start' u(first samples)     [x_(b+1); d_b; e_b] = block' [u_b; x_b]                       b = 0 .. blocks - 1
    [v_(b-1); y_b] = [d_b; e_b] + back' v_b     with [v; y] of the last samples = end' [u(last samples); x_blocks]

start (first, STATE), block (L + STATE, 3 STATE), back (STATE, 2 STATE), end (final + STATE, 2 STATE): outputs filled up with zeros to whole
states. d (blocks, S, 2 STATE), x (S, STATE); y (S, ystride) receives the kept samples, `rest` of them from the last samples.
*/
struct decimation {
    int64_t begin, N, phase, L, G, blocks, most, first, final, rest, ystride;
    const double *start, *block, *back, *end;
    double *d, *x, *y;
};

/* Entries of the n joints: those of joint j are from[j] .. from[j + 1] - 1, c of them; its torque stands behind the last one.

A: width^2 numbers a joint, width being c + 1 rounded up to SIDE. g: width numbers a joint, g[c] the square of the residual. O: scratch, rows of
SPAN + LANES numbers, as many as the largest width. R: (c + 1, c + 1 + most) a joint, of which rows for a QR fill taken[j] <= most columns
behind the first c + 1.
*/
struct entries {
    int64_t n, most;
    const int32_t *from, *signal;
    const double *sign;
    double *A, *g, *O, *R;
    int64_t *taken;
};

/* m rows: sample t of signal s is U[(t/tile*count + s)*tile + t%tile], torques Y (n, ystride), mask (n, mstride) of rows used, NULL for all. */
struct rows {
    int64_t m, tile, count, ystride, mstride;
    const double *U, *Y;
    const uint8_t *mask;
};

enum task { NORMAL, RESIDUAL, ROWS };

int32_t fused_states(const struct states *a);
int32_t fused_gather(const struct states *a, int64_t t, int64_t m, double *q, double *qd, double *qdd, int64_t stride);
int32_t fused_decimated(const struct states *states, const struct source *from, const struct decimation *a);
int32_t fused_normal(const struct entries *a, const struct rows *r);
int32_t fused_residual(const struct entries *a, const struct rows *r, const double *X);
int32_t fused_rows(const struct entries *a, const struct rows *r);
int32_t fused_abi(void);
void fused_layout(int64_t layout[8]);

/* The sums of products for one width of vectors. */
struct kernels {
    void (*block)(const struct decimation *a, const struct source *from, int64_t p, double *d);
    void (*begin)(const struct decimation *a, const struct source *from);
    void (*finish)(const struct decimation *a, const struct source *from);
    void (*backward)(const struct decimation *a, int64_t S);
    void (*gram)(const double *O, int64_t width, int64_t samples, double *A);
    void (*gradient)(double *O, int64_t c, int64_t samples, const double *X, double *g);
};

#define KERNELS
#if defined(WIDER) && defined(DOUBLES) && DOUBLES == 8 /* compiled for this processor: its width alone, in two thirds of the time */
#define WIDEST
#else
#define NAME(x) x##_plain
#define TARGET
#define TOGETHER 2
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

/* One pass of `count` sections, direct form II transposed, over R samples `step` apart; `first` is the one in whose steady state they start. dx,
unless NULL: differences of a pass back, (x_(t + 1) - x_(t - 1))/width, but for its first two samples. They are free beside the filter, which waits
for itself. */
INLINE void sections(double *x, int64_t R, ptrdiff_t step, const double *sos, const double *zi, const double *first, const int64_t count,
                     double *restrict dx, double width)
{
    double c[12], z[4][LANES];
    memcpy(c, sos, (size_t)(6*count)*sizeof *c);
    for (int64_t s = 0; s < 2*count; s++)
        for (int l = 0; l < LANES; l++)
            z[s][l] = zi[s]*first[l];
    for (int64_t t = 0; t < R; t++, x += step) {
        for (int64_t s = 0; s < count; s++) {
            const double *b = c + 6*s, *a = b + 3;
            for (int l = 0; l < LANES; l++) {
                const double u = x[l], y = b[0]*u + z[2*s][l];
                z[2*s][l] = b[1]*u - a[1]*y + z[2*s + 1][l];
                z[2*s + 1][l] = b[2]*u - a[2]*y;
                x[l] = y;
            }
        }
        if (dx) {
            for (int l = 0; l < LANES && t > 1; l++)
                dx[l] = (x[l + 2*LANES] - x[l])/width;
            dx -= LANES;
        }
    }
}

/* All sections of a filter, two at a time. */
PLAIN static void pass(double *x, int64_t R, ptrdiff_t step, const struct lowpass *f, double *dx, double width)
{
    double first[LANES];
    memcpy(first, x, sizeof first);
    for (int64_t s = 0; s < f->sections; s += 2) {
        const double *sos = f->sos + 6*s, *zi = f->zi + 2*s;
        double *slopes = s + 2 < f->sections ? NULL : dx;
        if (s + 1 == f->sections)
            sections(x, R, step, sos, zi, first, 1, slopes, width);
        else
            sections(x, R, step, sos, zi, first, 2, slopes, width);
    }
}

/* Forward and backward over N samples of LANES joints, and the central differences of the result; `pad` samples on either side of x and dx are
there for the odd reflections. */
static void zero_phase(double *x, int64_t N, const struct lowpass *f, double *dx, double width)
{
    const double *last = x + (N - 1)*LANES;
    for (int64_t t = 1; t <= f->pad; t++)
        for (int l = 0; l < LANES; l++) {
            x[l - t*LANES] = 2.0*x[l] - x[l + t*LANES];
            x[(N - 1 + t)*LANES + l] = 2.0*last[l] - last[l - t*LANES];
        }
    const int64_t R = N + 2*f->pad;
    pass(x - f->pad*LANES, R, LANES, f, NULL, 0.0);
    pass(x + (N - 1 + f->pad)*LANES, R, -LANES, f, dx + (N + f->pad)*LANES, width);
}

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

/* The filter, if there is one, of x, and the differences of what it gives. */
PLAIN static void filtered_slope(double *x, int64_t N, const struct lowpass *f, double rate, int64_t ends, double *dx)
{
    if (f->sections)
        zero_phase(x, N, f, dx, 2.0*(1.0/rate));
    for (int64_t t = 0; t < N; t += f->sections ? N - 1 : 1)
        slope(x, t, N, 1.0/rate, ends, dx + t*LANES);
}

int32_t fused_states(const struct states *a)
{
    const int64_t N = a->N, n = a->n, size = (N + 2*a->pad)*LANES;
    if (n < 1 || a->ends < 1 || a->ends > 2 || N <= a->ends || N <= a->pad || a->on_q.pad > a->pad || a->on_qd.pad > a->pad)
        return 1;
    for (int64_t j = 0, group = 0; j < n; j += LANES, group += size) {
        double *x = a->q + group + a->pad*LANES, *dx = a->qd + group + a->pad*LANES, *ddx = a->qdd + group + a->pad*LANES;
        const int64_t used = n - j < LANES ? n - j : LANES;
        for (int64_t t = 0; t < N; t++) {
            const double *given = a->given + t*a->sample + j*a->joint;
            for (int64_t l = 0; l < used; l++) /* no branch on a bit: its outcome is random */
                x[t*LANES + l] = given[l*a->joint] + (a->up ? a->step*(2*a->up[t*n + j + l] - 1) : 0.0);
            for (int64_t l = used; l < LANES; l++)
                x[t*LANES + l] = 0.0;
        }
        filtered_slope(x, N, &a->on_q, a->rate, a->ends, dx);
        filtered_slope(dx, N, &a->on_qd, a->rate, a->ends, ddx);
    }
    return 0;
}

/* Samples t .. t + m - 1 of q, qd and qdd, rows `stride` apart. */
static void gather(const struct states *a, int64_t t, int64_t m, double *q, double *qd, double *qdd, int64_t stride)
{
    const double *const from[3] = {a->q, a->qd, a->qdd};
    double *const to[3] = {q, qd, qdd};
    for (int64_t j = 0; j < a->n; j += LANES) {
        const int64_t first = (j/LANES*(a->N + 2*a->pad) + a->pad + t)*LANES, used = a->n - j < LANES ? a->n - j : LANES;
        for (int k = 0; k < 3; k++) {
            const double *x = from[k] + first;
            for (int64_t i = 0, part; i < m; i += part, x += part*LANES) {
                part = m - i < LANES ? m - i : LANES;
                for (int64_t l = 0; l < used; l++)
                    for (int64_t p = 0; p < part; p++)
                        to[k][(j + l)*stride + i + p] = x[p*LANES + l];
            }
        }
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
    for (int64_t p = 0; p < m; p += a->tile) {
        const int64_t part = m - p < a->tile ? m - p : a->tile;
        gather(states, t + p, part, q, qd, qdd, a->tile);
        if (a->signals(part, q, qd, qdd, a->tile, a->constants, a->U + p*a->count, a->tile))
            return 2;
    }
    return 0;
}

int32_t fused_decimated(const struct states *states, const struct source *from, const struct decimation *a)
{
    const int64_t kept = a->blocks*a->G + a->rest, longest = a->most*a->L > a->first ? a->most*a->L : a->first;
    if (a->begin < 0 || a->begin + a->N > states->N || a->G < 1 || a->G > STATE || a->rest > STATE || a->most < 1 || longest > from->length
        || a->final > from->length || a->first > a->N || a->final > a->N || a->phase + a->blocks*a->L > a->N || a->ystride < kept)
        return 1;
    const struct kernels *const use = best();
    int32_t status = evaluate(states, from, a->begin, a->first);
    if (!status)
        use->begin(a, from);
    for (int64_t b = 0; b < a->blocks && !status; b += a->most) {
        const int64_t some = a->blocks - b < a->most ? a->blocks - b : a->most;
        status = evaluate(states, from, a->begin + a->phase + b*a->L, some*a->L);
        for (int64_t i = 0; i < some && !status; i++)
            use->block(a, from, i*a->L, a->d + (b + i)*from->S*2*STATE);
    }
    if (!status)
        status = evaluate(states, from, a->begin + a->N - a->final, a->final);
    if (status)
        return status;
    use->finish(a, from);
    use->backward(a, from->S);
    return 0;
}

/* ------------------------------------------------------------------------------------------------------------------ least squares */

/* The rows of joint j that are used, signs applied, torque last: `out` (width, stride); returns their number. */
static int64_t used_rows(const struct entries *a, const struct rows *r, int64_t j, int64_t t, int64_t m, double *out, int64_t stride)
{
    const uint8_t *mask = r->mask ? r->mask + j*r->mstride + t : NULL;
    const int64_t c = a->from[j + 1] - a->from[j];
    int32_t used[SPAN];
    int64_t count = 0;
    for (int32_t i = 0; i < m; i++) {
        used[count] = i;
        count += mask ? mask[i] != 0 : 1;
    }
    for (int64_t k = 0; k <= c; k++, out += stride) {
        const int32_t e = a->from[j] + (int32_t)k;
        const double *u = k < c ? r->U + (t/r->tile*r->count + a->signal[e])*r->tile + t%r->tile : r->Y + j*r->ystride + t;
        const double sign = k < c ? a->sign[e] : 1.0;
        if (count == m)
            for (int64_t i = 0; i < m; i++)
                out[i] = sign*u[i];
        else
            for (int64_t i = 0; i < count; i++)
                out[i] = sign*u[used[i]];
    }
    return count;
}

/* One task on m rows; X: parameters by entry. */
static void work(enum task task, const struct entries *a, const struct rows *r, const double *X)
{
    double *A = a->A, *g = a->g, *R = a->R;
    const struct kernels *const use = best();
    for (int64_t j = 0; j < a->n; j++) {
        const int64_t c = a->from[j + 1] - a->from[j], width = (c + 1 + SIDE - 1)/SIDE*SIDE;
        for (int64_t t = 0; t < r->m; t += SPAN) {
            const int64_t m = r->m - t < SPAN ? r->m - t : SPAN;
            int64_t count = 0;
            for (int64_t p = t, part; p < t + m; p += part) {
                const int64_t left = r->tile - p%r->tile;
                part = left < t + m - p ? left : t + m - p;
                if (task == ROWS)
                    a->taken[j] += used_rows(a, r, j, p, part, R + c + 1 + a->taken[j], c + 1 + a->most);
                else
                    count += used_rows(a, r, j, p, part, a->O + count, APART);
            }
            if (task == ROWS)
                continue;
            const int64_t full = (count + WHOLE - 1)/WHOLE*WHOLE;
            for (int64_t k = 0; k <= c; k++)
                memset(a->O + k*APART + count, 0, (size_t)(full - count)*sizeof *a->O);
            for (int64_t k = c + 1; k < width; k++)
                memset(a->O + k*APART, 0, (size_t)full*sizeof *a->O);
            if (task == NORMAL)
                use->gram(a->O, width, full, A);
            else
                use->gradient(a->O, c, full, X + a->from[j], g);
        }
        A += width*width;
        g += width;
        R += (c + 1)*(c + 1 + a->most);
    }
}

/* Rows for a QR. */
int32_t fused_rows(const struct entries *a, const struct rows *r)
{
    if (r->m > a->most)
        return 1;
    work(ROWS, a, r, NULL);
    return 0;
}

int32_t fused_normal(const struct entries *a, const struct rows *r)
{
    work(NORMAL, a, r, NULL);
    return 0;
}

int32_t fused_residual(const struct entries *a, const struct rows *r, const double *X)
{
    work(RESIDUAL, a, r, X);
    return 0;
}

int32_t fused_abi(void) { return ABI; }

/* LANES, SIDE, SPAN and the sizes of the structures: what a caller must agree on. */
void fused_layout(int64_t layout[8])
{
    const int64_t found[8] = {LANES, SIDE, SPAN, (int64_t)sizeof(struct states), (int64_t)sizeof(struct source),
                              (int64_t)sizeof(struct decimation), (int64_t)sizeof(struct entries), (int64_t)sizeof(struct rows)};
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

/* sum += M' u for `signals` rows of u: M (length, outs), sum (signals, outs). */
TARGET INLINE void NAME(product)(const double *const *u, int64_t length, const double *M, NAME(V) *sum, const int signals, const int outs)
{
    for (int64_t i = 0; i < length; i++, M += outs)
        for (int v = 0; v < outs/WIDTH; v++) {
            const NAME(V) m = FROM(M + v*WIDTH);
            for (int s = 0; s < signals; s++)
                sum[s*(outs/WIDTH) + v] += m*u[s][i];
        }
}

/* sum += M' u for the wanted signals s, s + 1, ... at samples p .. p + length - 1, tile by tile. */
TARGET INLINE void NAME(over_tiles)(const struct source *from, int64_t s, int64_t p, int64_t length, const double *M, NAME(V) *sum,
                                    const int signals, const int outs)
{
    const double *u[TOGETHER];
    while (length > 0) {
        const int64_t start = p%from->tile, left = from->tile - start, part = left < length ? left : length;
        for (int i = 0; i < signals; i++)
            u[i] = from->U + (p/from->tile*from->count + from->wanted[s + i])*from->tile + start;
        NAME(product)(u, part, M, sum, signals, outs);
        p += part;
        length -= part;
        M += part*outs;
    }
}

/* One block of `signals` signals from sample p on: what the way back needs, d, and the next state, x. */
TARGET INLINE void NAME(forward)(const struct decimation *a, const struct source *from, int64_t s, int64_t p, double *d, const int signals)
{
    NAME(V) sum[TOGETHER*3*STATE/WIDTH];
    const double *state[TOGETHER];
    double *x = a->x + s*STATE;
    memset(sum, 0, sizeof sum);
    for (int i = 0; i < signals; i++)
        state[i] = x + i*STATE;
    NAME(over_tiles)(from, s, p, a->L, a->block, sum, signals, 3*STATE);
    NAME(product)(state, STATE, a->block + a->L*3*STATE, sum, signals, 3*STATE);
    for (int i = 0; i < signals; i++) {
        memcpy(x + i*STATE, sum + i*3*STATE/WIDTH, STATE*sizeof *x);
        memcpy(d + (s + i)*2*STATE, sum + (3*i + 1)*STATE/WIDTH, 2*STATE*sizeof *d);
    }
}

/* One block of every signal, from sample p on; d is its part. */
TARGET static void NAME(block)(const struct decimation *a, const struct source *from, int64_t p, double *d)
{
    int64_t s = 0;
    for (; s + TOGETHER <= from->S; s += TOGETHER)
        NAME(forward)(a, from, s, p, d, TOGETHER);
    for (; s < from->S; s++)
        NAME(forward)(a, from, s, p, d, 1);
}

/* The steady state of the padding, and what comes before the first kept sample. */
TARGET static void NAME(begin)(const struct decimation *a, const struct source *from)
{
    for (int64_t s = 0; s < from->S; s++) {
        NAME(V) sum[STATE/WIDTH];
        memset(sum, 0, sizeof sum);
        NAME(over_tiles)(from, s, 0, a->first, a->start, sum, 1, STATE);
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
        NAME(over_tiles)(from, s, 0, a->final, a->end, sum, 1, 2*STATE);
        NAME(product)(&x, STATE, a->end + a->final*2*STATE, sum, 1, 2*STATE);
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
            NAME(product)(&v, STATE, a->back, sum, 1, 2*STATE);
            memcpy(a->x + s*STATE, sum, STATE*sizeof *a->x);
            memcpy(a->y + s*a->ystride + b*a->G, sum + STATE/WIDTH, (size_t)a->G*sizeof *a->y);
        }
}

TARGET INLINE double NAME(total)(const NAME(V) *sum)
{
    double part[WIDTH], all = 0.0;
    memcpy(part, sum, sizeof part);
    for (int l = 0; l < WIDTH; l++)
        all += part[l];
    return all;
}

/* A += O O' in tiles of SIDE, those below the diagonal for both sides; samples in whole vectors. */
TARGET static void NAME(gram)(const double *O, int64_t width, int64_t samples, double *A)
{
    for (int64_t i = 0; i < width; i += SIDE)
        for (int64_t k = 0; k <= i; k += SIDE) {
            NAME(V) sum[SIDE*SIDE];
            memset(sum, 0, sizeof sum);
            for (int64_t t = 0; t < samples; t += WIDTH)
                for (int p = 0; p < SIDE; p++) {
                    const NAME(V) o = FROM(O + (i + p)*APART + t);
                    for (int r = 0; r < SIDE; r++)
                        sum[SIDE*p + r] += o*FROM(O + (k + r)*APART + t);
                }
            for (int p = 0; p < SIDE*SIDE; p++) {
                const int64_t row = i + p/SIDE, column = k + p%SIDE;
                const double all = NAME(total)(sum + p);
                A[row*width + column] += all;
                if (k < i)
                    A[column*width + row] += all;
            }
        }
}

/* g += O (y - O'X); what is in brackets takes the place of y, the last of c + 1 rows of O, so that g[c] gets its square. */
TARGET static void NAME(gradient)(double *O, int64_t c, int64_t samples, const double *X, double *g)
{
    double *y = O + c*APART;
    for (int64_t t = 0; t < samples; t += SIDE*WIDTH) {
        NAME(V) rest[SIDE];
        memcpy(rest, y + t, sizeof rest);
        for (int64_t k = 0; k < c; k++)
            for (int v = 0; v < SIDE; v++)
                rest[v] -= X[k]*FROM(O + k*APART + t + v*WIDTH);
        memcpy(y + t, rest, sizeof rest);
    }
    for (int64_t k = 0; k <= c; k += SIDE) {
        NAME(V) sum[SIDE];
        memset(sum, 0, sizeof sum);
        for (int64_t t = 0; t < samples; t += WIDTH) {
            const NAME(V) rest = FROM(y + t);
            for (int r = 0; r < SIDE; r++)
                sum[r] += FROM(O + (k + r)*APART + t)*rest;
        }
        for (int r = 0; r < SIDE; r++)
            g[k + r] += NAME(total)(sum + r);
    }
}

static const struct kernels NAME(kernels) = {NAME(block), NAME(begin), NAME(finish), NAME(backward), NAME(gram), NAME(gradient)};

#undef AT
#undef FROM
#undef WIDTH
#undef TOGETHER
#undef NAME
#undef TARGET
#endif
