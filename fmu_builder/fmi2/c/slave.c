/* The slave: time, inputs and the life of one instance, without a word of FMI. The model runs on a grid of ticks,
   t_n = start_time + n T_s, and n is an integer counter: time is never added up here. */
#include <stddef.h>
#include <stdint.h>

#include "model.h"

enum { INPUT_SLOTS = INPUT_COUNT > 0 ? INPUT_COUNT : 1 };

/** the life of an instance; one bit each, because functions are legal in sets of them */
enum {
    MODE_INSTANTIATED = 1,
    MODE_INITIALISATION = 2,
    MODE_STEP = 4,
    MODE_TERMINATED = 8,
    MODE_FAILED = 16,
    MODE_EVENT = 32,
    MODE_CONTINUOUS = 64,
    MODE_ANY = 127
};

/** what an instance is for; it never changes */
enum { FOR_CO_SIMULATION = 0, FOR_MODEL_EXCHANGE = 1 };

/* Part of a tick within which a communication point counts as lying on the grid: a master that adds up steps of 1 ms
   is off by 3e-4 of a tick after an hour. */
#define TICK_TOLERANCE 0.01
/* Part of a tick by which a communication point may differ from where the last step ended. */
#define TIME_TOLERANCE 0.5
/* Beyond 2^53 a tick counter is not exact as a double. */
#define LARGEST_TICK 9007199254740992.0
#define LARGEST_NUMBER 1.7976931348623157e308

/** all that an instance remembers: flat, members of 8 bytes only (see model.h), so that a copy is a saved state */
typedef struct {
    int64_t purpose;        /* FOR_... */
    int64_t mode;
    int64_t tick;           /* n: ticks done */
    int64_t model_ready;    /* the model is in the steady state of the present start values */
    int64_t outputs_ready;  /* values[] holds the outputs of the present state and inputs */
    double start_time;      /* s */
    double stop_time;       /* s */
    double time;            /* s, end of the last communication step, or what the importer has set last */
    double event_time;      /* s, model exchange: the last event */
    double sample_time;     /* T_s, s */
    double values[VARIABLE_COUNT];
    double latched[INPUT_SLOTS];           /* inputs of the tick from t_n */
    double input_derivative[INPUT_SLOTS];  /* 1/s, for the next communication step */
    double event_input[INPUT_SLOTS];       /* model exchange: inputs when the last event was left */
    Model model;
} Slave;

#include "snapshot.c"

static int is_finite(double value)
{
    return value - value == 0.0;
}

/** memory[0..size) = 0; a constant of this size would lie in the binary */
static void clear_bytes(void *memory, size_t size)
{
    unsigned char *bytes = (unsigned char *)memory;
    for (size_t k = 0; k < size; ++k) {
        bytes[k] = 0;
    }
}

/** as after instantiation: start values, time 0 */
static COLD void slave_reset(Slave *slave)
{
    const int64_t purpose = slave->purpose;
    clear_bytes(slave, sizeof *slave);
    slave->purpose = purpose;
    slave->mode = MODE_INSTANTIATED;
    slave->stop_time = LARGEST_NUMBER;
    for (unsigned k = 0; k < VARIABLE_COUNT; ++k) {
        slave->values[k] = variable_start[k];
    }
}

/** the values[] have changed from outside */
static void slave_values_changed(Slave *slave)
{
    slave->outputs_ready = 0;
    if (slave->mode == MODE_INITIALISATION || slave->mode == MODE_INSTANTIATED) {
        slave->model_ready = 0;
    }
}

/** let the running model take its changed tunable parameters; when it refuses, values[] are to be put back */
static int slave_retune(Slave *slave, Message *message)
{
    slave->outputs_ready = 0;
    return model_retune(&slave->model, slave->values, message);
}

/** bring the model into the steady state of the start values, if it is not */
static int slave_prepare_model(Slave *slave, Message *message)
{
    if (slave->model_ready) {
        return 0;
    }
    if (model_set_parameters(&slave->model, slave->values, message) != 0) {
        return 1;
    }
    slave->sample_time = model_sample_time(&slave->model);
    if (!(slave->sample_time > 0.0) || !is_finite(slave->sample_time)) {
        message_append(message, "the sample time is not a positive number");
        return 1;
    }
    if (model_initialise(&slave->model, slave->start_time, slave->values, message) != 0) {
        return 1;
    }
    slave->model_ready = 1;
    return 0;
}

/** whether the model can be evaluated where the importer's integration has put it; a tick checks what it does itself */
static int slave_check_states(const Slave *slave, Message *message)
{
    const int integrated = slave->purpose == FOR_MODEL_EXCHANGE && CONTINUOUS_STATES > 0;
    return integrated && model_check_states(&slave->model, slave->values, message) != 0;
}

