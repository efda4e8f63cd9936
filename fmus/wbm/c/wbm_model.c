/* The white-box model behind the model contract of the FMI layer (fmi2/c/model.h). */

enum { PARAMETER_COUNT_OF_SET = sizeof(Parameters) / sizeof(double), FIRST_PARAMETER = VARIABLE_l1 };

/* Parameters by name, and in their order. */
typedef union {
    Parameters set;
    double numbers[PARAMETER_COUNT_OF_SET];
} NumberedParameters;

/* A parameter that nobody has set follows the preset. */
static int model_follows_preset(const double *values, int n) {
    return values[FIRST_PARAMETER + n] == variable_start[FIRST_PARAMETER + n];
}

/* The preset, with what was given another value than its start in the place of what it says. */
static NumberedParameters model_chosen(const double *values) {
    NumberedParameters chosen;
    int n;
    chosen.set = parameter_sets[(int)values[VARIABLE_preset] - 1];
    for (n = 0; n < PARAMETER_COUNT_OF_SET; ++n) {
        if (!model_follows_preset(values, n)) chosen.numbers[n] = values[FIRST_PARAMETER + n];
    }
    return chosen;
}

static COLD int model_set_parameters(Model *model, const double *values, Message *message) {
    const int preset = (int)values[VARIABLE_preset] - 1;
    NumberedParameters chosen;
    if (preset < 0 || preset >= PARAMETER_SET_COUNT) {
        message_append(message, "preset = ");
        message_append_number(message, values[VARIABLE_preset]);
        message_append(message, " is none of the parameter sets");
        return 1;
    }
    chosen = model_chosen(values);
    return wbm_prepare(model, &chosen.set, values[VARIABLE_inner_step], message);
}

/* nothing can be changed while it runs */
static int model_retune(Model *model, const double *values, Message *message) {
    (void)model;
    (void)values;
    (void)message;
    return 0;
}

enum { MODEL_WATCHES_INPUTS = 0 };

static unsigned model_alarms(const Model *model) {
    (void)model;
    return 0;
}

static void model_tell(const Model *model, unsigned alarm, Message *message) {
    (void)model;
    (void)alarm;
    (void)message;
}

static const char *model_remark(const double *values) {
    (void)values;
    return 0;
}

static double model_sample_time(const Model *model) { return model->step; }

static int model_initialise(Model *model, double time, const double *inputs, Message *message) {
    (void)time;
    return wbm_start(model, inputs, message);
}

static void model_step_begins(Model *model) { (void)model; }

static int model_tick(Model *model, double time, const double *inputs, Message *message) {
    (void)time;
    return wbm_advance(model, inputs, message);
}

static void model_outputs(const Model *model, double *values) {
    const double inputs[INPUTS] = {values[VARIABLE_eta], values[VARIABLE_M_pa]};
    wbm_outputs(&model->constants, model->state, inputs, values + VARIABLE_xi);
    wbm_derivatives(&model->constants, model->state, inputs, values + VARIABLE_der_phi_1);
}

static void model_set_states(Model *model, const double *states) {
    int n;
    for (n = 0; n < STATE_COUNT; ++n) model->state[n] = states[n];
}

static int model_check_states(const Model *model, const double *inputs, Message *message) {
    return wbm_check_inputs(model, inputs, message) || wbm_check_state(model, model->state, inputs, message);
}

/* A unilateral contact has a kink where the pan-head leaves the wire or touches it; otherwise nothing ever happens. */
static void model_event_indicators(const Model *model, const double *values, double *indicators) {
    indicators[0] = model->constants.unilateral != 0.0 ? model->state[STATE_XI] - values[VARIABLE_eta] : 1.0;
}

/* Exact derivative of outputs and state derivatives along a line of inputs and states. */
static void model_directional_derivative(
    const Model *model, const double *values, const double *direction, double *change
) {
    const double inputs[INPUTS] = {values[VARIABLE_eta], values[VARIABLE_M_pa]};
    const double du[INPUTS] = {direction[VARIABLE_eta], direction[VARIABLE_M_pa]};
    double dx[STATE_COUNT];
    int n;
    for (n = 0; n < STATE_COUNT; ++n) dx[n] = direction[continuous_state[n].state];
    wbm_outputs_tangent(&model->constants, model->state, inputs, dx, du, change + VARIABLE_xi);
    wbm_derivatives_tangent(&model->constants, model->state, inputs, dx, du, change + VARIABLE_der_phi_1);
}

enum { MODEL_WORK = 1 };

/* The equilibrium follows inputs and physical parameters; velocities and accelerations stay zero, and inner_step has no part
   in it. A parameter that follows another preset than the one it starts with jumps away from it: no derivative there. */
static COLD int model_start_derivative(
    const Model *model, const double *values, const double *direction, double *change, double *work,
    Message *message
) {
    const double inputs[INPUTS] = {values[VARIABLE_eta], values[VARIABLE_M_pa]};
    const double du[INPUTS] = {direction[VARIABLE_eta], direction[VARIABLE_M_pa]};
    const NumberedParameters chosen = model_chosen(values);
    NumberedParameters d_chosen;
    double dx[STATE_COUNT] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, d_rate[STATE_COUNT], dy[OUTPUT_COUNT];
    int n;
    (void)work;
    for (n = 0; n < PARAMETER_COUNT_OF_SET; ++n) {
        d_chosen.numbers[n] = direction[FIRST_PARAMETER + n];
        if (d_chosen.numbers[n] != 0.0 && chosen.numbers[n] != values[FIRST_PARAMETER + n]) {
            message_append(message, "no derivative with respect to ");
            message_append(message, variable_name(FIRST_PARAMETER + n));
            message_append(message, ": it has its start value, so the preset decides; give it a value of its own");
            return 1;
        }
    }
    wbm_derivatives_tangent(&model->constants, model->state, inputs, dx, du, d_rate);
    for (n = 0; n < OUTPUT_COUNT; ++n) dy[n] = 0.0;
    wbm_add_parameter_tangent(&chosen.set, &d_chosen.set, model->state, inputs, d_rate, dy);
    wbm_equilibrium_tangent(&model->constants, model->state, inputs, d_rate, dx);
    wbm_outputs_tangent(&model->constants, model->state, inputs, dx, du, change + VARIABLE_xi);
    for (n = 0; n < OUTPUT_COUNT; ++n) change[VARIABLE_xi + n] += dy[n];
    return 0;
}
