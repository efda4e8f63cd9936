/* The arithmetic of the local linear model network; equations and names in kernel.h. */

#include "kernel.h"

/* Numbers in the state array: the parts of KernelView one after the other. */
static inline int kernel_state_size(const Tables *t) {
    int local_states = FIXED(t, blending) == BLENDING_OUTPUT ? FIXED(t, local_models) * FIXED(t, states) : FIXED(t, states);
    int wide = FIXED(t, states) > FIXED(t, outputs) ? FIXED(t, states) : FIXED(t, outputs);
    return local_states + FIXED(t, local_models) + FIXED(t, outputs) + FIXED(t, inputs) * FIXED(t, outputs) + FIXED(t, states) + 7 /* carried */
           + 2 + 2 * FIXED(t, inputs) + 3 * FIXED(t, states) + wide + FIXED(t, states) * FIXED(t, states); /* scratch */
}

static inline KernelView kernel_view(const Tables *t, double *state) {
    KernelView v;
    int local_states = FIXED(t, blending) == BLENDING_OUTPUT ? FIXED(t, local_models) * FIXED(t, states) : FIXED(t, states);
    v.x = state;
    v.weights = v.x + local_states;
    v.held = v.weights + FIXED(t, local_models);
    v.feedthrough = v.held + FIXED(t, outputs);
    v.g_held = v.feedthrough + FIXED(t, inputs) * FIXED(t, outputs);
    v.scheduling_held = v.g_held + FIXED(t, states);
    v.low_pass = v.scheduling_held + 1;
    v.deviation_held = v.low_pass + 1;
    v.in_range = v.deviation_held + 1;
    v.scheduling_given = v.in_range + 1;
    v.position = v.scheduling_given + 1;
    v.outside = v.position + 1;
    v.pair = v.outside + 1;
    v.deviation = v.pair + 2;
    v.x0 = v.deviation + FIXED(t, inputs);
    v.u0 = v.x0 + FIXED(t, states);
    v.shift = v.u0 + FIXED(t, inputs);
    v.product = v.shift + FIXED(t, states);
    v.next = v.product + (FIXED(t, states) > FIXED(t, outputs) ? FIXED(t, states) : FIXED(t, outputs));
    v.matrix = v.next + FIXED(t, states);
    return v;
}

/* Zero in place of what is too small to matter: nothing that decays may end among the denormal numbers, with which
   some processors compute a hundred times slower, and where rounding keeps it for ever. NaN stays. */
static inline double kernel_significant(double value) {
    return value < KERNEL_SMALLEST && value > -KERNEL_SMALLEST ? 0.0 : value;
}

static inline double kernel_clip(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
}

/* The cell [positions[k], positions[k+1]) that holds value; the outer cells reach to infinity. Guess, then walk. */
static inline int kernel_cell(const double *positions, int count, double scale, double value) {
    int cell;
    if (!(value >= positions[1])) return 0;
    if (value >= positions[count - 2]) return count - 2;
    cell = (int)((value - positions[0]) * scale);
    if (cell > count - 2) cell = count - 2;
    while (value < positions[cell]) --cell;
    while (value >= positions[cell + 1]) ++cell;
    return cell;
}

/* f = (value - c_k) / (c_k+1 - c_k); outside [0, 1] beyond the ends. */
static inline double kernel_fraction(const double *positions, int cell, double value) {
    return (value - positions[cell]) / (positions[cell + 1] - positions[cell]);
}

/* result = (1 - f) rows[cell] + f rows[cell + 1] */
static inline void kernel_between(
    const double *rows, int length, int cell, double fraction, double *restrict result) {
    const double *left = rows + cell * length;
    const double *right = left + length;
    int i;
    for (i = 0; i < length; ++i) result[i] = (1.0 - fraction) * left[i] + fraction * right[i];
}

/* phi_i = exp(l_i - max l) / sum exp(l_k - max l), l_i = (curvature_i d + slope_i) d + constant_i; 0 where too small */
static inline void kernel_gaussian_weights(const Tables *t, double r, double *restrict weights) {
    double d = r - FIXED(t, range_middle);
    double highest, sum = 0.0, inverse;
    int i;
    for (i = 0; i < FIXED(t, local_models); ++i) {
        const double *l = t->log_weights + 3 * i;
        weights[i] = (l[2] * d + l[1]) * d + l[0];
    }
    highest = weights[0];
    for (i = 1; i < FIXED(t, local_models); ++i) highest = weights[i] > highest ? weights[i] : highest;
    for (i = 0; i < FIXED(t, local_models); ++i) {
        int nothing = weights[i] - highest < KERNEL_LOG_SMALLEST;
        weights[i] = nothing ? 0.0 : elementary_exp(weights[i] - highest);
    }
    for (i = 0; i < FIXED(t, local_models); ++i) sum += weights[i];
    inverse = 1.0 / sum;
    for (i = 0; i < FIXED(t, local_models); ++i) weights[i] *= inverse;
}

