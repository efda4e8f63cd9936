/* The white-box model behind the model contract of the FMI layer (fmi2/c/model.h). */

static int model_set_parameters(Model *model, const double *values, Message *message) {
    const int preset = (int)values[VARIABLE_preset] - 1;
    if (preset < 0 || preset >= PARAMETER_SET_COUNT) {
        message_append(message, "preset = ");
        message_append_number(message, values[VARIABLE_preset]);
        message_append(message, " is none of the parameter sets");
        return 1;
    }
    return wbm_prepare(model, &parameter_sets[preset], values[VARIABLE_inner_step], message);
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

/* Exact partial derivative of an output or a state derivative with respect to an input or a state. */
static int model_directional_derivative(
    const Model *model, const double *values, unsigned unknown, unsigned known, double *result
) {
    static const unsigned state_variable[STATE_COUNT] = {
        VARIABLE_phi_1, VARIABLE_phi_1_dot, VARIABLE_delta, VARIABLE_delta_dot, VARIABLE_xi, VARIABLE_xi_dot};
    const double inputs[INPUTS] = {values[VARIABLE_eta], values[VARIABLE_M_pa]};
    double dx[STATE_COUNT] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, du[INPUTS] = {0.0, 0.0};
    double change[OUTPUT_COUNT];
    unsigned found = 0U, n;
    for (n = 0U; n < STATE_COUNT; ++n) {
        if (state_variable[n] == known) {
            dx[n] = 1.0;
            found = 1U;
        }
    }
    if (known < INPUTS) {
        du[known] = 1.0;
        found = 1U;
    }
    if (!found) return 1;
    if (unknown >= VARIABLE_xi && unknown < VARIABLE_xi + OUTPUT_COUNT) {
        wbm_outputs_tangent(&model->constants, model->state, dx, du, change);
        *result = change[unknown - VARIABLE_xi];
        return 0;
    }
    if (unknown >= VARIABLE_der_phi_1 && unknown < VARIABLE_der_phi_1 + STATE_COUNT) {
        wbm_derivatives_tangent(&model->constants, model->state, inputs, dx, du, change);
        *result = change[unknown - VARIABLE_der_phi_1];
        return 0;
    }
    return 1;
}
