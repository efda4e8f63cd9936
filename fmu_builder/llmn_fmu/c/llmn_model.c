/* The kernel as a model of the slave (model.h). Variables stand in this order: inputs, outputs, derived outputs,
   validity_1..M, in_range, outside_certificate if stability is certified under a condition, parameters. The sizes are constants
   here, so that the compiler unrolls what the tables need.
   Model, its parameters and where its tables are: llmn_fixed.c, llmn_blended.c or llmn_theta.c.

   Inputs go through two doors: limits, where the importer wants them kept (region.c), then the contact (contact.c). */

enum {
    LLMN_FIRST_VALIDITY = LLMN_FIRST_OUTPUT + TABLES_OUTPUTS + TABLES_DERIVED,
    LLMN_IN_RANGE = LLMN_FIRST_VALIDITY + TABLES_LOCAL_MODELS,
    LLMN_OUTSIDE_CERTIFICATE = LLMN_IN_RANGE + 1,
    MODEL_WORK = 2 * TABLES_STATE_SIZE,
    MODEL_WATCHES_INPUTS = 1
};

#define ANY_MOVE 1.7976931348623157e308

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

static COLD const double *model_hold(const Model *model, double most, const double *given, double *limited)
{
    kernel_limited(&tables, model->state, most, given, limited);
    return limited;
}

/** the inputs after the first door: those given, or limited; limited[] is room for them */
static inline const double *model_limited(const Model *model, const double *given, double *limited)
{
    return model->options.policy == POLICY_CLAMP ? model_hold(model, tables.trained_move, given, limited) : given;
}

/** after the second door, those that act on what comes in `ahead` seconds: with the pan-head in the place of the wire it has
    left; acting[] is room for them */
static const double *model_acting(const Model *model, const double *inputs, double ahead, double *acting)
{
    if (CONTACT_SWITCH < 0 || model->options.unilateral == 0.0) {
        return inputs;
    }
    kernel_acting(&tables, &contact, model->state, ahead, inputs, acting);
    return acting;
}

/** whether the pan-head is off the wire that limited inputs hold */
static int model_is_off(const Model *model, const double *inputs)
{
    return CONTACT_SWITCH >= 0 && model->options.unilateral != 0.0 &&
           kernel_is_off(&tables, &contact, model->state, inputs);
}

/** steady state of the inputs */
static COLD int model_initialise(Model *model, double time, const double *given, Message *message)
{
    double limited[TABLES_INPUTS], value;
    const double *inputs =
        model->options.policy == POLICY_CLAMP ? model_hold(model, ANY_MOVE, given, limited) : given;
    int left;
    Tables own;
    const Tables *network = model_network(model, &own);
    options_forget(&model->options);
    if (kernel_start(network, model->state, inputs) != 0) {
        message_append(message, "the model has no steady state for the start inputs: an eigenvalue of A is 1");
        return 1;
    }
    if (model_is_off(model, inputs)) {
        message_append(message, "at rest the pan-head would not be on the wire at ");
        message_append_number(message, inputs[TABLES_SCHEDULING]);
        message_append(message, ", which a unilateral contact cannot hold; start with a larger torque");
        return 1;
    }
    left = kernel_left(network, model->state, given, inputs, &value);
    if (left != REGION_KEPT && region_leave(&model->options, left, value, time, message)) {
        return 1;
    }
    kernel_remember(&tables, model->state, left, inputs[TABLES_SCHEDULING]);
    return model_check(model, message);
}

/** in_range tells of all ticks of a step: a held input jumps in the first of them */
static void model_step_begins(Model *model)
{
    kernel_view(&tables, model->state).in_range[0] = 1.0;
}