/* Weights phi(r) into the state; returns the active models of a parameter blend. */
static inline KernelBlend kernel_schedule(const Tables *t, const KernelView *v, double scheduling) {
    double r = kernel_clip(scheduling, FIXED(t, range_low), FIXED(t, range_high));
    KernelBlend blend;
    blend.first = 0;
    blend.count = FIXED(t, local_models);
    blend.weights = v->weights;
    v->position[0] = r;
    if (FIXED(t, nodes) == 0) {
        kernel_gaussian_weights(t, r, v->weights);
    } else {
        int cell = kernel_cell(t->node_positions, FIXED(t, nodes), FIXED(t, node_scale), r);
        double fraction = kernel_fraction(t->node_positions, cell, r);
        kernel_between(t->node_weights, FIXED(t, local_models), cell, fraction, v->weights);
        if (FIXED(t, blending) == BLENDING_PARAMETER) {
            v->pair[0] = 1.0 - fraction;
            v->pair[1] = fraction;
            blend.first = cell;
            blend.count = 2;
            blend.weights = v->pair;
        }
    }
    return blend;
}

/* result = sum_a w_a rows[a] */
static inline void kernel_blended(const KernelBlend *blend, const double *rows, int length, double *restrict result) {
    int a, i;
    for (i = 0; i < length; ++i) result[i] = 0.0;
    for (a = 0; a < blend->count; ++a) {
        const double *row = rows + (blend->first + a) * length;
        for (i = 0; i < length; ++i) result[i] += blend->weights[a] * row[i];
    }
}

/* result += M vector, M[columns][rows] stored by columns */
static inline void kernel_multiply(
    const double *matrix, int rows, int columns, const double *vector, double *restrict result) {
    int row, column;
    for (column = 0; column < columns; ++column) {
        for (row = 0; row < rows; ++row) result[row] += matrix[column * rows + row] * vector[column];
    }
}

/* C of a model */
static inline const double *kernel_output_matrix(const Tables *t, int model) {
    return t->C + (FIXED(t, output_models) > 1 ? model : 0) * FIXED(t, states) * FIXED(t, outputs);
}

/* result = A_k x + B_k u; the scheduling column of B is left out where the equilibrium is scheduled */
static inline void kernel_transition(
    const Tables *t, int model, const double *x, const double *u, double *restrict result) {
    const double *B = t->B + model * FIXED(t, inputs) * FIXED(t, states);
    int column, row;
    for (row = 0; row < FIXED(t, states); ++row) result[row] = 0.0;
    kernel_multiply(t->A + model * FIXED(t, states) * FIXED(t, states), FIXED(t, states), FIXED(t, states), x, result);
    for (column = 0; column < FIXED(t, inputs); ++column) {
        if (FIXED(t, offsets) == OFFSETS_SCHEDULED_EQUILIBRIUM && column == FIXED(t, scheduling)) continue;
        kernel_multiply(B + column * FIXED(t, states), FIXED(t, states), 1, u + column, result);
    }
}

/* deviation = u - reference; the low-passed scheduling input counts from its low-pass */
static inline void kernel_deviation(
    const Tables *t, const KernelView *v, const double *inputs, const double *reference) {
    int j;
    for (j = 0; j < FIXED(t, inputs); ++j) v->deviation[j] = inputs[j] - reference[j];
    if (FIXED(t, offsets) == OFFSETS_LOW_PASS) v->deviation[FIXED(t, scheduling)] = inputs[FIXED(t, scheduling)] - v->low_pass[0];
}

/* x - x0 into shift */
static inline const double *kernel_shifted(const Tables *t, const KernelView *v, const double *x, const double *x0) {
    int i;
    for (i = 0; i < FIXED(t, states); ++i) v->shift[i] = x[i] - x0[i];
    return v->shift;
}

