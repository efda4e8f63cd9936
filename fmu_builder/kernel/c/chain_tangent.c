/* The exact derivative of chain.c along a direction of the physical parameters, line by line, and what it does to the state
   of rest. d_... is the change of ... along the direction. Where a parameter is held at its limit it does not change.
   CHAIN_ALONE also keeps every frame on the stack below 4 kB: Windows asks a library to probe larger ones. */

/* d of parameter p at a node */
RARE double chain_blended_tangent(
    const ChainTables *t, const double *theta, const double *d_theta, const double *weights, int p) {
    double sum = 0.0, d_sum = 0.0;
    int i;
    for (i = 0; i < t->local_models; ++i) {
        double given = theta[i * t->parameters + p], d_value = d_theta[i * t->parameters + p];
        double value = chain_clip(given, t->least[p], t->largest[p]);
        if (value != given) d_value = 0.0;
        sum += weights[i] * (t->logarithmic[p] ? elementary_log(value) : value);
        d_sum += weights[i] * (t->logarithmic[p] ? d_value / value : d_value);
    }
    if (t->logarithmic[p]) {
        sum = elementary_exp(sum);
        d_sum *= sum;
    }
    return sum < t->least[p] || sum > t->largest[p] ? 0.0 : d_sum;
}

/* d of every coefficient at a node, c being the coefficients there */
RARE void chain_coefficients_tangent(
    const ChainTables *t, const double *c, const double *d_head, const double *theta, const double *d_theta,
    const double *weights, double *d) {
    int i;
    for (i = 0; i < CHAIN_COEFFICIENTS; ++i) d[i] = i < CHAIN_HEAD ? d_head[i] : 0.0;
    for (i = 0; i < t->parameters; ++i) d[t->coefficients[i]] = chain_blended_tangent(t, theta, d_theta, weights, i);
    if (c[CHAIN_R_M] != 0.0) d[CHAIN_B_M] = -d[CHAIN_R_M] / (c[CHAIN_R_M] * c[CHAIN_R_M]);
}

/* d [A_c B_c]: a row of forces over a mass is linear in the forces */
RARE void chain_continuous_tangent(
    const double *c, const double *d, double matrix[CHAIN_STATES][CHAIN_SIZE], double d_matrix[CHAIN_STATES][CHAIN_SIZE]) {
    static const int masses[3] = {CHAIN_M_C, CHAIN_M_H, CHAIN_M_M};
    double forces[CHAIN_COEFFICIENTS];
    int i, j;
    for (i = 0; i < CHAIN_COEFFICIENTS; ++i) forces[i] = d[i];
    for (i = 0; i < 3; ++i) forces[masses[i]] = c[masses[i]];
    chain_continuous(forces, d_matrix);
    for (i = 0; i < CHAIN_STATES; ++i) {
        double share = d[masses[i / 2]] / c[masses[i / 2]];
        for (j = 0; j < CHAIN_SIZE; ++j) d_matrix[i][j] = i % 2 == 0 ? 0.0 : d_matrix[i][j] - matrix[i][j] * share;
    }
}

/* result = d(left right) */
static COLD void chain_product_tangent(
    double left[CHAIN_STATES][CHAIN_SIZE], double d_left[CHAIN_STATES][CHAIN_SIZE], double right[CHAIN_STATES][CHAIN_SIZE],
    double d_right[CHAIN_STATES][CHAIN_SIZE], double result[CHAIN_STATES][CHAIN_SIZE]) {
    double other[CHAIN_STATES][CHAIN_SIZE];
    int i, j;
    chain_product(d_left, right, result);
    chain_product(left, d_right, other);
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) result[i][j] += other[i][j];
    }
}

/* dx <- d exp(x): the series and the doublings of chain_exponential */
static COLD void chain_exponential_tangent(double x[CHAIN_STATES][CHAIN_SIZE], double dx[CHAIN_STATES][CHAIN_SIZE]) {
    double sum[CHAIN_STATES][CHAIN_SIZE], product[CHAIN_STATES][CHAIN_SIZE];
    double d_sum[CHAIN_STATES][CHAIN_SIZE], d_product[CHAIN_STATES][CHAIN_SIZE];
    double norm = chain_norm(x, CHAIN_SIZE), factor = 1.0;
    int doublings = 0, i, j, k;
    for (; norm > 0.5 && doublings < 1000; ++doublings) {
        norm *= 0.5;
        factor *= 0.5;
    }
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) {
            x[i][j] *= factor;
            dx[i][j] *= factor;
            sum[i][j] = x[i][j] / (double)CHAIN_TERMS;
            d_sum[i][j] = dx[i][j] / (double)CHAIN_TERMS;
        }
    }
    for (k = CHAIN_TERMS - 1; k > 0; --k) {
        chain_product(x, sum, product);
        chain_product_tangent(x, dx, sum, d_sum, d_product);
        for (i = 0; i < CHAIN_STATES; ++i) {
            for (j = 0; j < CHAIN_SIZE; ++j) {
                sum[i][j] = (x[i][j] + product[i][j]) / (double)k;
                d_sum[i][j] = (dx[i][j] + d_product[i][j]) / (double)k;
            }
        }
    }
    for (; doublings > 0; --doublings) {
        chain_product(sum, sum, product);
        chain_product_tangent(sum, d_sum, sum, d_sum, d_product);
        for (i = 0; i < CHAIN_STATES; ++i) {
            for (j = 0; j < CHAIN_SIZE; ++j) {
                sum[i][j] = 2.0 * sum[i][j] + product[i][j];
                d_sum[i][j] = 2.0 * d_sum[i][j] + d_product[i][j];
            }
        }
    }
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) dx[i][j] = d_sum[i][j];
    }
}

