/* Output-error recursion of a blended local linear model network, online: simulation, cost, and by exact sensitivities
 * its gradient and Gauss-Newton matrix, in one pass and without a stored Jacobian.
 *
 * A network interpolates K models: its local models with given weights, or the nodes of a table with straight lines in
 * between. Row k holds the outputs at t_k and the inputs set at t_k. With v_a(k) = weight of model a at r_k,
 * e = scheduling input, G = sum_a v_a g_a:
 *   z_k   = E (x + y0)                                            observed signals; y0 = sum_i w_i(k - 1) y0_i
 *   r_k   = e_k + kappa x_d                                       scheduling variable; x_d = deviation of one state
 *   x    <- x - 1/2 (G(r_k) + G(r_{k-1})) (e_k - e_{k-1})         rebase to the equilibrium of e_k
 *   x    <- sum_a v_a(k) (A_a x + B_a (u_k - u0))                 u0 = sum_i w_i(k) u0_i
 * where w_i = sum_a v_a share_ai is the weight of local model i. S = d x / d parameters follows the same lines. The
 * parameters of local model i are P of its dynamics (they move model a by share_ai dA_a), its input offsets u0_i and
 * its output offsets y0_i. Behind those of all local models stand common parameters, which move model a by
 * dA_a direction_a, and kappa. */

typedef struct {
    long count;                /* N, rows */
    long models;               /* K */
    long local_models;         /* M */
    long states;               /* n, at most MAXIMUM_STATES */
    long others;               /* inputs u, at most MAXIMUM_STATES */
    long observed;             /* q, observed signals, at most MAXIMUM_OBSERVED */
    long rank;                 /* rows of `factor`, at most MAXIMUM_STATES */
    long parameters;           /* P; may be 0 */
    long input_offsets;        /* entries of u0_i: 0 or `others` */
    long output_offsets;       /* entries of y0_i, added to the first states as they are observed; 0 .. n */
    long nodes;                /* 1: the models are nodes at `positions`, 0: local models with the weights `blend` */
    long deviation_state;      /* d */
    long common;               /* common parameters */
    long gain_column;          /* 1: kappa is a parameter */
    double gain;               /* kappa */
    const double *A;           /* [K][n][n] */
    const double *B;           /* [K][n][others] */
    const double *g;           /* [K][n] */
    const double *dA;          /* [K][n][n][P] */
    const double *dB;          /* [K][n][others][P] */
    const double *dg;          /* [K][n][P] */
    const double *shares;      /* [K][M] */
    const double *directions;  /* [K][common][P] */
    const double *offsets;     /* [M][input_offsets + output_offsets] */
    const double *start;       /* [n] state at row 0 */
    const double *start_slope; /* [n][columns] */
    const double *observation; /* E [q][n] */
    const double *weight;      /* [q] weight of each observed signal in the cost */
    const double *factor;      /* R [rank][n], R'R = E' diag(weight) E */
    const double *positions;   /* [K] ascending; nodes only */
    const double *scheduling;  /* e [N] */
    const double *input;       /* u [N][others] */
    const double *blend;       /* [N][K]; without nodes only */
    const double *target;      /* [N][q] what z should be */
} Problem;

enum { MAXIMUM_STATES = 8, MAXIMUM_OBSERVED = 16, LANES = 4, BATCH = 16 };

static const double DIVERGED = 1e250; /* a cost beyond this (or not a number) ends the pass */

/* Models that are interpolated at a row, and what they give. */
typedef struct {
    long first;
    long count;
    double weights[MAXIMUM_STATES * MAXIMUM_STATES];
    double slope; /* d (second weight) / d r; 0 where r is clipped, or without nodes */
    double A[MAXIMUM_STATES * MAXIMUM_STATES];
    double B[MAXIMUM_STATES * MAXIMUM_STATES];
    double g[MAXIMUM_STATES];
    double input_offset[MAXIMUM_STATES];
    double output_offset[MAXIMUM_STATES];
} Blend;