/** bring the outputs in values[] up to date, if they are not */
static int slave_prepare_outputs(Slave *slave, Message *message)
{
    if (slave->outputs_ready) {
        return 0;
    }
    if (slave_prepare_model(slave, message) != 0 || slave_check_states(slave, message) != 0) {
        return 1;
    }
    model_outputs(&slave->model, slave->values);
    slave->outputs_ready = 1;
    return 0;
}

/** latched = inputs + derivatives * ahead */
static void slave_latch(Slave *slave, double ahead)
{
    for (unsigned k = 0; k < INPUT_COUNT; ++k) {
        slave->latched[k] = slave->values[k];
        if (slave->input_derivative[k] != 0.0) {
            slave->latched[k] += slave->input_derivative[k] * ahead;
        }
    }
}

/** ticks from the start time to `time`, not a whole number */
static double slave_position(const Slave *slave, double time)
{
    return (time - slave->start_time) / slave->sample_time;
}

/** whether a communication step or an event at this position completes the tick t_n -> t_n+1 */
static int slave_tick_is_due(const Slave *slave, double position)
{
    return position >= (double)(slave->tick + 1) - TICK_TOLERANCE;
}

/** leave initialisation: the first tick is n = 0 at the start time */
static int slave_start(Slave *slave, Message *message)
{
    if (slave_prepare_outputs(slave, message) != 0) {
        return 1;
    }
    slave->mode = slave->purpose == FOR_MODEL_EXCHANGE ? MODE_EVENT : MODE_STEP;
    slave->tick = 0;
    slave->time = slave->start_time;
    slave->event_time = slave->start_time;
    slave_latch(slave, 0.0);
    return 0;
}

/** whether the input derivatives lead to finite inputs for every tick of a step; the last one may lie a tick behind it */
static int slave_check_advance(const Slave *slave, double step, Message *message)
{
    for (unsigned k = 0; k < INPUT_COUNT; ++k) {
        if (!is_finite(slave->values[k] + slave->input_derivative[k] * (step + slave->sample_time))) {
            message_append(message, "the derivative of ");
            message_append(message, variable_name(k));
            message_append(message, " leads out of the range of numbers within the step");
            return 1;
        }
    }
    return 0;
}

/** whether a step from `time` over `step` can be taken */
static int slave_check_step(const Slave *slave, double time, double step, Message *message)
{
    const double slack = TIME_TOLERANCE * slave->sample_time;
    if (!is_finite(time) || !is_finite(step)) {
        message_append(message, "communication point or step size is not a finite number");
    } else if (step <= 0.0) {
        message_append(message, "the communication step size must be positive, not ");
        message_append_number(message, step);
        message_append(message, " s");
    } else if (time < slave->time - slack || time > slave->time + slack) {
        message_append(message, "the communication point is ");
        message_append_number(message, time);
        message_append(message, " s, but the last step ended at ");
        message_append_number(message, slave->time);
        message_append(message, " s");
    } else if (time + step > slave->stop_time + slack) {
        message_append(message, "the step ends at ");
        message_append_number(message, time + step);
        message_append(message, " s, beyond the stop time ");
        message_append_number(message, slave->stop_time);
        message_append(message, " s");
    } else if (slave_position(slave, time + step) > LARGEST_TICK) {
        message_append(message, "the step is too long to count its ticks");
    } else {
        return slave_check_advance(slave, step, message);
    }
    return 1;
}

/** t_n -> t_n+1 with the latched inputs */
static int slave_tick(Slave *slave, Message *message)
{
    const double time = slave->start_time + (double)slave->tick * slave->sample_time;
    slave->outputs_ready = 0;
    if (model_tick(&slave->model, time, slave->latched, message) != 0) {
        slave->mode = MODE_FAILED;
        slave->time = time;
        return 1;
    }
    ++slave->tick;
    return 0;
}

/** time -> time + step. Tick n uses the inputs in force in the last communication step that begins at or before
    t_n (advanced to t_n) and runs as soon as a step reaches t_n+1, both within the tolerance. */
static int slave_step(Slave *slave, double time, double step, Message *message)
{
    const double begin = slave_position(slave, time);
    const double end = slave_position(slave, time + step);
    slave->outputs_ready = 0;
    if (begin <= (double)slave->tick + TICK_TOLERANCE) {
        slave_latch(slave, ((double)slave->tick - begin) * slave->sample_time);
    }
    if (slave_tick_is_due(slave, end)) {
        model_step_begins(&slave->model);
    }
    while (slave_tick_is_due(slave, end)) {
        if (slave_tick(slave, message) != 0) {
            return 1;
        }
        slave_latch(slave, ((double)slave->tick - begin) * slave->sample_time);
    }
    slave->time = time + step;
    for (unsigned k = 0; k < INPUT_COUNT; ++k) {
        slave->input_derivative[k] = 0.0; /* derivatives are given anew for every communication step */
    }
    return 0;
}

#include "slave_events.c"
