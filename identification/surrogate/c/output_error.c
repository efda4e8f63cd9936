/* Output-error recursion of a blended local linear model network in scheduled-equilibrium form, online: simulation,
 * cost, and by exact sensitivities its gradient and Gauss-Newton matrix, in one pass and without a stored Jacobian.
 *
 * Row k holds the outputs at t_k and the inputs set at t_k. With w_i = weight of model i, e = scheduling input:
 *   z_k   = E x                                                            observed signals, deviation part
 *   x    <- x - sum_i 1/2 (w_i(k) + w_i(k-1)) g_i (e_k - e_{k-1})          rebase to the equilibrium of e_k
 *   x    <- sum_i w_i(k) (A_i x + B_i u_k)                                 u: the other inputs, deviation
 * S = d x / d parameters follows the same three lines; the parameters of model i enter through w_i only.
 */

typedef struct {
    long count;               /* N, rows */
    long models;              /* M */
    long states;              /* n, at most MAXIMUM_STATES */
    long others;              /* inputs besides the scheduling input, at most MAXIMUM_STATES */
    long observed;            /* q, observed signals, at most MAXIMUM_OBSERVED */
    long rank;                /* rows of `factor`, at most MAXIMUM_STATES */
    long parameters;          /* P per model; may be 0 */
    const double *A;          /* [M][n][n] */
    const double *B;          /* [M][n][others] */
    const double *g;          /* [M][n] */
    const double *dA;         /* [M][n][n][P] */
    const double *dB;         /* [M][n][others][P] */
    const double *dg;         /* [M][n][P] */
    const double *start;      /* [n] state at row 0 */
    const double *start_slope;/* [n][M P] */
    const double *observation;/* E [q][n] */
    const double *weight;     /* [q] weight of each observed signal in the cost */
    const double *factor;     /* R [rank][n], R'R = E' diag(weight) E */
    const double *scheduling; /* e [N] */
    const double *input;      /* u [N][others] */
    const double *blend;      /* w [N][M] */
    const double *target;     /* [N][q] what z should be */
} Problem;

enum { MAXIMUM_STATES = 8, MAXIMUM_OBSERVED = 16 };

static const double DIVERGED = 1e250; /* a cost beyond this (or not a number) ends the pass */

/* z = E x; adds sum_s weight_s (target_s - z_s)^2 to the cost and writes v = E' diag(weight) (target - z). */
static double observe(const Problem *p, const double *x, const double *target, double *z, double *v)
{
    double cost = 0.0;
    for (long c = 0; c < p->states; c++) v[c] = 0.0;
    for (long s = 0; s < p->observed; s++) {
        const double *row = p->observation + s * p->states;
        double sum = 0.0;
        for (long c = 0; c < p->states; c++) sum += row[c] * x[c];
        z[s] = sum;
        const double residual = target[s] - sum;
        const double weighted = p->weight[s] * residual;
        cost += weighted * residual;
        for (long c = 0; c < p->states; c++) v[c] += row[c] * weighted;
    }
    return cost;
}

/* gradient += S' v (minus half the derivative of the cost); gram += (R S)' (R S), upper triangle only. */
static void accumulate(const Problem *p, const double *S, const double *v, double *rows, double *gradient, double *gram)
{
    const long columns = p->models * p->parameters;
    for (long c = 0; c < p->states; c++) {
        const double value = v[c];
        const double *s = S + c * columns;
        if (value == 0.0) continue;
        for (long j = 0; j < columns; j++) gradient[j] += value * s[j];
    }
    for (long r = 0; r < p->rank; r++) {
        double *row = rows + r * columns;
        for (long j = 0; j < columns; j++) row[j] = 0.0;
        for (long c = 0; c < p->states; c++) {
            const double value = p->factor[r * p->states + c];
            const double *s = S + c * columns;
            if (value == 0.0) continue;
            for (long j = 0; j < columns; j++) row[j] += value * s[j];
        }
    }
    for (long i = 0; i < columns; i++) {
        double *out = gram + i * columns;
        long r = 0;
        for (; r + 1 < p->rank; r += 2) { /* two rows at a time: half the loads and stores of `out` */
            const double *first = rows + r * columns;
            const double *second = first + columns;
            const double a = first[i];
            const double b = second[i];
            for (long j = i; j < columns; j++) out[j] += a * first[j] + b * second[j];
        }
        if (r < p->rank) {
            const double *last = rows + r * columns;
            const double a = last[i];
            for (long j = i; j < columns; j++) out[j] += a * last[j];
        }
    }
}

/* x <- x - (1/2 (w + w_before) g) step, and the same for S (null: no sensitivities). */
static void rebase(const Problem *p, const double *w, const double *w_before, double step, double *x, double *S)
{
    const long n = p->states;
    const long P = p->parameters;
    const long columns = p->models * P;
    for (long i = 0; i < p->models; i++) {
        const double share = 0.5 * (w[i] + w_before[i]) * step;
        if (share == 0.0) continue;
        for (long r = 0; r < n; r++) {
            x[r] -= share * p->g[i * n + r];
            if (!S) continue;
            const double *slope = p->dg + (i * n + r) * P;
            double *s = S + r * columns + i * P;
            for (long j = 0; j < P; j++) s[j] -= share * slope[j];
        }
    }
}