static long local_columns(const Problem *p) { return p->parameters + p->input_offsets + p->output_offsets; }

static long all_columns(const Problem *p) { return p->local_models * local_columns(p) + p->common + p->gain_column; }

/* Columns are padded with zeros to whole lanes. */
static long padded(const Problem *p) { return (all_columns(p) + LANES - 1) / LANES * LANES; }

/* out += value row, over whole lanes */
static void add_row(double *restrict out, double value, const double *restrict row, long length)
{
    for (long j = 0; j < length; j++) out[j] += value * row[j];
}

/* out = sum_c value_c rows[c], `length` a whole number of lanes */
static void combine(double *restrict out, const double *value, const double *rows, long count, long length)
{
    for (long j = 0; j < length; j += LANES) {
        double sum[LANES] = {0.0, 0.0, 0.0, 0.0};
        for (long c = 0; c < count; c++) {
            const double *row = rows + c * length + j;
            for (int l = 0; l < LANES; l++) sum[l] += value[c] * row[l];
        }
        for (int l = 0; l < LANES; l++) out[j + l] = sum[l];
    }
}

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

/* gram += rows' rows, upper triangle in tiles of two rows and LANES columns. */
static void accumulate(const double *rows, long count, long columns, double *gram)
{
    for (long i = 0; i < columns; i += 2) {
        for (long j = i / LANES * LANES; j < columns; j += LANES) {
            double upper[LANES] = {0.0, 0.0, 0.0, 0.0};
            double lower[LANES] = {0.0, 0.0, 0.0, 0.0};
            for (long r = 0; r < count; r++) {
                const double *row = rows + r * columns;
                const double a = row[i];
                const double b = row[i + 1];
                for (int l = 0; l < LANES; l++) upper[l] += a * row[j + l];
                for (int l = 0; l < LANES; l++) lower[l] += b * row[j + l];
            }
            for (int l = 0; l < LANES; l++) gram[i * columns + j + l] += upper[l];
            for (int l = 0; l < LANES; l++) gram[(i + 1) * columns + j + l] += lower[l];
        }
    }
}

/* The cell [positions[c], positions[c + 1]) of r, searched from `cell` on; the outer cells reach to infinity. */
static long find_cell(const Problem *p, long cell, double r)
{
    while (cell > 0 && r < p->positions[cell]) cell--;
    while (cell < p->models - 2 && r >= p->positions[cell + 1]) cell++;
    return cell;
}

/* Weights at row k for the state x, and the sums over the models. */
static void schedule(const Problem *p, long k, const double *x, Blend *b)
{
    const long a = p->states * p->states, u = p->states * p->others;
    if (p->nodes) {
        const double low = p->positions[0];
        const double high = p->positions[p->models - 1];
        const double wanted = p->scheduling[k] + p->gain * x[p->deviation_state];
        const double r = wanted < low ? low : wanted > high ? high : wanted;
        b->first = find_cell(p, b->first, r);
        const double width = p->positions[b->first + 1] - p->positions[b->first];
        b->count = 2;
        b->weights[1] = (r - p->positions[b->first]) / width;
        b->weights[0] = 1.0 - b->weights[1];
        b->slope = r == wanted ? 1.0 / width : 0.0;
    } else {
        b->first = 0;
        b->count = p->models;
        b->slope = 0.0;
        for (long i = 0; i < p->models; i++) b->weights[i] = p->blend[k * p->models + i];
    }
    for (long j = 0; j < a; j++) b->A[j] = 0.0;
    for (long j = 0; j < u; j++) b->B[j] = 0.0;
    for (long j = 0; j < p->states; j++) b->g[j] = b->input_offset[j] = b->output_offset[j] = 0.0;
    for (long i = 0; i < b->count; i++) {
        const long model = b->first + i;
        const double w = b->weights[i];
        if (w == 0.0) continue;
        for (long j = 0; j < a; j++) b->A[j] += w * p->A[model * a + j];
        for (long j = 0; j < u; j++) b->B[j] += w * p->B[model * u + j];
        for (long j = 0; j < p->states; j++) b->g[j] += w * p->g[model * p->states + j];
        for (long m = 0; m < p->local_models; m++) {
            const double *own = p->offsets + m * (p->input_offsets + p->output_offsets);
            const double share = w * p->shares[model * p->local_models + m];
            for (long j = 0; j < p->input_offsets; j++) b->input_offset[j] += share * own[j];
            for (long j = 0; j < p->output_offsets; j++) b->output_offset[j] += share * own[p->input_offsets + j];
        }
    }
}