static int model_tick(Model *model, double time, const double *given, Message *message)
{
    double limited[TABLES_INPUTS], acting[TABLES_INPUTS], value;
    const double *inputs = model_limited(model, given, limited), *last;
    Tables own;
    const Tables *network = model_network(model, &own);
    const double so_far = kernel_view(&tables, model->state).in_range[0];
    const int left = kernel_left(network, model->state, given, model_acting(model, inputs, 0.0, acting), &value);
    if (left != REGION_KEPT && region_leave(&model->options, left, value, time, message)) {
        return 1;
    }
    kernel_remember(&tables, model->state, left, inputs[TABLES_SCHEDULING]);
    kernel_view(&tables, model->state).in_range[0] *= so_far;
    last = model_acting(model, inputs, contact.half_tick, acting);
    kernel_tick(network, model->state, last);
    if (TABLES_CERTIFIED && last[TABLES_SCHEDULING] != inputs[TABLES_SCHEDULING]) {
        kernel_view(&tables, model->state).outside[0] = 1.0; /* the height follows the states: a loop nobody has proved */
    }
    return model_check(model, message);
}

static void model_outputs(const Model *model, double *values)
{
    const KernelView view = kernel_view(&tables, (double *)model->state);
    double limited[TABLES_INPUTS], acting[TABLES_INPUTS];
    Tables own;
    kernel_outputs(model_network(model, &own), model->state,
                   model_acting(model, model_limited(model, values, limited), 0.0, acting), values + LLMN_FIRST_OUTPUT);
    for (int i = 0; i < TABLES_LOCAL_MODELS; ++i) {
        values[LLMN_FIRST_VALIDITY + i] = view.weights[i];
    }
    values[LLMN_IN_RANGE] = view.in_range[0];
    if (TABLES_CERTIFIED) {
        values[LLMN_OUTSIDE_CERTIFICATE] = model_is_changed(model) ? 1.0 : view.outside[0];
    }
}

static unsigned model_alarms(const Model *model)
{
    const KernelView view = kernel_view(&tables, (double *)model->state);
    return (TABLES_CERTIFIED && view.outside[0] != 0.0 ? ALARM_CERTIFICATE : 0u) |
           (model->options.left != REGION_KEPT ? ALARM_REGION : 0u);
}

static COLD void model_tell(const Model *model, unsigned alarm, Message *message)
{
    if (alarm == ALARM_REGION) {
        region_tell(&model->options, message);
    } else {
        message_append(message, "the scheduling variable has moved faster than stability is proved for, or the contact has "
                                "opened (reported once)");
    }
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

/** exact: only feedthrough and the inputs in derived outputs act at once; neither an input that is limited nor a wire that
    the pan-head has left does */
static void model_directional_derivative(const Model *model, const double *values, const double *direction,
                                         double *change)
{
    double limited[TABLES_INPUTS];
    const double *inputs = model_limited(model, values, limited);
    Tables own;
    const Tables *network = model_network(model, &own);
    const int off = model_is_off(model, inputs);
    for (int i = 0; i < LLMN_FIRST_VALIDITY - LLMN_FIRST_OUTPUT; ++i) {
        for (int j = 0; j < TABLES_INPUTS; ++j) {
            if (!(off && j == TABLES_SCHEDULING) && inputs[j] == values[j]) {
                change[LLMN_FIRST_OUTPUT + i] += kernel_feedthrough(network, model->state, i, j) * direction[j];
            }
        }
    }
}

static COLD int model_start_derivative(const Model *model, const double *values, const double *direction,
                                       double *change, double *work, Message *message)
{
    double limited[TABLES_INPUTS], along[TABLES_INPUTS];
    const double *inputs = model_limited(model, values, limited);
    Tables own;
    for (int j = 0; j < TABLES_INPUTS; ++j) {
        along[j] = inputs[j] == values[j] ? direction[j] : 0.0;
    }
    if (kernel_start_tangent(model_network(model, &own), model->state, inputs, along, work,
                             work + TABLES_STATE_SIZE, change + LLMN_FIRST_OUTPUT) ||
        model_add_parameter_tangent(model, inputs, values, direction, change, work)) {
        message_append(message, "the steady state has no derivative: an eigenvalue of A is 1");
        return 1;
    }
    return 0;
}