/* A = sum_i w_i A_i, B = sum_i w_i B_i. */
static void blend_matrices(const Problem *p, const double *w, double *A, double *B)
{
    const long a = p->states * p->states;
    const long b = p->states * p->others;
    for (long j = 0; j < a; j++) A[j] = 0.0;
    for (long j = 0; j < b; j++) B[j] = 0.0;
    for (long i = 0; i < p->models; i++) {
        if (w[i] == 0.0) continue;
        for (long j = 0; j < a; j++) A[j] += w[i] * p->A[i * a + j];
        for (long j = 0; j < b; j++) B[j] += w[i] * p->B[i * b + j];
    }
}

/* next = A S + [w_i (dA_i x + dB_i u)]_i, column block i for the parameters of model i. */
static void advance_slopes(const Problem *p, const double *w, const double *A, const double *x, const double *u,
                           const double *S, double *next)
{
    const long n = p->states;
    const long P = p->parameters;
    const long columns = p->models * P;
    for (long r = 0; r < n; r++) {
        double *out = next + r * columns;
        for (long j = 0; j < columns; j++) out[j] = 0.0;
        for (long c = 0; c < n; c++) {
            const double value = A[r * n + c];
            const double *s = S + c * columns;
            for (long j = 0; j < columns; j++) out[j] += value * s[j];
        }
        for (long i = 0; i < p->models; i++) {
            if (w[i] == 0.0) continue;
            double *block = out + i * P;
            for (long c = 0; c < n; c++) {
                const double value = w[i] * x[c];
                const double *slope = p->dA + ((i * n + r) * n + c) * P;
                for (long j = 0; j < P; j++) block[j] += value * slope[j];
            }
            for (long c = 0; c < p->others; c++) {
                const double value = w[i] * u[c];
                const double *slope = p->dB + ((i * n + r) * p->others + c) * P;
                for (long j = 0; j < P; j++) block[j] += value * slope[j];
            }
        }
    }
}

/* Doubles of scratch that `output_error` needs. */
EXPORTED long output_error_scratch(const Problem *p)
{
    return (2 * p->states + p->rank) * p->models * p->parameters;
}

/* One pass over the rows. `simulated` [N][q] may be null; `gradient` [M P] and `gram` [M P][M P] (upper triangle) may
 * be null together: then no sensitivities are computed. All outputs are overwritten. Returns 0, or 1 + the row at
 * which the simulation was no longer finite (the outputs are then incomplete), or -1 if a size is beyond its maximum. */
EXPORTED long output_error(const Problem *p, double *scratch, double *simulated, double *cost, double *gradient,
                           double *gram)
{
    double A[MAXIMUM_STATES * MAXIMUM_STATES];
    double B[MAXIMUM_STATES * MAXIMUM_STATES];
    double x[MAXIMUM_STATES];
    double x_next[MAXIMUM_STATES];
    double v[MAXIMUM_STATES];
    double z[MAXIMUM_OBSERVED];
    const long n = p->states;
    const long columns = p->models * p->parameters;
    const int slopes = gradient != 0 && gram != 0;
    double *S = slopes ? scratch : 0;
    double *S_next = slopes ? scratch + n * columns : 0;

    if (n > MAXIMUM_STATES || p->others > MAXIMUM_STATES || p->rank > MAXIMUM_STATES
        || p->observed > MAXIMUM_OBSERVED) return -1;
    *cost = 0.0;
    for (long r = 0; r < n; r++) x[r] = p->start[r];
    if (slopes) {
        for (long j = 0; j < n * columns; j++) S[j] = p->start_slope[j];
        for (long j = 0; j < columns; j++) gradient[j] = 0.0;
        for (long j = 0; j < columns * columns; j++) gram[j] = 0.0;
    }
    for (long k = 0; k < p->count; k++) {
        *cost += observe(p, x, p->target + k * p->observed, z, v);
        if (!(*cost < DIVERGED)) return k + 1;
        if (simulated) for (long s = 0; s < p->observed; s++) simulated[k * p->observed + s] = z[s];
        if (slopes) accumulate(p, S, v, scratch + 2 * n * columns, gradient, gram);

        const double *w = p->blend + k * p->models;
        const double *u = p->input + k * p->others;
        if (k > 0) rebase(p, w, w - p->models, p->scheduling[k] - p->scheduling[k - 1], x, S);
        blend_matrices(p, w, A, B);
        if (slopes) {
            advance_slopes(p, w, A, x, u, S, S_next);
            double *swap = S;
            S = S_next;
            S_next = swap;
        }
        for (long r = 0; r < n; r++) {
            double sum = 0.0;
            for (long c = 0; c < n; c++) sum += A[r * n + c] * x[c];
            for (long c = 0; c < p->others; c++) sum += B[r * p->others + c] * u[c];
            x_next[r] = sum;
        }
        for (long r = 0; r < n; r++) x[r] = x_next[r];
    }
    return 0;
}
