/* Inner loops of identification and of resolution studies, for any robot whose C file gives its distinct signals.

    fused_states      median-filtered positions -> q, qd, qdd: low-pass forward and backward, central differences (runtime/signals.py)
    fused_decimated   states -> signals -> kept samples of the zero-phase decimation (runtime/decimation.py); the signals are never stored
    fused_normal      rows -> A_j = [W_j Y_j]'[W_j Y_j] of every joint on its own columns
    fused_residual    rows, X -> W_j'(Y_j - W_j X) and ||Y_j - W_j X||^2: one refinement
    fused_rows        rows of [W_j Y_j] themselves, column by column, for a QR
    fused_stream      states -> signals -> one of the last three, by blocks

Signals are rows of samples, U[s*stride + t]; entry e of joint j is sign[e]*U[signal[e]]. All memory comes from the caller and nothing is kept
between calls, so any number of threads may work, each on its own arrays. Functions return 0, 1 for arguments that cannot be, 2 where the
signals of the robot refuse theirs. Compile with -ffp-contract=fast, never with -ffast-math.
*/

#ifndef KERNELS
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define ABI 1
#define STATE 8   /* real numbers of a state of the decimation filter, of order 8; also the most kept samples of a block */
#define LANES 8   /* joints filtered together, samples summed together */
#define SIDE 4    /* rows and columns of one tile of a Gram matrix */
#define MOST 10   /* sections of the low-pass */
#define SPAN 512  /* samples of one block of rows */
#define WHOLE (SIDE*LANES) /* samples that sums take at once, at most */
#define APART (SPAN + LANES)

/* The sums of products are written once, for vectors of WIDTH numbers, and read in once for each width: see KERNELS. The filters of the states
are plain loops and PLAIN: no version of them has an instruction that fuses product and sum, so they agree with scipy in every bit. */
#ifdef __GNUC__
#define INLINE static inline __attribute__((always_inline))
#else
#define INLINE static inline
#endif
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__GLIBC__) && !defined(PORTABLE)
#define PLAIN __attribute__((target_clones("avx2", "default")))
#define WIDER
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

/* Positions, given[t*sample + j*joint], to states (n, N). scratch: 2 (N + 2 pad) LANES. ends: 1 one-sided, 2 of second order. */
struct states {
    int64_t N, n, sample, joint, ends;
    double rate;
    struct lowpass on_q, on_qd;
    const double *given;
    double *scratch, *q, *qd, *qdd;
};

/* Signals of the robot from states (n, stride), S of them wanted: rows wanted[s] of U, which has `count` rows of `length` samples. */
struct source {
    signals_of *signals;
    const double *constants, *q, *qd, *qdd;
    int64_t stride, count, S, length;
    const int32_t *wanted;
    double *U;
};

/* Zero-phase decimation of N samples by the matrices of runtime/decimation.py: blocks of L samples from `phase` on, each of G kept ones.

    x_0 = start' u(first samples)     [x_(b+1); d_b; e_b] = block' [u_b; x_b]                       b = 0 .. blocks - 1
    [v_(b-1); y_b] = [d_b; e_b] + back' v_b     with [v; y] of the last samples = end' [u(last samples); x_blocks]

start (first, STATE), block (L + STATE, 3 STATE), back (STATE, 2 STATE), end (final + STATE, 2 STATE): outputs filled up with zeros to whole
states. d (blocks, S, 2 STATE), x (S, STATE); y (S, ystride) receives the kept samples, `rest` of them from the last samples.
*/
struct decimation {
    int64_t N, phase, L, G, blocks, first, final, rest, ystride;
    const double *start, *block, *back, *end;
    double *d, *x, *y;
};

/* Entries of the n joints: those of joint j are from[j] .. from[j + 1] - 1, c of them; its torque stands behind the last one.

A: width^2 numbers a joint, width being c + 1 rounded up to SIDE, lower tiles. g: width numbers a joint, g[c] the square of the residual. O: scratch, rows of
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

/* m rows: signals U (., ustride), torques Y (n, ystride), mask (n, mstride) of rows used, NULL for all. */
struct rows {
    int64_t m, ustride, ystride, mstride;
    const double *U, *Y;
    const uint8_t *mask;
};

enum task { NORMAL, RESIDUAL, ROWS };

