/* A surrogate with physical parameters: k_E and then theta, local model by local model, behind the Booleans. The models at the
   nodes are made of them when an instance starts and when they change, and live in the model; the rest of the tables are
   constants. */

enum {
    LLMN_FIRST_PARAMETER = TABLES_INPUTS + TABLES_OUTPUTS + TABLES_DERIVED + TABLES_LOCAL_MODELS + 1 +
                           TABLES_CERTIFIED,
    LLMN_PARAMETERS = 1 + THETA_PARAMETERS * TABLES_LOCAL_MODELS,
    LLMN_TERM_SLOTS = THETA_TERMS > 0 ? THETA_TERMS : 1
};

typedef struct {
    double state[TABLES_STATE_SIZE];
    Options options;
    double parameters[LLMN_PARAMETERS]; /* what the model computes with */
    double changed;                     /* 1.0: they are not those identified */
    double made;                        /* 1.0: what follows is made of them */
    double A[TABLES_NODES * CHAIN_STATES * CHAIN_STATES];
    double B[TABLES_NODES * CHAIN_INPUTS * CHAIN_STATES];
    double g[TABLES_NODES * CHAIN_STATES];
    double map_positions[TABLES_MAP_POINTS];
    double term_coefficients[LLMN_TERM_SLOTS];
} Model;

/** the tables the model computes with, in *own */
static inline const Tables *model_network(const Model *model, Tables *own)
{
    *own = tables;
    own->A = model->A;
    own->B = model->B;
    own->g = model->g;
    own->map_positions = model->map_positions;
    own->term_coefficients = model->term_coefficients;
    return own;
}

/** message + what is wrong at a node of the table */
static COLD void theta_append_trouble(Message *message, int answer, int node)
{
    message_append(message, "with these physical parameters the model at the height ");
    message_append_number(message, tables.node_positions[node]);
    message_append(message, answer == CHAIN_UNSTABLE ? " m is unstable" : " m has no state of rest");
}

/** tables for model->parameters; 1 with a message: there are none, and those of the model are spoilt */
static COLD int theta_rebuild(Model *model, Message *message)
{
    const double head[CHAIN_HEAD] = {theta_head[CHAIN_M_C], theta_head[CHAIN_K_C], theta_head[CHAIN_C_C],
                                     model->parameters[0]};
    int node = 0, answer = CHAIN_FINE;
    model->made = 0.0;
    model->changed = 0.0;
    for (int k = 0; k < LLMN_PARAMETERS; ++k) {
        if (model->parameters[k] != variable_start[LLMN_FIRST_PARAMETER + k]) {
            model->changed = 1.0;
        }
    }
    answer = chain_table(&theta_tables, head, model->parameters + 1, model->A, model->B, model->g, &node);
    if (answer != CHAIN_FINE) {
        theta_append_trouble(message, answer, node);
        return 1;
    }
    if (chain_map_positions(tables.map_positions, tables.map_values, TABLES_OUTPUTS, TABLES_MAP_POINTS,
                            theta_head[CHAIN_K_E] / model->parameters[0], model->map_positions)) {
        message_append(message, "with so soft a contact the wire would have to fall for the frame to rise at rest");
        return 1;
    }
    for (int k = 0; k < THETA_TERMS; ++k) {
        const double known = tables.term_coefficients[k];
        const double size = theta_stiffness_terms[k] ? model->parameters[0] : known < 0.0 ? -known : known;
        model->term_coefficients[k] = known < 0.0 ? -size : size;
    }
    model->made = 1.0;
    return 0;
}

static int model_set_parameters(Model *model, const double *values, Message *message)
{
    int changed = model->made == 0.0;
    for (int k = 0; k < LLMN_PARAMETERS; ++k) {
        changed = changed || model->parameters[k] != values[LLMN_FIRST_PARAMETER + k];
        model->parameters[k] = values[LLMN_FIRST_PARAMETER + k];
    }
    options_set(&model->options, values);
    return changed ? theta_rebuild(model, message) : 0;
}

/** after a change while the model runs: positions and velocities stay, so where rest has moved, what counts from it moves;
    delta_M, which is not measured, moves as the others do */
static COLD void theta_carry_over(Model *model, int rest_moved)
{
    double weights[TABLES_LOCAL_MODELS], held[TABLES_OUTPUTS], known = model->state[0];
    Tables own;
    const Tables *network = model_network(model, &own);
    const KernelView view = kernel_view(network, model->state);
    const double position = view.position[0]; /* a change is no tick: the next one moves from where the last one was */
    KernelBlend blend;
    for (int i = 0; i < TABLES_LOCAL_MODELS; ++i) {
        weights[i] = view.weights[i];
    }
    blend = kernel_schedule(network, &view, kernel_scheduling(network, &view, view.scheduling_held[0]));
    kernel_blended(&blend, network->g, TABLES_STATES, view.g_held);
    for (int i = 0; i < TABLES_LOCAL_MODELS; ++i) {
        view.weights[i] = weights[i];
    }
    view.position[0] = position;
    if (!rest_moved) {
        return;
    }
    for (int i = 0; i < TABLES_OUTPUTS; ++i) {
        held[i] = view.held[i];
    }
    kernel_rest(network, &view);
    for (int i = 0; i < TABLES_OUTPUTS; ++i) {
        view.x[i] = held[i] - view.held[i];
        view.held[i] = held[i];
    }
    view.x[4] += (view.x[0] - known) * (view.g_held[4] / view.g_held[0]);
    if (network->deviation_gain != 0.0) {
        view.deviation_held[0] = view.x[network->deviation_output];
    }
}