/* One tick without rebase: x <- A x + B u, per local model or for the blend. */
static inline void kernel_advance(const Tables *t, const KernelView *v, const KernelBlend *blend, const double *inputs) {
    int affine = FIXED(t, offsets) == OFFSETS_AFFINE;
    const double *source = v->x;
    int i, k;
    if (!affine) kernel_deviation(t, v, inputs, t->input_operating_point);
    if (FIXED(t, blending) == BLENDING_OUTPUT) {
        for (k = 0; k < FIXED(t, local_models); ++k) {
            double *x = v->x + k * FIXED(t, states);
            source = x;
            if (affine) {
                kernel_deviation(t, v, inputs, t->u0 + k * FIXED(t, inputs));
                source = kernel_shifted(t, v, x, t->x0 + k * FIXED(t, states));
            }
            kernel_transition(t, k, source, v->deviation, v->next);
            for (i = 0; i < FIXED(t, states); ++i) x[i] = kernel_significant(v->next[i]);
        }
        return;
    }
    if (affine) {
        kernel_blended(blend, t->u0, FIXED(t, inputs), v->u0);
        kernel_blended(blend, t->x0, FIXED(t, states), v->x0);
        kernel_deviation(t, v, inputs, v->u0);
        source = kernel_shifted(t, v, v->x, v->x0);
    }
    for (i = 0; i < FIXED(t, states); ++i) v->next[i] = 0.0;
    for (k = 0; k < blend->count; ++k) {
        kernel_transition(t, blend->first + k, source, v->deviation, v->product);
        for (i = 0; i < FIXED(t, states); ++i) v->next[i] += blend->weights[k] * v->product[i];
    }
    for (i = 0; i < FIXED(t, states); ++i) v->x[i] = kernel_significant(v->next[i]);
}

/* held = y_op, or y_e(position) where there is a static map, or zero for affine offsets (y0 follows) */
static inline void kernel_rest(const Tables *t, const KernelView *v) {
    double position = FIXED(t, offsets) == OFFSETS_LOW_PASS ? v->low_pass[0] : v->scheduling_held[0];
    int i;
    if (FIXED(t, map_points) > 0) {
        int cell = kernel_cell(t->map_positions, FIXED(t, map_points), FIXED(t, map_scale), position);
        double fraction = kernel_fraction(t->map_positions, cell, position);
        kernel_between(t->map_values, FIXED(t, outputs), cell, fraction, v->held);
    } else {
        for (i = 0; i < FIXED(t, outputs); ++i) {
            v->held[i] = FIXED(t, offsets) == OFFSETS_AFFINE ? 0.0 : t->output_operating_point[i];
        }
    }
}

/* s, or s + kappa (C x)_j with the deviation of the last tick */
static inline double kernel_scheduling(const Tables *t, const KernelView *v, double s) {
    return FIXED(t, deviation_gain) != 0.0 ? s + FIXED(t, deviation_gain) * v->deviation_held[0] : s;
}

/* held += weight (C x [+ y0 + D (u_op - u0)]) of one model, the brackets for affine offsets: then u_ref is u_op */
static inline void kernel_hold_model(
    const Tables *t, const KernelView *v, int model, double weight, const double *x, const double *u0) {
    int i;
    for (i = 0; i < FIXED(t, outputs); ++i) v->product[i] = 0.0;
    kernel_multiply(kernel_output_matrix(t, model), FIXED(t, outputs), FIXED(t, states), x, v->product);
    if (FIXED(t, deviation_gain) != 0.0) v->deviation_held[0] += weight * v->product[FIXED(t, deviation_output)];
    if (FIXED(t, offsets) == OFFSETS_AFFINE) {
        const double *y0 = t->y0 + model * FIXED(t, outputs);
        for (i = 0; i < FIXED(t, outputs); ++i) v->product[i] += y0[i];
        if (FIXED(t, feedthrough)) {
            const double *D = t->D + model * FIXED(t, inputs) * FIXED(t, outputs);
            kernel_deviation(t, v, t->input_operating_point, u0);
            kernel_multiply(D, FIXED(t, outputs), FIXED(t, inputs), v->deviation, v->product);
        }
    }
    for (i = 0; i < FIXED(t, outputs); ++i) v->held[i] += weight * v->product[i];
}

/* Outputs of the present x into held, blended D into feedthrough. */
static inline void kernel_hold(const Tables *t, const KernelView *v, const KernelBlend *blend) {
    int affine = FIXED(t, offsets) == OFFSETS_AFFINE;
    const double *source = v->x;
    int k;
    kernel_rest(t, v);
    v->deviation_held[0] = 0.0;
    if (FIXED(t, feedthrough)) kernel_blended(blend, t->D, FIXED(t, inputs) * FIXED(t, outputs), v->feedthrough);
    if (FIXED(t, blending) == BLENDING_OUTPUT) {
        for (k = 0; k < FIXED(t, local_models); ++k) {
            source = v->x + k * FIXED(t, states);
            if (affine) source = kernel_shifted(t, v, source, t->x0 + k * FIXED(t, states));
            kernel_hold_model(t, v, k, v->weights[k], source, affine ? t->u0 + k * FIXED(t, inputs) : v->u0);
        }
    } else {
        if (affine) source = kernel_shifted(t, v, v->x, v->x0);
        for (k = 0; k < blend->count; ++k) {
            kernel_hold_model(t, v, blend->first + k, blend->weights[k], source, v->u0);
        }
    }
}