int32_t fused_states(const struct states *a);
int32_t fused_decimated(const struct source *from, const struct decimation *a);
int32_t fused_normal(const struct entries *a, const struct rows *r);
int32_t fused_residual(const struct entries *a, const struct rows *r, const double *X);
int32_t fused_rows(const struct entries *a, const struct rows *r);
int32_t fused_stream(int32_t task, const struct source *from, const struct entries *a, const struct rows *r, int64_t N, int64_t step,
                     const double *const given[4], const double *X);
int32_t fused_abi(void);
void fused_layout(int64_t layout[8]);

/* The sums of products for one width of vectors. */
struct kernels {
    void (*block)(const struct decimation *a, const struct source *from, const double *U, double *d);
    void (*begin)(const struct decimation *a, const struct source *from);
    void (*finish)(const struct decimation *a, const struct source *from);
    void (*backward)(const struct decimation *a, int64_t S);
    void (*gram)(const double *O, int64_t width, int64_t samples, double *A);
    void (*gradient)(double *O, int64_t c, int64_t samples, const double *X, double *g);
};

#define KERNELS
#define NAME(x) x##_plain
#define TARGET
#define TOGETHER 2
#ifdef __GNUC__
#define WIDTH 2
#else
#define WIDTH 1
#endif
#include "fused.c"
#ifdef WIDER
#define NAME(x) x##_fma
#define TARGET __attribute__((target("fma")))
#define TOGETHER 2
#define WIDTH 4
#include "fused.c"
#define NAME(x) x##_avx512
#define TARGET __attribute__((target("avx512f")))
#define TOGETHER 6
#define WIDTH 8
#include "fused.c"
#endif

/* Those of this processor. */
static const struct kernels *best(void)
{
#ifdef WIDER
    if (__builtin_cpu_supports("avx512f"))
        return &kernels_avx512;
    if (__builtin_cpu_supports("fma"))
        return &kernels_fma;
#endif
    return &kernels_plain;
}

/* ------------------------------------------------------------------------------------------------------------------------- states */

/* One pass of the sections, direct form II transposed, over R samples `step` apart, started in the steady state of the first. */
INLINE void sections(double *x, int64_t R, ptrdiff_t step, const struct lowpass *f, const int64_t count)
{
    double c[6*MOST], z[2*MOST][LANES];
    memcpy(c, f->sos, (size_t)(6*count)*sizeof *c);
    for (int64_t s = 0; s < 2*count; s++)
        for (int l = 0; l < LANES; l++)
            z[s][l] = f->zi[s]*x[l];
    for (; R > 0; R--, x += step)
        for (int64_t s = 0; s < count; s++) {
            const double *b = c + 6*s, *a = b + 3;
            for (int l = 0; l < LANES; l++) {
                const double u = x[l], y = b[0]*u + z[2*s][l];
                z[2*s][l] = b[1]*u - a[1]*y + z[2*s + 1][l];
                z[2*s + 1][l] = b[2]*u - a[2]*y;
                x[l] = y;
            }
        }
}

PLAIN static void pass(double *x, int64_t R, ptrdiff_t step, const struct lowpass *f)
{
    if (f->sections == 1)
        sections(x, R, step, f, 1);
    else if (f->sections == 2)
        sections(x, R, step, f, 2);
    else
        sections(x, R, step, f, f->sections);
}

/* Forward and backward over N samples of LANES joints; `pad` samples on either side of x are there for the odd reflections. */
static void zero_phase(double *x, int64_t N, const struct lowpass *f)
{
    const double *last = x + (N - 1)*LANES;
    for (int64_t t = 1; t <= f->pad; t++)
        for (int l = 0; l < LANES; l++) {
            x[l - t*LANES] = 2.0*x[l] - x[l + t*LANES];
            x[(N - 1 + t)*LANES + l] = 2.0*last[l] - last[l - t*LANES];
        }
    const int64_t R = N + 2*f->pad;
    pass(x - f->pad*LANES, R, LANES, f);
    pass(x + (N - 1 + f->pad)*LANES, R, -LANES, f);
}

