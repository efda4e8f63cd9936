/* The exact derivative of the steady state, along a direction of the inputs: what kernel_start in kernel.c makes of
   u + e du, differentiated by e line by line. A weight's derivative is written d_w; equations and names in kernel.h.

   Parameter blending: (I - A) d_x = sum_a d_w_a (A_a (x - x0) + B_a (u - u_ref)) + sum_a w_a (B_a d(u - u_ref) - A_a d_x0)
   and, with output blending, the same for every local model alone, whose weight is the constant 1. Where the schedule has
   an edge (ends of the range, nodes), the derivative is that of the side the kernel itself computes on. */

/* d_phi_i into tangent weights, d of the active models' weights returned like those */
RARE const double *steady_schedule(
    const Tables *t, const KernelView *v, const KernelView *d, double position, double change) {
    double r = kernel_clip(position, FIXED(t, range_low), FIXED(t, range_high));
    int i;
    if (position < FIXED(t, range_low) || position > FIXED(t, range_high)) change = 0.0;
    if (FIXED(t, nodes) == 0) {
        double mean = 0.0;
        for (i = 0; i < FIXED(t, local_models); ++i) {
            const double *l = t->log_weights + 3 * i;
            d->weights[i] = (2.0 * l[2] * (r - FIXED(t, range_middle)) + l[1]) * change;
            mean += v->weights[i] * d->weights[i];
        }
        for (i = 0; i < FIXED(t, local_models); ++i) d->weights[i] = v->weights[i] * (d->weights[i] - mean);
        return d->weights;
    } else {
        int cell = kernel_cell(t->node_positions, FIXED(t, nodes), FIXED(t, node_scale), r);
        const double *left = t->node_weights + cell * FIXED(t, local_models);
        double share = change / (t->node_positions[cell + 1] - t->node_positions[cell]);
        for (i = 0; i < FIXED(t, local_models); ++i) d->weights[i] = (left[FIXED(t, local_models) + i] - left[i]) * share;
        d->pair[0] = -share;
        d->pair[1] = share;
        return FIXED(t, blending) == BLENDING_PARAMETER ? d->pair : d->weights;
    }
}

/* d of the deviation of the inputs from what the models count them from */
RARE void steady_deviation(const Tables *t, const KernelView *d, const double *direction, const double *d_u0) {
    int j;
    for (j = 0; j < FIXED(t, inputs); ++j) d->deviation[j] = direction[j] - (d_u0 != 0 ? d_u0[j] : 0.0);
    if (FIXED(t, offsets) == OFFSETS_LOW_PASS) d->deviation[FIXED(t, scheduling)] = 0.0; /* at rest the low-pass has followed */
}

/* d_x of every local model with output blending; then the sum of w_i C_i d_x_i into held */
RARE int steady_models(const Tables *t, const KernelView *v, const KernelView *d, const double *direction) {
    int i, k, failed = 0;
    steady_deviation(t, d, direction, 0);
    for (k = 0; k < FIXED(t, local_models) && !failed; ++k) {
        const double one = 1.0;
        double *d_x = d->x + k * FIXED(t, states);
        KernelBlend alone;
        alone.first = k;
        alone.count = 1;
        alone.weights = &one;
        for (i = 0; i < FIXED(t, states); ++i) d->shift[i] = 0.0;
        kernel_transition(t, k, d->shift, d->deviation, d_x);
        failed = kernel_settle(t, v, &alone, d_x);
        for (i = 0; i < FIXED(t, outputs); ++i) d->product[i] = 0.0;
        kernel_multiply(kernel_output_matrix(t, k), FIXED(t, outputs), FIXED(t, states), d_x, d->product);
        for (i = 0; i < FIXED(t, outputs); ++i) d->held[i] += v->weights[k] * d->product[i];
    }
    return failed;
}