/* rows += [share_am w_a slopes_a]_m, [w_a slopes_a direction_ac]_c: `slopes` [n][P] of model a, of which local model m
 * owns its share and the common parameters move a combination. */
static void distribute(const Problem *p, const Blend *b, long i, const double *slopes, double *rows)
{
    const long width = local_columns(p);
    const long length = padded(p);
    for (long m = 0; m < p->local_models; m++) {
        const double share = b->weights[i] * p->shares[(b->first + i) * p->local_models + m];
        if (share == 0.0) continue;
        for (long r = 0; r < p->states; r++) {
            add_row(rows + r * length + m * width, share, slopes + r * p->parameters, p->parameters);
        }
    }
    for (long c = 0; c < p->common; c++) {
        const double *direction = p->directions + ((b->first + i) * p->common + c) * p->parameters;
        double *column = rows + p->local_models * width + c;
        for (long r = 0; r < p->states; r++) {
            double sum = 0.0;
            for (long j = 0; j < p->parameters; j++) sum += slopes[r * p->parameters + j] * direction[j];
            column[r * length] += b->weights[i] * sum;
        }
    }
}

/* rows += (second - first) slope dr: what the models' change with r makes of a change of r. */
static void add_schedule_slope(const Problem *p, const Blend *b, const double *first, const double *second,
                               const double *dr, double *rows)
{
    for (long r = 0; r < p->states; r++) {
        add_row(rows + r * padded(p), (second[r] - first[r]) * b->slope, dr, padded(p));
    }
}

/* d G / d parameters into `rows` [n][padded]. */
static void equilibrium_slopes(const Problem *p, const Blend *b, const double *dr, double *rows)
{
    for (long j = 0; j < p->states * padded(p); j++) rows[j] = 0.0;
    for (long i = 0; i < b->count; i++) {
        distribute(p, b, i, p->dg + (b->first + i) * p->states * p->parameters, rows);
    }
    if (b->slope != 0.0 && dr) {
        const double *g = p->g + b->first * p->states;
        add_schedule_slope(p, b, g, g + p->states, dr, rows);
    }
}

/* rate = A_a x + B_a u of one model */
static void advance_model(const Problem *p, long model, const double *x, const double *u, double *rate)
{
    const long n = p->states;
    for (long r = 0; r < n; r++) {
        rate[r] = 0.0;
        for (long c = 0; c < n; c++) rate[r] += p->A[(model * n + r) * n + c] * x[c];
        for (long c = 0; c < p->others; c++) rate[r] += p->B[(model * n + r) * p->others + c] * u[c];
    }
}

