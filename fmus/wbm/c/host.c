/* The white-box model as a library for Python: whole records in one call, any parameters, no FMI. */
#include "elementary.c"
#include "message.c"
#include "wbm_friction.c"
#include "wbm_equations.c"
#include "wbm_tangent.c"
#include "wbm_motion.c"
#include "wbm_step.c"

enum { PARAMETER_COUNT = (int)(sizeof(Parameters) / sizeof(double)) };

EXPORTED unsigned wbm_parameter_count(void);
EXPORTED long long wbm_simulate(const double *parameters, double step, long long ticks_per_row, long long rows,
                                const double *inputs, double *state, int settled, double *outputs, char *text);
EXPORTED int wbm_settle(const double *parameters, const double *inputs, double *state, double *reach, char *text);
EXPORTED void wbm_rates(const double *parameters, const double *state, const double *inputs, double *rate);
EXPORTED void wbm_tangent(const double *parameters, const double *state, const double *inputs, const double *d_state,
                          const double *d_inputs, double *d_rate, double *d_outputs);

static Parameters host_parameters(const double *values) {
    union {
        Parameters named;
        double listed[sizeof(Parameters) / sizeof(double)];
    } both;
    int n;
    for (n = 0; n < PARAMETER_COUNT; ++n) both.listed[n] = values[n];
    return both.named;
}

static int host_refuse(const Message *message, char *text) {
    unsigned n;
    for (n = 0U; n < message->length; ++n) text[n] = message->text[n];
    text[message->length] = '\0';
    return 1;
}

unsigned wbm_parameter_count(void) { return (unsigned)PARAMETER_COUNT; }

/* Row k of outputs: read after the inputs of row k were set and before the step to row k + 1. Starts from `state`
   when `settled` is 0, otherwise from the static equilibrium of row 0; `state` ends at the last row.
   Returns the number of rows done; fewer than `rows` means the text says why. */
long long wbm_simulate(const double *parameters, double step, long long ticks_per_row, long long rows,
                       const double *inputs, double *state, int settled, double *outputs, char *text) {
    const Parameters named = host_parameters(parameters);
    Message message = {{0}, 0U};
    Model model;
    long long row, tick;
    int n;
    if (wbm_prepare(&model, &named, step, &message) || (settled && wbm_start(&model, inputs, &message))) {
        host_refuse(&message, text);
        return 0;
    }
    for (n = 0; n < STATE_COUNT && !settled; ++n) model.state[n] = state[n];
    for (row = 0; row < rows; ++row) {
        const double *u = inputs + row * INPUTS;
        wbm_outputs(&model.constants, model.state, u, outputs + row * OUTPUT_COUNT);
        for (tick = 0; row + 1 < rows && tick < ticks_per_row; ++tick) {
            if (wbm_advance(&model, u, &message)) {
                host_refuse(&message, text);
                return row + 1;
            }
        }
    }
    for (n = 0; n < STATE_COUNT; ++n) state[n] = model.state[n];
    return rows;
}

/* Static equilibrium and reach (phi low, phi high, height low, height high); 1 with a text when there is none. */
int wbm_settle(const double *parameters, const double *inputs, double *state, double *reach, char *text) {
    const Parameters named = host_parameters(parameters);
    Message message = {{0}, 0U};
    Model model;
    int n;
    if (wbm_prepare(&model, &named, 0.0005, &message)) return host_refuse(&message, text);
    reach[0] = model.reach.phi_low;
    reach[1] = model.reach.phi_high;
    reach[2] = model.reach.height_low;
    reach[3] = model.reach.height_high;
    if (wbm_start(&model, inputs, &message)) return host_refuse(&message, text);
    for (n = 0; n < STATE_COUNT; ++n) state[n] = model.state[n];
    return 0;
}

void wbm_rates(const double *parameters, const double *state, const double *inputs, double *rate) {
    const Parameters named = host_parameters(parameters);
    const Constants constants = wbm_constants(&named);
    wbm_derivatives(&constants, state, inputs, rate);
}

void wbm_tangent(const double *parameters, const double *state, const double *inputs, const double *d_state,
                 const double *d_inputs, double *d_rate, double *d_outputs) {
    const Parameters named = host_parameters(parameters);
    const Constants constants = wbm_constants(&named);
    wbm_derivatives_tangent(&constants, state, inputs, d_state, d_inputs, d_rate);
    wbm_outputs_tangent(&constants, state, inputs, d_state, d_inputs, d_outputs);
}
