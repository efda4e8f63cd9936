/* The white-box model behind the model contract of the FMI layer (fmi2/c/model.h). */

enum { PARAMETER_COUNT_OF_SET = sizeof(Parameters) / sizeof(double), FIRST_PARAMETER = VARIABLE_l1 };

/* The preset, with what was given another value than its start in the place of what it says. */
static int model_set_parameters(Model *model, const double *values, Message *message) {
    const int preset = (int)values[VARIABLE_preset] - 1;
    union {
        Parameters set;
        double numbers[PARAMETER_COUNT_OF_SET];
    } chosen;
    int n;
    if (preset < 0 || preset >= PARAMETER_SET_COUNT) {
        message_append(message, "preset = ");
        message_append_number(message, values[VARIABLE_preset]);
        message_append(message, " is none of the parameter sets");
        return 1;
    }
    chosen.set = parameter_sets[preset];
    for (n = 0; n < PARAMETER_COUNT_OF_SET; ++n) {
        const double value = values[FIRST_PARAMETER + n];
        if (value != variable_start[FIRST_PARAMETER + n]) chosen.numbers[n] = value;
    }
    return wbm_prepare(model, &chosen.set, values[VARIABLE_inner_step], message);
}

/* nothing can be changed while it runs */
static int model_retune(Model *model, const double *values, Message *message) {
    (void)model;
    (void)values;
    (void)message;
    return 0;
}

static const char *model_remark(const double *values) {
    (void)values;
    return 0;
}

static double model_sample_time(const Model *model) { return model->step; }

static int model_initialise(Model *model, const double *inputs, Message *message) {
    return wbm_start(model, inputs, message);
}

static int model_tick(Model *model, const double *inputs, Message *message) {
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

/* The equilibrium follows the inputs; velocities and accelerations stay zero, and inner_step has no part in it. The physical
   parameters are not differentiated. */
static int model_start_derivative(
    const Model *model, const double *values, const double *direction, double *change, Message *message
) {
    const double inputs[INPUTS] = {values[VARIABLE_eta], values[VARIABLE_M_pa]};
    const double du[INPUTS] = {direction[VARIABLE_eta], direction[VARIABLE_M_pa]};
    double dx[STATE_COUNT];
    int n;
    for (n = FIRST_PARAMETER; n < FIRST_PARAMETER + PARAMETER_COUNT_OF_SET; ++n) {
        if (direction[n] != 0.0) {
            message_append(message, "no derivative with respect to ");
            message_append(message, variable_name[n]);
            message_append(message, ": physical parameters are not differentiated");
            return 1;
        }
    }
    wbm_equilibrium_tangent(&model->constants, model->state, inputs, du, dx);
    wbm_outputs_tangent(&model->constants, model->state, inputs, dx, du, change + VARIABLE_xi);
    return 0;
}