/* x <- x - 1/2 (g(r_n) + g(r_n-1)) (s_n - s_n-1); with output blending every local model has its one g */
static inline void kernel_rebase(const Tables *t, const KernelView *v, const KernelBlend *blend, double change) {
    int i;
    if (FIXED(t, blending) == BLENDING_OUTPUT) {
        for (i = 0; i < FIXED(t, local_models) * FIXED(t, states); ++i) v->x[i] -= t->g[i] * change;
        return;
    }
    kernel_blended(blend, t->g, FIXED(t, states), v->next);
    for (i = 0; i < FIXED(t, states); ++i) {
        v->x[i] -= (0.5 * (v->next[i] + v->g_held[i])) * change;
        v->g_held[i] = v->next[i];
    }
}

/* outside = 1 when r has moved from `before` further than is certified */
static inline void kernel_watch_move(const Tables *t, const KernelView *v, double before) {
    double move = v->position[0] - before, most = FIXED(t, certified_move);
    if (most > 0.0 && (move > most || move < -most)) v->outside[0] = 1.0;
}

/* t_n -> t_n+1 with the inputs in force at t_n. */
static inline void kernel_tick(const Tables *t, double *state, const double *inputs) {
    KernelView v = kernel_view(t, state);
    double s = inputs[FIXED(t, scheduling)];
    double change = s - v.scheduling_held[0];
    double before = v.position[0];
    KernelBlend blend;
    if (FIXED(t, offsets) == OFFSETS_LOW_PASS) {
        v.low_pass[0] = kernel_significant(v.low_pass[0] + FIXED(t, low_pass_gain) * (s - v.low_pass[0]));
    }
    blend = kernel_schedule(t, &v, FIXED(t, offsets) == OFFSETS_LOW_PASS ? v.low_pass[0] : kernel_scheduling(t, &v, s));
    v.scheduling_held[0] = s;
    kernel_watch_move(t, &v, before);
    if (FIXED(t, offsets) == OFFSETS_SCHEDULED_EQUILIBRIUM) kernel_rebase(t, &v, &blend, change);
    kernel_advance(t, &v, &blend, inputs);
    kernel_hold(t, &v, &blend);
}

/* The p outputs, from the state and the inputs set last. */
static inline void kernel_present(const Tables *t, const KernelView *v, const double *inputs, double *restrict values) {
    int i, j;
    for (i = 0; i < FIXED(t, outputs); ++i) values[i] = v->held[i];
    for (j = 0; j < FIXED(t, inputs) && FIXED(t, feedthrough); ++j) {
        int filtered = FIXED(t, offsets) == OFFSETS_LOW_PASS && j == FIXED(t, scheduling);
        double deviation = inputs[j] - (filtered ? v->low_pass[0] : t->input_operating_point[j]);
        kernel_multiply(v->feedthrough + j * FIXED(t, outputs), FIXED(t, outputs), 1, &deviation, values);
    }
}

/* Derived output i from the p outputs and the inputs. */
static inline double kernel_derived(const Tables *t, int i, const double *outputs, const double *inputs) {
    double sum = 0.0;
    int term;
    for (term = i > 0 ? t->term_ends[i - 1] : 0; term < t->term_ends[i]; ++term) {
        int signal = t->term_signals[term];
        sum += t->term_coefficients[term] * (signal < FIXED(t, outputs) ? outputs[signal] : inputs[signal - FIXED(t, outputs)]);
    }
    return sum;
}

/* The p outputs and then the R derived outputs, from the state and the inputs set last. Writes nothing to the state. */
static inline void kernel_outputs(const Tables *t, const double *state, const double *inputs, double *restrict values) {
    KernelView v = kernel_view(t, (double *)state);
    int i;
    kernel_present(t, &v, inputs, values);
    for (i = 0; i < FIXED(t, derived); ++i) values[FIXED(t, outputs) + i] = kernel_derived(t, i, values, inputs);
}

/* The exact partial derivative of output i (derived ones counted behind) by input j. */
static inline double kernel_feedthrough(const Tables *t, const double *state, int i, int j) {
    KernelView v = kernel_view(t, (double *)state);
    double sum = 0.0;
    int term;
    if (i < FIXED(t, outputs)) return v.feedthrough[j * FIXED(t, outputs) + i];
    term = i == FIXED(t, outputs) ? 0 : t->term_ends[i - FIXED(t, outputs) - 1];
    for (; term < t->term_ends[i - FIXED(t, outputs)]; ++term) {
        int signal = t->term_signals[term];
        double partial = signal < FIXED(t, outputs) ? v.feedthrough[j * FIXED(t, outputs) + signal] : 0.0;
        if (signal == FIXED(t, outputs) + j) partial = 1.0;
        sum += t->term_coefficients[term] * partial;
    }
    return sum;
}

#include "region.c"
#include "start.c"