/* d_x of the blend; then the sum of w_a (C_a d(x - x0) - D_a d_u0) into held */
RARE int steady_blend(
    const Tables *t, const KernelView *v, const KernelView *d, const KernelBlend *blend, const double *d_w,
    const double *inputs, const double *direction) {
    int affine = FIXED(t, offsets) == OFFSETS_AFFINE;
    const double *source = v->x;
    KernelBlend d_blend = *blend;
    int i, a;
    d_blend.weights = d_w;
    for (i = 0; i < FIXED(t, states); ++i) d->x0[i] = 0.0;
    if (affine) {
        kernel_blended(blend, t->x0, FIXED(t, states), v->x0);
        kernel_blended(blend, t->u0, FIXED(t, inputs), v->u0);
        kernel_blended(&d_blend, t->x0, FIXED(t, states), d->x0);
        kernel_blended(&d_blend, t->u0, FIXED(t, inputs), d->u0);
        source = kernel_shifted(t, v, v->x, v->x0);
    }
    kernel_deviation(t, v, inputs, affine ? v->u0 : t->input_operating_point);
    steady_deviation(t, d, direction, affine ? d->u0 : 0);
    for (i = 0; i < FIXED(t, states); ++i) d->x[i] = 0.0;
    for (i = 0; i < FIXED(t, states); ++i) d->shift[i] = -d->x0[i];
    for (a = 0; a < blend->count; ++a) {
        kernel_transition(t, blend->first + a, source, v->deviation, d->next);
        for (i = 0; i < FIXED(t, states); ++i) d->x[i] += d_w[a] * d->next[i];
        kernel_transition(t, blend->first + a, d->shift, d->deviation, d->next);
        for (i = 0; i < FIXED(t, states); ++i) d->x[i] += blend->weights[a] * d->next[i];
    }
    if (kernel_settle(t, v, blend, d->x)) return 1;
    for (i = 0; i < FIXED(t, states); ++i) d->shift[i] = d->x[i] - d->x0[i];
    for (a = 0; a < blend->count; ++a) {
        int model = blend->first + a;
        for (i = 0; i < FIXED(t, outputs); ++i) d->product[i] = 0.0;
        kernel_multiply(kernel_output_matrix(t, model), FIXED(t, outputs), FIXED(t, states), d->shift, d->product);
        if (FIXED(t, deviation_gain) != 0.0) d->deviation_held[0] += blend->weights[a] * d->product[FIXED(t, deviation_output)];
        if (affine && FIXED(t, feedthrough)) {
            for (i = 0; i < FIXED(t, inputs); ++i) d->deviation[i] = -d->u0[i];
            kernel_multiply(t->D + model * FIXED(t, inputs) * FIXED(t, outputs), FIXED(t, outputs), FIXED(t, inputs), d->deviation, d->product);
        }
        for (i = 0; i < FIXED(t, outputs); ++i) d->held[i] += blend->weights[a] * d->product[i];
    }
    return 0;
}

/* d of the outputs at rest over their position */
RARE void steady_rest(const Tables *t, const KernelView *d, double position, double change) {
    int i;
    for (i = 0; i < FIXED(t, outputs); ++i) d->held[i] = 0.0;
    if (FIXED(t, map_points) > 0) {
        int cell = kernel_cell(t->map_positions, FIXED(t, map_points), FIXED(t, map_scale), position);
        const double *left = t->map_values + cell * FIXED(t, outputs);
        double share = change / (t->map_positions[cell + 1] - t->map_positions[cell]);
        for (i = 0; i < FIXED(t, outputs); ++i) d->held[i] = (left[FIXED(t, outputs) + i] - left[i]) * share;
    }
}

/* One pass with a given change of the schedule: d_x, d_held, d_feedthrough and so on into tangent, an array like the state;
   scratch is another one. */