/* dx, central differences inside; N > ends. */
PLAIN static void difference(const double *restrict x, double *restrict dx, int64_t N, double rate, int64_t ends)
{
    const double h = 1.0/rate;
    for (int64_t i = LANES; i < (N - 1)*LANES; i++)
        dx[i] = (x[i + LANES] - x[i - LANES])/(2.0*h);
    const double *last = x + (N - 1)*LANES;
    for (int l = 0; l < LANES; l++)
        if (ends == 1) {
            dx[l] = (x[LANES + l] - x[l])/h;
            dx[(N - 1)*LANES + l] = (last[l] - last[l - LANES])/h;
        } else {
            dx[l] = -1.5/h*x[l] + 2.0/h*x[LANES + l] + -0.5/h*x[2*LANES + l];
            dx[(N - 1)*LANES + l] = 0.5/h*last[l - 2*LANES] + -2.0/h*last[l - LANES] + 1.5/h*last[l];
        }
}

/* `used` lanes of N samples to rows N apart. */
static void rows_of(const double *x, int64_t N, int64_t used, double *row)
{
    for (int64_t t = 0; t < N; t++)
        for (int64_t l = 0; l < used; l++)
            row[l*N + t] = x[t*LANES + l];
}

int32_t fused_states(const struct states *a)
{
    const int64_t N = a->N, n = a->n;
    const int64_t pad = a->on_q.pad > a->on_qd.pad ? a->on_q.pad : a->on_qd.pad;
    if (n < 1 || a->ends < 1 || a->ends > 2 || N <= a->ends || pad < 0 || N <= pad || a->on_q.sections > MOST || a->on_qd.sections > MOST)
        return 1;
    double *x = a->scratch + pad*LANES, *dx = x + (N + 2*pad)*LANES;
    for (int64_t j = 0; j < n; j += LANES) {
        const int64_t used = n - j < LANES ? n - j : LANES;
        for (int64_t t = 0; t < N; t++)
            for (int64_t l = 0; l < LANES; l++)
                x[t*LANES + l] = l < used ? a->given[t*a->sample + (j + l)*a->joint] : 0.0;
        if (a->on_q.sections)
            zero_phase(x, N, &a->on_q);
        rows_of(x, N, used, a->q + j*N);
        difference(x, dx, N, a->rate, a->ends);
        if (a->on_qd.sections)
            zero_phase(dx, N, &a->on_qd);
        rows_of(dx, N, used, a->qd + j*N);
        difference(dx, x, N, a->rate, a->ends);
        rows_of(x, N, used, a->qdd + j*N);
    }
    return 0;
}

/* --------------------------------------------------------------------------------------------------------------------- decimation */

static int32_t evaluate(const struct source *a, int64_t t, int64_t m)
{
    return m > a->length || a->signals(m, a->q + t, a->qd + t, a->qdd + t, a->stride, a->constants, a->U, a->length) ? 2 : 0;
}

int32_t fused_decimated(const struct source *from, const struct decimation *a)
{
    const int64_t most = from->length/a->L, kept = a->blocks*a->G + a->rest;
    if (a->G < 1 || a->G > STATE || a->rest > STATE || a->first > a->N || a->final > a->N || (a->blocks && !most) || a->ystride < kept)
        return 1;
    const struct kernels *const use = best();
    int32_t status = evaluate(from, 0, a->first);
    if (!status)
        use->begin(a, from);
    for (int64_t b = 0; b < a->blocks && !status; b += most) {
        const int64_t some = a->blocks - b < most ? a->blocks - b : most;
        status = evaluate(from, a->phase + b*a->L, some*a->L);
        for (int64_t i = 0; i < some && !status; i++)
            use->block(a, from, from->U + i*a->L, a->d + (b + i)*from->S*2*STATE);
    }
    if (!status)
        status = evaluate(from, a->N - a->final, a->final);
    if (status)
        return status;
    use->finish(a, from);
    use->backward(a, from->S);
    return 0;
}

/* ------------------------------------------------------------------------------------------------------------------ least squares */

/* The rows of joint j that are used, signs applied, torque last: `out` (width, stride); returns their number. */
static int64_t gather(const struct entries *a, const struct rows *r, int64_t j, int64_t t, int64_t m, double *out, int64_t stride)
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
        const double *u = k < c ? r->U + a->signal[e]*r->ustride + t : r->Y + j*r->ystride + t;
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
            if (task == ROWS) {
                a->taken[j] += gather(a, r, j, t, m, R + c + 1 + a->taken[j], c + 1 + a->most);
                continue;
            }
            const int64_t count = gather(a, r, j, t, m, a->O, APART), full = (count + WHOLE - 1)/WHOLE*WHOLE;
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

