/* The steady state a run starts from; included by kernel.c. */

#include "linear_solve.c"

/* x <- (I - A)^-1 x where x holds what one tick makes of x = 0; A of a local model or of the blend. */
RARE int kernel_settle(const Tables *t, const KernelView *v, const KernelBlend *blend, double *x) {
    int n = FIXED(t, states);
    int i;
    kernel_blended(blend, t->A, n * n, v->matrix);
    for (i = 0; i < n * n; ++i) v->matrix[i] = (i % (n + 1) == 0 ? 1.0 : 0.0) - v->matrix[i];
    return linear_solve(v->matrix, n, x);
}

/* x of the steady state for the inputs with the schedule as it stands, outputs included; 1 = there is none. */
RARE int kernel_settled(const Tables *t, const KernelView *v, double *state, const double *inputs) {
    int local_states = FIXED(t, blending) == BLENDING_OUTPUT ? FIXED(t, local_models) * FIXED(t, states) : FIXED(t, states);
    KernelBlend blend = kernel_schedule(t, v, kernel_scheduling(t, v, inputs[FIXED(t, scheduling)]));
    int failed = 0;
    int i, k;
    for (i = 0; i < local_states; ++i) state[i] = 0.0;
    kernel_advance(t, v, &blend, inputs);
    if (FIXED(t, blending) == BLENDING_OUTPUT) {
        for (k = 0; k < FIXED(t, local_models) && !failed; ++k) {
            const double one = 1.0;
            KernelBlend alone;
            alone.first = k;
            alone.count = 1;
            alone.weights = &one;
            failed = kernel_settle(t, v, &alone, v->x + k * FIXED(t, states));
        }
    } else {
        failed = kernel_settle(t, v, &blend, v->x);
        if (FIXED(t, offsets) == OFFSETS_SCHEDULED_EQUILIBRIUM) kernel_blended(&blend, t->g, FIXED(t, states), v->g_held);
    }
    kernel_hold(t, v, &blend);
    return failed;
}

/* The steady state for the inputs; 1 = there is none. Fills the whole state array. */
RARE int kernel_start(const Tables *t, double *state, const double *inputs) {
    KernelView v = kernel_view(t, state);
    double before;
    int failed, pass;
    int i;
    for (i = 0; i < kernel_state_size(t); ++i) state[i] = 0.0;
    v.low_pass[0] = inputs[FIXED(t, scheduling)];
    v.scheduling_held[0] = inputs[FIXED(t, scheduling)];
    v.scheduling_given[0] = inputs[FIXED(t, scheduling)];
    v.in_range[0] = 1.0;
    failed = kernel_settled(t, &v, state, inputs);
    if (FIXED(t, deviation_gain) == 0.0) return failed;
    for (pass = 1; pass < KERNEL_START_PASSES && !failed; ++pass) {
        before = v.deviation_held[0];
        failed = kernel_settled(t, &v, state, inputs);
        if (v.deviation_held[0] == before) break;
    }
    return failed;
}