RARE int steady_pass(
    const Tables *t, const double *state, double *scratch, double *tangent, const double *inputs,
    const double *direction, double schedule_change) {
    KernelView v = kernel_view(t, scratch), d = kernel_view(t, tangent);
    int affine = FIXED(t, offsets) == OFFSETS_AFFINE, failed, a, i;
    KernelBlend blend, d_blend;
    double scheduling;
    for (i = 0; i < kernel_state_size(t); ++i) {
        scratch[i] = state[i];
        tangent[i] = 0.0;
    }
    scheduling = kernel_scheduling(t, &v, inputs[FIXED(t, scheduling)]);
    blend = kernel_schedule(t, &v, scheduling);
    d_blend = blend;
    d_blend.weights = steady_schedule(t, &v, &d, scheduling, schedule_change);
    steady_rest(t, &d, inputs[FIXED(t, scheduling)], direction[FIXED(t, scheduling)]);
    if (FIXED(t, feedthrough)) kernel_blended(&d_blend, t->D, FIXED(t, inputs) * FIXED(t, outputs), d.feedthrough);
    failed = FIXED(t, blending) == BLENDING_OUTPUT
                 ? steady_models(t, &v, &d, direction)
                 : steady_blend(t, &v, &d, &blend, d_blend.weights, inputs, direction);
    /* sum of d_w_a times what model a holds, in the words of the kernel, which adds it to held */
    for (i = 0; i < FIXED(t, outputs); ++i) v.held[i] = 0.0;
    v.deviation_held[0] = 0.0;
    for (a = 0; a < d_blend.count; ++a) {
        int k = d_blend.first + a, local = FIXED(t, blending) == BLENDING_OUTPUT;
        const double *x = v.x + (local ? k * FIXED(t, states) : 0);
        const double *u0 = local && affine ? t->u0 + k * FIXED(t, inputs) : v.u0;
        if (affine) x = kernel_shifted(t, &v, x, local ? t->x0 + k * FIXED(t, states) : v.x0);
        kernel_hold_model(t, &v, k, d_blend.weights[a], x, u0);
    }
    for (i = 0; i < FIXED(t, outputs); ++i) d.held[i] += v.held[i];
    d.deviation_held[0] += v.deviation_held[0];
    return failed;
}

/* The change of the p outputs, R derived outputs and M weights at rest; state is that of kernel_start for the inputs,
   scratch and tangent are arrays of its size. 1 = there is no derivative. With kappa the schedule follows itself:
   d_r = d_s + kappa d(C x)_j, and d(C x)_j is linear in d_r. */
RARE int kernel_start_tangent(
    const Tables *t, const double *state, const double *inputs, const double *direction, double *scratch,
    double *tangent, double *change) {
    KernelView v = kernel_view(t, scratch), d = kernel_view(t, tangent);
    double schedule_change = direction[FIXED(t, scheduling)];
    int i, j, term = 0, failed;
    if (FIXED(t, deviation_gain) != 0.0) {
        double open, again;
        failed = steady_pass(t, state, scratch, tangent, inputs, direction, 0.0);
        open = d.deviation_held[0];
        failed = failed || steady_pass(t, state, scratch, tangent, inputs, direction, 1.0);
        again = d.deviation_held[0] - open;
        if (failed) return 1;
        schedule_change = (schedule_change + FIXED(t, deviation_gain) * open) / (1.0 - FIXED(t, deviation_gain) * again);
    }
    failed = steady_pass(t, state, scratch, tangent, inputs, direction, schedule_change);
    for (i = 0; i < FIXED(t, outputs); ++i) change[i] = d.held[i];
    for (j = 0; j < FIXED(t, inputs) && FIXED(t, feedthrough); ++j) {
        double deviation = inputs[j] - t->input_operating_point[j];
        if (FIXED(t, offsets) == OFFSETS_LOW_PASS && j == FIXED(t, scheduling)) continue; /* it counts from its low-pass: stays zero */
        kernel_multiply(d.feedthrough + j * FIXED(t, outputs), FIXED(t, outputs), 1, &deviation, change);
        kernel_multiply(v.feedthrough + j * FIXED(t, outputs), FIXED(t, outputs), 1, direction + j, change);
    }
    for (i = 0; i < FIXED(t, derived); ++i) {
        double sum = 0.0;
        for (; term < t->term_ends[i]; ++term) {
            int signal = t->term_signals[term];
            sum += t->term_coefficients[term] * (signal < FIXED(t, outputs) ? change[signal] : direction[signal - FIXED(t, outputs)]);
        }
        change[FIXED(t, outputs) + i] = sum;
    }
    for (i = 0; i < FIXED(t, local_models); ++i) change[FIXED(t, outputs) + FIXED(t, derived) + i] = d.weights[i];
    return failed;
}