/* drive += weight (dA x + dB u) of the chain with coefficients c that change by d; u[0], the height, is left out as in a tick
   about a scheduled equilibrium */
static COLD void chain_add_drive(
    const double *c, const double *d, double sample_time, double weight, const double *x, const double *u, double *drive) {
    double matrix[CHAIN_STATES][CHAIN_SIZE], d_matrix[CHAIN_STATES][CHAIN_SIZE];
    int i, j;
    chain_continuous(c, matrix);
    chain_continuous_tangent(c, d, matrix, d_matrix);
    for (i = 0; i < CHAIN_STATES; ++i) {
        for (j = 0; j < CHAIN_SIZE; ++j) {
            double scale = sample_time * (chain_scale[j] / chain_scale[i]);
            matrix[i][j] *= scale;
            d_matrix[i][j] *= scale;
        }
    }
    chain_exponential_tangent(matrix, d_matrix);
    for (i = 0; i < CHAIN_STATES; ++i) {
        double sum = d_matrix[i][7] * (chain_scale[i] / chain_scale[7]) * u[1];
        for (j = 0; j < CHAIN_STATES; ++j) sum += d_matrix[i][j] * (chain_scale[i] / chain_scale[j]) * x[j];
        drive[i] += weight * sum;
    }
}

/* The change of the four outputs and of the weights at rest; the outputs are the first four states and rest. d_rest is what
   the static map changes by. state, scratch and tangent as for kernel_start_tangent. 1 = there is no derivative.
   (I - A) d_x = sum_a w_a (dA_a x + dB_a u); with kappa the schedule follows itself, as in kernel_start_tangent. */
static COLD int chain_start_tangent(
    const Tables *t, const ChainTables *chain, const double *head, const double *theta, const double *d_head,
    const double *d_theta, const double *d_rest, const double *state, const double *inputs, double *scratch,
    double *tangent, double *change) {
    const double still[CHAIN_INPUTS] = {0.0, 0.0};
    KernelView v = kernel_view(t, scratch), d = kernel_view(t, tangent);
    double c[CHAIN_COEFFICIENTS], d_c[CHAIN_COEFFICIENTS], u[CHAIN_INPUTS], d_x[CHAIN_STATES];
    double schedule_change = 0.0;
    KernelBlend blend;
    int i, a, failed;
    for (i = 0; i < kernel_state_size(t); ++i) scratch[i] = state[i];
    blend = kernel_schedule(t, &v, kernel_scheduling(t, &v, inputs[FIXED(t, scheduling)]));
    for (i = 0; i < CHAIN_INPUTS; ++i) u[i] = inputs[i] - t->input_operating_point[i];
    for (i = 0; i < CHAIN_STATES; ++i) d_x[i] = 0.0;
    for (a = 0; a < blend.count; ++a) {
        const double *weights = t->node_weights + (blend.first + a) * chain->local_models;
        chain_coefficients(chain, head, theta, weights, c);
        chain_coefficients_tangent(chain, c, d_head, theta, d_theta, weights, d_c);
        chain_add_drive(c, d_c, chain->sample_time, blend.weights[a], v.x, u, d_x);
    }
    failed = kernel_settle(t, &v, &blend, d_x);
    if (FIXED(t, deviation_gain) != 0.0) {
        double gain = FIXED(t, deviation_gain);
        failed = failed || steady_pass(t, state, scratch, tangent, inputs, still, 1.0);
        schedule_change = gain * d_x[FIXED(t, deviation_output)] / (1.0 - gain * d.deviation_held[0]);
    }
    failed = failed || steady_pass(t, state, scratch, tangent, inputs, still, schedule_change);
    for (i = 0; i < FIXED(t, outputs); ++i) change[i] = d.held[i] + d_x[i] + d_rest[i];
    for (i = 0; i < FIXED(t, local_models); ++i) change[FIXED(t, outputs) + i] = d.weights[i];
    return failed;
}