/* next = A S + what the parameters do at once; `scratch` [n][P]. */
static void advance_slopes(const Problem *p, const Blend *b, const double *x, const double *u, const double *dr,
                           const double *S, double *next, double *scratch)
{
    const long n = p->states, P = p->parameters, length = padded(p);
    for (long r = 0; r < n; r++) combine(next + r * length, b->A + r * n, S, n, length);
    for (long i = 0; i < b->count && P > 0; i++) {
        const long model = b->first + i;
        if (b->weights[i] == 0.0) continue;
        for (long r = 0; r < n; r++) {
            double *out = scratch + r * P;
            for (long j = 0; j < P; j++) out[j] = 0.0;
            for (long c = 0; c < n; c++) add_row(out, x[c], p->dA + ((model * n + r) * n + c) * P, P);
            for (long c = 0; c < p->others; c++) add_row(out, u[c], p->dB + ((model * n + r) * p->others + c) * P, P);
        }
        distribute(p, b, i, scratch, next);
    }
    if (b->slope != 0.0 && dr) {
        double first[MAXIMUM_STATES], second[MAXIMUM_STATES];
        advance_model(p, b->first, x, u, first);
        advance_model(p, b->first + 1, x, u, second);
        add_schedule_slope(p, b, first, second, dr, next);
    }
}

/* The columns of the offsets, after a tick with these weights: -w_i B for u0_i, w_i at its state for y0_i. */
static void offset_slopes(const Problem *p, const Blend *b, double *S)
{
    const long length = padded(p);
    for (long m = 0; m < p->local_models; m++) {
        double w = 0.0;
        double *columns = S + m * local_columns(p) + p->parameters;
        for (long i = 0; i < b->count; i++) w += b->weights[i] * p->shares[(b->first + i) * p->local_models + m];
        for (long j = 0; j < p->input_offsets; j++) {
            for (long r = 0; r < p->states; r++) columns[r * length + j] -= w * b->B[r * p->others + j];
        }
        columns += p->input_offsets;
        for (long j = 0; j < p->output_offsets; j++) {
            for (long r = 0; r < p->states; r++) columns[r * length + j] = r == j ? w : 0.0;
        }
    }
}

/* rows = E S: [q][columns] of the observed signals. */
static void observe_slopes(const Problem *p, const double *S, double *rows)
{
    const long columns = all_columns(p);
    for (long s = 0; s < p->observed; s++) {
        double *row = rows + s * columns;
        for (long j = 0; j < columns; j++) row[j] = 0.0;
        for (long c = 0; c < p->states; c++) add_row(row, p->observation[s * p->states + c], S + c * padded(p), columns);
    }
}

/* Doubles of scratch that `output_error` needs. */
EXPORTED long output_error_scratch(const Problem *p)
{
    const long wide = padded(p);
    return (4 * p->states + BATCH * p->rank + 1 + wide) * wide + p->states * p->parameters;
}

/* One pass over the rows. `simulated` [N][q] may be null; `gradient` [columns] and `gram` [columns][columns] (upper
 * triangle) may be null together: then no sensitivities are computed; `sensitivities` [N][q][columns] and `blocks`
 * [N / block_rows][columns], the gradient up to the end of every whole block, may be null. All outputs are
 * overwritten. Returns 0, or 1 + the row at which the simulation was no longer finite (the outputs are then
 * incomplete), or -1 if a size is beyond its maximum. */