/* The same tasks, or the rows for a QR, on N samples of states and torques given (N, n), `step` at a time. q, qd, qdd of `from` and Y of `r`
are scratch, (n, from->stride), here. */
int32_t fused_stream(int32_t task, const struct source *from, const struct entries *a, const struct rows *r, int64_t N,
                     int64_t step, const double *const given[4], const double *X)
{
    double *const to[4] = {(double *)(uintptr_t)from->q, (double *)(uintptr_t)from->qd, (double *)(uintptr_t)from->qdd,
                           (double *)(uintptr_t)r->Y};
    if (task < NORMAL || task > ROWS || N < 0 || step < 1 || from->stride < step || (task == ROWS && N > a->most))
        return 1;
    for (int64_t t = 0; t < N; t += step) {
        const int64_t m = N - t < step ? N - t : step;
        for (int k = 0; k < 4; k++)
            for (int64_t i = 0; i < m; i++)
                for (int64_t j = 0; j < a->n; j++)
                    to[k][j*from->stride + i] = given[k][(t + i)*a->n + j];
        if (evaluate(from, 0, m))
            return 2;
        const struct rows part = {m, from->length, from->stride, r->mstride, from->U, r->Y, r->mask ? r->mask + t : NULL};
        work((enum task)task, a, &part, X);
    }
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

/* One block of `signals` signals: what the way back needs, d, and the next state, x. */
TARGET INLINE void NAME(forward)(const struct decimation *a, const double *const *u, double *x, double *d, const int signals)
{
    NAME(V) sum[TOGETHER*3*STATE/WIDTH];
    const double *state[TOGETHER];
    memset(sum, 0, sizeof sum);
    for (int s = 0; s < signals; s++)
        state[s] = x + s*STATE;
    NAME(product)(u, a->L, a->block, sum, signals, 3*STATE);
    NAME(product)(state, STATE, a->block + a->L*3*STATE, sum, signals, 3*STATE);
    for (int s = 0; s < signals; s++) {
        memcpy(x + s*STATE, sum + s*3*STATE/WIDTH, STATE*sizeof *x);
        memcpy(d + s*2*STATE, sum + (3*s + 1)*STATE/WIDTH, 2*STATE*sizeof *d);
    }
}

/* One block of every signal; U is its first sample, d its part. */
TARGET static void NAME(block)(const struct decimation *a, const struct source *from, const double *U, double *d)
{
    const double *u[TOGETHER];
    int64_t s = 0;
    for (; s + TOGETHER <= from->S; s += TOGETHER) {
        for (int i = 0; i < TOGETHER; i++)
            u[i] = U + from->wanted[s + i]*from->length;
        NAME(forward)(a, u, a->x + s*STATE, d + s*2*STATE, TOGETHER);
    }
    for (; s < from->S; s++) {
        u[0] = U + from->wanted[s]*from->length;
        NAME(forward)(a, u, a->x + s*STATE, d + s*2*STATE, 1);
    }
}

/* The steady state of the padding, and what comes before the first kept sample. */
TARGET static void NAME(begin)(const struct decimation *a, const struct source *from)
{
    for (int64_t s = 0; s < from->S; s++) {
        const double *u = from->U + from->wanted[s]*from->length;
        NAME(V) sum[STATE/WIDTH];
        memset(sum, 0, sizeof sum);
        NAME(product)(&u, a->first, a->start, sum, 1, STATE);
        memcpy(a->x + s*STATE, sum, sizeof sum);
    }
}

/* The last samples: their y, and v in place of x. */
TARGET static void NAME(finish)(const struct decimation *a, const struct source *from)
{
    for (int64_t s = 0; s < from->S; s++) {
        const double *u = from->U + from->wanted[s]*from->length, *x = a->x + s*STATE;
        NAME(V) sum[2*STATE/WIDTH];
        memset(sum, 0, sizeof sum);
        NAME(product)(&u, a->final, a->end, sum, 1, 2*STATE);
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

/* A += O O' in tiles of SIDE, those on and below the diagonal; samples in whole vectors. */
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
            for (int p = 0; p < SIDE*SIDE; p++)
                A[(i + p/SIDE)*width + k + p%SIDE] += NAME(total)(sum + p);
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