static int model_retune(Model *model, const double *values, Message *message)
{
    double before[LLMN_PARAMETERS];
    Message nothing;
    int changed = 0;
    for (int k = 0; k < LLMN_PARAMETERS; ++k) {
        before[k] = model->parameters[k];
        model->parameters[k] = values[LLMN_FIRST_PARAMETER + k];
        changed = changed || model->parameters[k] != before[k];
    }
    if (changed && theta_rebuild(model, message) != 0) {
        for (int k = 0; k < LLMN_PARAMETERS; ++k) {
            model->parameters[k] = before[k];
        }
        message_clear(&nothing);
        (void)theta_rebuild(model, &nothing); /* these have been possible before */
        return 1;
    }
    if (changed) {
        theta_carry_over(model, model->parameters[0] != before[0]);
    }
    return 0;
}

/** whether the model computes with other numbers than those that were identified */
static int model_is_changed(const Model *model)
{
    return model->changed != 0.0;
}

static const char *model_remark(const double *values)
{
    for (int k = LLMN_FIRST_PARAMETER; k < LLMN_FIRST_PARAMETER + LLMN_PARAMETERS; ++k) {
        if (values[k] != variable_start[k]) {
            return "physical parameters differ from those identified: the scores, and any certificate of stability, of "
                   "this model no longer apply (reported once)";
        }
    }
    return 0;
}

/** what the static map changes by at this height when k_E changes by d_stiffness: its rows stand at other heights */
static COLD void theta_rest_tangent(const Tables *network, double height, double stiffness, double d_stiffness,
                                    double *d_rest)
{
    const int cell = kernel_cell(network->map_positions, TABLES_MAP_POINTS, tables.map_scale, height);
    const double fraction = kernel_fraction(network->map_positions, cell, height);
    const double *row = tables.map_values + cell * TABLES_OUTPUTS;
    const double share = theta_head[CHAIN_K_E] / stiffness * (d_stiffness / stiffness); /* - d ratio */
    const double d_left = (row[0] - tables.map_positions[cell]) * share;
    const double d_right = (row[TABLES_OUTPUTS] - tables.map_positions[cell + 1]) * share;
    const double width = network->map_positions[cell + 1] - network->map_positions[cell];
    const double d_fraction = -(d_left + fraction * (d_right - d_left)) / width;
    for (int i = 0; i < TABLES_OUTPUTS; ++i) {
        d_rest[i] = (row[TABLES_OUTPUTS + i] - row[i]) * d_fraction;
    }
}

/** change[] of what rests, along parameters; work[2 TABLES_STATE_SIZE] */
static COLD int model_add_parameter_tangent(const Model *model, const double *inputs, const double *values,
                                            const double *direction, double *change, double *work)
{
    const double *along = direction + LLMN_FIRST_PARAMETER;
    const double head[CHAIN_HEAD] = {theta_head[CHAIN_M_C], theta_head[CHAIN_K_C], theta_head[CHAIN_C_C],
                                     model->parameters[0]};
    const double d_head[CHAIN_HEAD] = {0.0, 0.0, 0.0, along[0]};
    double d_rest[TABLES_OUTPUTS];
    double found[TABLES_OUTPUTS + TABLES_LOCAL_MODELS];
    Tables own;
    const Tables *network = model_network(model, &own);
    int still = 1, term = 0;
    for (int k = 0; k < LLMN_PARAMETERS; ++k) {
        still = still && along[k] == 0.0;
    }
    if (still) {
        return 0;
    }
    theta_rest_tangent(network, inputs[tables.scheduling], head[CHAIN_K_E], along[0], d_rest);
    if (chain_start_tangent(network, &theta_tables, head, model->parameters + 1, d_head, along + 1, d_rest,
                            model->state, inputs, work, work + TABLES_STATE_SIZE, found)) {
        return 1;
    }
    for (int i = 0; i < TABLES_OUTPUTS; ++i) {
        change[TABLES_INPUTS + i] += found[i];
    }
    for (int i = 0; i < TABLES_LOCAL_MODELS; ++i) {
        change[TABLES_INPUTS + TABLES_OUTPUTS + TABLES_DERIVED + i] += found[TABLES_OUTPUTS + i];
    }
    for (int i = 0; i < TABLES_DERIVED; ++i) {
        for (; term < tables.term_ends[i]; ++term) {
            const int signal = tables.term_signals[term], is_output = signal < TABLES_OUTPUTS;
            const double value = is_output ? values[TABLES_INPUTS + signal] : inputs[signal - TABLES_OUTPUTS];
            const double slope = !theta_stiffness_terms[term] ? 0.0 : tables.term_coefficients[term] < 0.0 ? -1.0 : 1.0;
            change[TABLES_INPUTS + TABLES_OUTPUTS + i] +=
                slope * along[0] * value + (is_output ? network->term_coefficients[term] * found[signal] : 0.0);
        }
    }
    return 0;
}
