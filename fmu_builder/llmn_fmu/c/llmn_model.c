/* The kernel as a model of the slave (model.h). Variables stand in this order: inputs, outputs, derived outputs,
   validity_1..M, in_range, outside_certificate if stability is certified under a condition, parameters. The sizes are constants
   here, so that the compiler unrolls what the tables need.
   Model, its parameters and where its tables are: llmn_fixed.c, llmn_blended.c or llmn_theta.c. */

enum {
    LLMN_FIRST_OUTPUT = TABLES_INPUTS,
    LLMN_FIRST_VALIDITY = LLMN_FIRST_OUTPUT + TABLES_OUTPUTS + TABLES_DERIVED,
    LLMN_IN_RANGE = LLMN_FIRST_VALIDITY + TABLES_LOCAL_MODELS,
    LLMN_OUTSIDE_CERTIFICATE = LLMN_IN_RANGE + 1,
    MODEL_WORK = 2 * TABLES_STATE_SIZE
};

static double model_sample_time(const Model *model)
{
    (void)model;
    return TABLES_SAMPLE_TIME;
}

/** whether the outputs are numbers; they are not when the inputs are of astronomic size */
static int model_check(const Model *model, Message *message)
{
    const KernelView view = kernel_view(&tables, (double *)model->state); /* sizes only: all tables have the same */
    for (int i = 0; i < TABLES_OUTPUTS; ++i) {
        if (!(view.held[i] - view.held[i] == 0.0)) {
            message_append(message, "the outputs leave the range of numbers; are the inputs right?");
            return 1;
        }
    }
    return 0;
}

/** the inputs that act on what comes in `ahead` seconds: those given, or with the pan-head in the place of the wire it has
    left; acting[] is room for them */
static const double *model_acting(const Model *model, const double *inputs, double ahead, double *acting)
{
    if (CONTACT_SWITCH < 0 || model->unilateral == 0.0) {
        return inputs;
    }
    kernel_acting(&tables, &contact, model->state, ahead, inputs, acting);
    return acting;
}

/** steady state of the inputs */
static COLD int model_initialise(Model *model, const double *inputs, Message *message)
{
    Tables own;
    if (kernel_start(model_network(model, &own), model->state, inputs) != 0) {
        message_append(message, "the model has no steady state for the start inputs: an eigenvalue of A is 1");
        return 1;
    }
    if (CONTACT_SWITCH >= 0 && model->unilateral != 0.0 && kernel_is_off(&tables, &contact, model->state, inputs)) {
        message_append(message, "at rest the pan-head would not be on the wire at ");
        message_append_number(message, inputs[TABLES_SCHEDULING]);
        message_append(message, ", which a unilateral contact cannot hold; start with a larger torque");
        return 1;
    }
    return model_check(model, message);
}

static int model_tick(Model *model, const double *inputs, Message *message)
{
    const double *given = inputs;
    double acting[TABLES_INPUTS];
    Tables own;
    inputs = model_acting(model, inputs, contact.half_tick, acting);
    kernel_tick(model_network(model, &own), model->state, inputs);
    if (TABLES_CERTIFIED && inputs[TABLES_SCHEDULING] != given[TABLES_SCHEDULING]) {
        kernel_view(&tables, model->state).outside[0] = 1.0; /* the height follows the states: a loop nobody has proved */
    }
    return model_check(model, message);
}

static void model_outputs(const Model *model, double *values)
{
    const KernelView view = kernel_view(&tables, (double *)model->state);
    double acting[TABLES_INPUTS];
    Tables own;
    kernel_outputs(model_network(model, &own), model->state, model_acting(model, values, 0.0, acting),
                   values + LLMN_FIRST_OUTPUT);
    for (int i = 0; i < TABLES_LOCAL_MODELS; ++i) {
        values[LLMN_FIRST_VALIDITY + i] = view.weights[i];
    }
    values[LLMN_IN_RANGE] = view.in_range[0];
    if (TABLES_CERTIFIED) {
        values[LLMN_OUTSIDE_CERTIFICATE] = model_is_changed(model) ? 1.0 : view.outside[0];
    }
}

static const char *model_alarm(const Model *model)
{
    const KernelView view = kernel_view(&tables, (double *)model->state);
    return TABLES_CERTIFIED && view.outside[0] != 0.0
               ? "the scheduling variable has moved faster than stability is proved for, or the contact has opened (reported "
                 "once)"
               : 0;
}

/** there are no continuous states: only the slave's common code speaks of them */
static void model_set_states(Model *model, const double *states)
{
    (void)model;
    (void)states;
}

static int model_check_states(const Model *model, const double *inputs, Message *message)
{
    (void)model;
    (void)inputs;
    (void)message;
    return 0;
}

static void model_event_indicators(const Model *model, const double *values, double *indicators)
{
    (void)model;
    (void)values;
    (void)indicators;
}

/** exact: only feedthrough and the inputs in derived outputs act at once; a wire that the pan-head has left does not */
static void model_directional_derivative(const Model *model, const double *values, const double *direction,
                                         double *change)
{
    Tables own;
    const Tables *network = model_network(model, &own);
    const int off = CONTACT_SWITCH >= 0 && model->unilateral != 0.0 &&
                    kernel_is_off(&tables, &contact, model->state, values);
    for (int i = 0; i < LLMN_FIRST_VALIDITY - LLMN_FIRST_OUTPUT; ++i) {
        for (int j = 0; j < TABLES_INPUTS; ++j) {
            if (!(off && j == TABLES_SCHEDULING)) {
                change[LLMN_FIRST_OUTPUT + i] += kernel_feedthrough(network, model->state, i, j) * direction[j];
            }
        }
    }
}

static COLD int model_start_derivative(const Model *model, const double *values, const double *direction,
                                       double *change, double *work, Message *message)
{
    Tables own;
    if (kernel_start_tangent(model_network(model, &own), model->state, values, direction, work,
                             work + TABLES_STATE_SIZE, change + LLMN_FIRST_OUTPUT) ||
        model_add_parameter_tangent(model, values, direction, change, work)) {
        message_append(message, "the steady state has no derivative: an eigenvalue of A is 1");
        return 1;
    }
    return 0;
}
