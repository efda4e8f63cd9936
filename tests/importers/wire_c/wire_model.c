/* A contact wire that goes up and down between two heights: a source of eta for co-simulations. */

#define SAMPLE_TIME 0.001

typedef struct {
    double ticks;
    double lower;
    double rise;   /* m per tick */
    double period; /* ticks up, and ticks down */
} Model;

static int model_set_parameters(Model *model, const double *values, Message *message)
{
    (void)message;
    model->lower = values[VARIABLE_lower];
    model->rise = values[VARIABLE_slope] * SAMPLE_TIME;
    model->period = 25.0;
    return 0;
}

static int model_retune(Model *model, const double *values, Message *message)
{
    return model_set_parameters(model, values, message);
}

static const char *model_remark(const double *values)
{
    (void)values;
    return 0;
}

enum { MODEL_WATCHES_INPUTS = 0 };

static unsigned model_alarms(const Model *model)
{
    (void)model;
    return 0;
}

static void model_tell(const Model *model, unsigned alarm, Message *message)
{
    (void)model;
    (void)alarm;
    (void)message;
}

static void model_event_indicators(const Model *model, const double *values, double *indicators)
{
    (void)model;
    (void)values;
    (void)indicators;
}

static double model_sample_time(const Model *model)
{
    (void)model;
    return SAMPLE_TIME;
}

static int model_initialise(Model *model, double time, const double *inputs, Message *message)
{
    (void)time;
    (void)inputs;
    (void)message;
    model->ticks = 0.0;
    return 0;
}

static void model_step_begins(Model *model)
{
    (void)model;
}

static int model_tick(Model *model, double time, const double *inputs, Message *message)
{
    (void)time;
    (void)inputs;
    (void)message;
    model->ticks = model->ticks + 1.0 < 2.0 * model->period ? model->ticks + 1.0 : 0.0;
    return 0;
}

static void model_outputs(const Model *model, double *values)
{
    const double up = model->ticks < model->period ? model->ticks : 2.0 * model->period - model->ticks;
    values[VARIABLE_height] = model->lower + model->rise * up;
}

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

static void model_directional_derivative(const Model *model, const double *values, const double *direction,
                                         double *change)
{
    (void)model;
    (void)values;
    (void)direction;
    (void)change;
}

enum { MODEL_WORK = 1 };

static int model_start_derivative(const Model *model, const double *values, const double *direction, double *change,
                                  double *work, Message *message)
{
    (void)work;
    (void)model;
    (void)values;
    (void)message;
    change[VARIABLE_height] = direction[VARIABLE_lower];
    return 0;
}
