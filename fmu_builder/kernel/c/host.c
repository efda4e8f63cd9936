/* The kernel as Python loads it: whole runs in one call. */

#include "elementary.c"
#include "kernel.c"
#include "node_models.c"
#include "steady_tangent.c"
#include "chain.c"
#include "contact.c"

EXPORTED int llmn_state_size(const Tables *tables) { return kernel_state_size(tables); }

/* whether the inputs, as they are, keep the trained region; limits nothing */
static int llmn_watch(const Tables *tables, double *state, const double *inputs) {
    double value;
    int left = kernel_left(tables, state, inputs, inputs, &value);
    kernel_remember(tables, state, left, inputs[tables->scheduling]);
    return left;
}

EXPORTED int llmn_start(const Tables *tables, double *state, const double *inputs) {
    int failed = kernel_start(tables, state, inputs);
    (void)llmn_watch(tables, state, inputs);
    return failed;
}

EXPORTED int llmn_tick(const Tables *tables, double *state, const double *inputs) {
    int left = llmn_watch(tables, state, inputs);
    kernel_tick(tables, state, inputs);
    return left;
}

EXPORTED void llmn_outputs(const Tables *tables, const double *state, const double *inputs, double *values) {
    kernel_outputs(tables, state, inputs, values);
}

EXPORTED double llmn_feedthrough(const Tables *tables, const double *state, int output, int input) {
    return kernel_feedthrough(tables, state, output, input);
}

EXPORTED int llmn_start_tangent(
    const Tables *tables, const double *state, const double *inputs, const double *direction, double *scratch,
    double *tangent, double *change) {
    return kernel_start_tangent(tables, state, inputs, direction, scratch, tangent, change);
}

/* Row k: the outputs read after inputs[k] were set and before the tick that uses them. With a contact it is unilateral;
   acting is room for a row of inputs then. 1 = no steady state for row 0, 2 = none with contact. */
EXPORTED int llmn_simulate(
    const Tables *tables, double *state, const double *inputs, long long count, double *outputs, const Contact *contact,
    double *acting) {
    int columns = tables->outputs + tables->derived;
    long long row;
    if (kernel_start(tables, state, inputs)) return 1;
    if (contact && kernel_is_off(tables, contact, state, inputs)) return 2;
    for (row = 0; row < count; ++row) {
        const double *now = inputs + row * tables->inputs, *before = row > 0 ? now - tables->inputs : now;
        if (contact && row > 0) {
            kernel_acting(tables, contact, state, contact->half_tick, before, acting);
            before = acting;
        }
        if (row > 0) kernel_tick(tables, state, before);
        if (contact) {
            kernel_acting(tables, contact, state, 0.0, now, acting);
            now = acting;
        }
        kernel_outputs(tables, state, now, outputs + row * columns);
    }
    return 0;
}

/* weights[k] = phi(scheduling[k]); the state is scratch. */
EXPORTED void llmn_weights(
    const Tables *tables, double *state, const double *scheduling, long long count, double *weights) {
    KernelView view = kernel_view(tables, state);
    long long row;
    int i;
    for (row = 0; row < count; ++row) {
        (void)kernel_schedule(tables, &view, scheduling[row]);
        for (i = 0; i < tables->local_models; ++i) weights[row * tables->local_models + i] = view.weights[i];
    }
}

/* y_e(position[k]) by the kernel's own interpolation; the state is scratch. */
EXPORTED void llmn_static_map(
    const Tables *tables, double *state, const double *positions, long long count, double *values) {
    KernelView view = kernel_view(tables, state);
    long long row;
    int i;
    for (row = 0; row < count; ++row) {
        view.low_pass[0] = positions[row];
        view.scheduling_held[0] = positions[row];
        kernel_rest(tables, &view);
        for (i = 0; i < tables->outputs; ++i) values[row * tables->outputs + i] = view.held[i];
    }
}

EXPORTED void llmn_nodes(const Tables *tables, const double *rows, int length, double *nodes) {
    kernel_nodes(tables, rows, length, nodes);
}

EXPORTED int llmn_chain_table(
    const ChainTables *tables, const double *head, const double *theta, double *A, double *B, double *g, int *node) {
    return chain_table(tables, head, theta, A, B, g, node);
}

EXPORTED int llmn_chain_map_positions(
    const double *positions, const double *values, int outputs, int rows, double ratio, double *moved) {
    return chain_map_positions(positions, values, outputs, rows, ratio, moved);
}
