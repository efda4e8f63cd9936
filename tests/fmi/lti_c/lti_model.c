/* Two-state linear model on a grid of 1 ms (explicit Euler): x' = A x + B u, asymmetric on purpose.
   It refuses to start for a drive above 5 and to go on for a drive above 8. */

#define SAMPLE_TIME 0.001

typedef struct {
    double state[2];
    double strength;
    double scale;
    double shift;
} Model;

static const double lti_A[2][2] = {{-2.0, 30.0}, {-41.0, -3.0}};
static const double lti_B[2][2] = {{1.5, 0.2}, {0.3, -7.0}};

static int model_set_parameters(Model *model, const double *values, Message *message)
{
    (void)message;
    model->strength = values[VARIABLE_preset] == 2.0 ? 3.0 : 1.0;
    model->scale = values[VARIABLE_scale];
    model->shift = values[VARIABLE_shift];
    return 0;
}

/** the shift is tunable, but not above 0.75 */
static int model_retune(Model *model, const double *values, Message *message)
{
    if (values[VARIABLE_shift] > 0.75) {
        message_append(message, "too large a shift");
        return 1;
    }
    model->shift = values[VARIABLE_shift];
    return 0;
}

/** x_1 beyond 40 is alarming */
static unsigned model_alarms(const Model *model)
{
    return model->state[0] > 40.0 ? 1 : 0;
}

static void model_tell(const Model *model, unsigned alarm, Message *message)
{
    (void)model;
    (void)alarm;
    message_append(message, "x_1 has gone beyond 40 (reported once)");
}

enum { MODEL_WATCHES_INPUTS = 0 };

static const char *model_remark(const double *values)
{
    return values[VARIABLE_shift] != 0.0 ? "the model is shifted" : 0;
}

static double model_sample_time(const Model *model)
{
    (void)model;
    return SAMPLE_TIME;
}

static double lti_forcing(const Model *model, const double *inputs, int row)
{
    return model->strength * (lti_B[row][0] * inputs[0] + lti_B[row][1] * inputs[1]);
}

static double lti_derivative(const Model *model, const double *inputs, int row)
{
    return lti_A[row][0] * model->state[0] + lti_A[row][1] * model->state[1] + lti_forcing(model, inputs, row);
}

/** steady[] = A^-1 (first, second) */
static void lti_settle(double first, double second, double *steady)
{
    const double determinant = lti_A[0][0] * lti_A[1][1] - lti_A[0][1] * lti_A[1][0];
    steady[0] = (lti_A[1][1] * first - lti_A[0][1] * second) / determinant;
    steady[1] = (lti_A[0][0] * second - lti_A[1][0] * first) / determinant;
}

static int model_initialise(Model *model, double time, const double *inputs, Message *message)
{
    (void)time;
    if (inputs[VARIABLE_drive] > 5.0) {
        message_append(message, "no steady state for drive = ");
        message_append_number(message, inputs[VARIABLE_drive]);
        return 1;
    }
    lti_settle(-lti_forcing(model, inputs, 0), -lti_forcing(model, inputs, 1), model->state);
    return 0;
}

static void model_step_begins(Model *model)
{
    (void)model;
}

static int model_tick(Model *model, double time, const double *inputs, Message *message)
{
    const double first = model->state[0] + SAMPLE_TIME * lti_derivative(model, inputs, 0);
    const double second = model->state[1] + SAMPLE_TIME * lti_derivative(model, inputs, 1);
    (void)time;
    if (inputs[VARIABLE_drive] > 8.0) {
        message_append(message, "drive hits the stop at ");
        message_append_number(message, inputs[VARIABLE_drive]);
        return 1;
    }
    model->state[0] = first;
    model->state[1] = second;
    return 0;
}

static void model_outputs(const Model *model, double *values)
{
    values[VARIABLE_x_1] = model->state[0];
    values[VARIABLE_x_2] = model->state[1];
    values[VARIABLE_der_x_1] = lti_derivative(model, values, 0);
    values[VARIABLE_der_x_2] = lti_derivative(model, values, 1);
    values[VARIABLE_scaled] = model->scale * model->state[1] + model->shift;
    values[VARIABLE_mixed] = 4.0 * model->state[0] - 5.0 * model->state[1] + 0.5 * values[VARIABLE_load];
    values[VARIABLE_in_range] = values[VARIABLE_drive] >= -2.0 && values[VARIABLE_drive] <= 3.0 ? 1.0 : 0.0;
    values[VARIABLE_reciprocal] = 1.0 / values[VARIABLE_load];
}

static void model_set_states(Model *model, const double *states)
{
    model->state[0] = states[0];
    model->state[1] = states[1];
}

/** the first state may not go beyond 50 */
static int model_check_states(const Model *model, const double *inputs, Message *message)
{
    (void)inputs;
    if (model->state[0] > 50.0) {
        message_append(message, "x_1 is too large: ");
        message_append_number(message, model->state[0]);
        return 1;
    }
    return 0;
}

/** where the first state passes 2 + shift, and the second the drive */
static void model_event_indicators(const Model *model, const double *values, double *indicators)
{
    indicators[0] = model->state[0] - (2.0 + model->shift);
    indicators[1] = values[VARIABLE_drive] - model->state[1];
}

static void model_directional_derivative(const Model *model, const double *values, const double *direction,
                                         double *change)
{
    const double dx[2] = {direction[VARIABLE_x_1], direction[VARIABLE_x_2]};
    const double du[2] = {direction[VARIABLE_drive], direction[VARIABLE_load]};
    for (int row = 0; row < 2; ++row) {
        change[row == 0 ? VARIABLE_der_x_1 : VARIABLE_der_x_2] =
            lti_A[row][0] * dx[0] + lti_A[row][1] * dx[1] +
            model->strength * (lti_B[row][0] * du[0] + lti_B[row][1] * du[1]);
    }
    change[VARIABLE_x_1] = dx[0];
    change[VARIABLE_x_2] = dx[1];
    change[VARIABLE_scaled] = model->scale * dx[1];
    change[VARIABLE_mixed] = 4.0 * dx[0] - 5.0 * dx[1] + 0.5 * du[1];
    change[VARIABLE_reciprocal] = -du[1] / (values[VARIABLE_load] * values[VARIABLE_load]);
}

enum { MODEL_WORK = 1 };

/** refused for drives above 4, to have a case that is */
static int model_start_derivative(const Model *model, const double *values, const double *direction, double *change,
                                  double *work, Message *message)
{
    const double du[2] = {direction[VARIABLE_drive], direction[VARIABLE_load]};
    double dx[2];
    (void)work;
    if (values[VARIABLE_drive] > 4.0) {
        message_append(message, "no derivative at this drive");
        return 1;
    }
    lti_settle(-lti_forcing(model, du, 0), -lti_forcing(model, du, 1), dx);
    change[VARIABLE_x_1] = dx[0];
    change[VARIABLE_x_2] = dx[1];
    change[VARIABLE_scaled] = model->scale * dx[1] + direction[VARIABLE_scale] * model->state[1] + direction[VARIABLE_shift];
    change[VARIABLE_mixed] = 4.0 * dx[0] - 5.0 * dx[1] + 0.5 * du[1];
    change[VARIABLE_reciprocal] = -du[1] / (values[VARIABLE_load] * values[VARIABLE_load]);
    return 0;
}