EXPORTED long output_error(const Problem *p, double *scratch, double *simulated, double *cost, double *gradient,
                           double *gram, double *sensitivities, double *blocks, long block_rows)
{
    const long n = p->states, columns = all_columns(p), wide = padded(p);
    const int slopes = gradient != 0 && gram != 0;
    const int moving = p->gain != 0.0 || p->gain_column; /* the state also schedules */
    double *S = scratch;
    double *S_next = S + n * wide;
    double *G = S_next + n * wide;
    double *G_held = G + n * wide;
    double *batch = G_held + n * wide;
    double *dr = batch + BATCH * p->rank * wide;
    double *sum = dr + wide;
    double *model_slopes = sum + wide * wide;
    double x[MAXIMUM_STATES], seen[MAXIMUM_STATES], next[MAXIMUM_STATES], g_held[MAXIMUM_STATES];
    double u[MAXIMUM_STATES], v[MAXIMUM_STATES], z[MAXIMUM_OBSERVED];
    long filled = 0;
    Blend b;

    if (n > MAXIMUM_STATES || p->others > MAXIMUM_STATES || p->rank > MAXIMUM_STATES || p->observed > MAXIMUM_OBSERVED
        || p->output_offsets > n || (!p->nodes && p->models > MAXIMUM_STATES * MAXIMUM_STATES)) return -1;
    *cost = 0.0;
    for (long r = 0; r < n; r++) x[r] = p->start[r];
    b.first = 0;
    schedule(p, 0, x, &b);
    for (long r = 0; r < n; r++) g_held[r] = b.g[r];
    if (slopes) {
        for (long j = 0; j < output_error_scratch(p); j++) scratch[j] = 0.0;
        for (long r = 0; r < n; r++) {
            for (long j = 0; j < columns; j++) S[r * wide + j] = p->start_slope[r * columns + j];
        }
        for (long j = 0; j < columns; j++) gradient[j] = 0.0;
    }
    for (long k = 0; k < p->count; k++) {
        for (long r = 0; r < n; r++) seen[r] = x[r] + b.output_offset[r];
        *cost += observe(p, seen, p->target + k * p->observed, z, v);
        if (!(*cost < DIVERGED)) return k + 1;
        if (simulated) for (long s = 0; s < p->observed; s++) simulated[k * p->observed + s] = z[s];
        if (slopes) {
            for (long c = 0; c < n; c++) {
                if (v[c] != 0.0) add_row(gradient, v[c], S + c * wide, columns);
            }
            double *block = blocks && (k + 1) % block_rows == 0 ? blocks + ((k + 1) / block_rows - 1) * columns : 0;
            for (long j = 0; j < columns && block; j++) block[j] = gradient[j];
            for (long r = 0; r < p->rank; r++) {
                combine(batch + (filled * p->rank + r) * wide, p->factor + r * n, S, n, wide);
            }
            if (++filled == BATCH || k + 1 == p->count) {
                accumulate(batch, filled * p->rank, wide, sum);
                filled = 0;
            }
            if (sensitivities) observe_slopes(p, S, sensitivities + k * p->observed * columns);
        }

        const double change = k > 0 ? p->scheduling[k] - p->scheduling[k - 1] : 0.0;
        schedule(p, k, x, &b);
        if (slopes) {
            if (moving) {
                for (long j = 0; j < wide; j++) dr[j] = p->gain * S[p->deviation_state * wide + j];
                if (p->gain_column) dr[columns - 1] += x[p->deviation_state];
            }
            equilibrium_slopes(p, &b, moving ? dr : 0, G);
            if (change != 0.0) {
                for (long j = 0; j < n * wide; j++) S[j] -= 0.5 * (G[j] + G_held[j]) * change;
            }
            double *swap = G_held;
            G_held = G;
            G = swap;
        }
        for (long r = 0; r < n; r++) {
            x[r] -= 0.5 * (b.g[r] + g_held[r]) * change;
            g_held[r] = b.g[r];
        }
        for (long c = 0; c < p->others; c++) u[c] = p->input[k * p->others + c] - b.input_offset[c];
        if (slopes) {
            advance_slopes(p, &b, x, u, moving ? dr : 0, S, S_next, model_slopes);
            if (p->input_offsets + p->output_offsets > 0) offset_slopes(p, &b, S_next);
            double *swap = S;
            S = S_next;
            S_next = swap;
        }
        for (long r = 0; r < n; r++) {
            next[r] = 0.0;
            for (long c = 0; c < n; c++) next[r] += b.A[r * n + c] * x[c];
            for (long c = 0; c < p->others; c++) next[r] += b.B[r * p->others + c] * u[c];
        }
        for (long r = 0; r < n; r++) x[r] = next[r];
    }
    if (slopes) {
        for (long i = 0; i < columns; i++) {
            for (long j = i; j < columns; j++) gram[i * columns + j] = sum[i * wide + j];
        }
    }
    return 0;
}
