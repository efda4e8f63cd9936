/* The slave in model exchange, where time belongs to the importer. A sampled model obeys the same rule as in
   co-simulation, with time events in the place of communication points: what it remembers changes in event mode only. */

enum { IS_SAMPLED = CONTINUOUS_STATES == 0 };

/** the time of the next tick, s */
static double slave_next_event_time(const Slave *slave)
{
    return slave->start_time + (double)(slave->tick + 1) * slave->sample_time;
}

/** whether the importer may put the model at this time; solvers may try times behind the stop time */
static SMALL int slave_check_time(const Slave *slave, double time, Message *message)
{
    const double slack = TIME_TOLERANCE * slave->sample_time;
    if (!is_finite(time)) {
        message_append(message, "the time must be a finite number");
    } else if (time < slave->event_time - slack) {
        message_append(message, "the time ");
        message_append_number(message, time);
        message_append(message, " s lies before the last event at ");
        message_append_number(message, slave->event_time);
        message_append(message, " s");
    } else if (IS_SAMPLED && slave_position(slave, time) > LARGEST_TICK) {
        message_append(message, "the time is too late to count its ticks");
    } else {
        return 0;
    }
    return 1;
}

/** whether the present time counts: a step or an event behind the stop time does not */
static SMALL int slave_check_stop(const Slave *slave, Message *message)
{
    if (slave->time <= slave->stop_time + TIME_TOLERANCE * slave->sample_time) {
        return 0;
    }
    message_append(message, "the time ");
    message_append_number(message, slave->time);
    message_append(message, " s lies beyond the stop time ");
    message_append_number(message, slave->stop_time);
    message_append(message, " s");
    return 1;
}

/** whether a tick of a sampled model waits for an event */
static int slave_event_is_due(const Slave *slave)
{
    return IS_SAMPLED && slave_tick_is_due(slave, slave_position(slave, slave->time));
}

/** new discrete states: the ticks that the present time has reached; those after the first should have had an event of
    their own and begin with the inputs of the last one, their number goes to *missed */
static int slave_update(Slave *slave, int64_t *missed, Message *message)
{
    *missed = 0;
    if (slave_event_is_due(slave)) {
        model_step_begins(&slave->model);
    }
    while (slave_event_is_due(slave)) {
        if (slave_tick(slave, message) != 0) {
            return 1;
        }
        for (int k = 0; k < INPUT_COUNT; ++k) {
            slave->latched[k] = slave->event_input[k];
        }
        *missed += slave_event_is_due(slave);
    }
    return 0;
}

/** states[0..CONTINUOUS_STATES), finite, take the place of those before */
static void slave_set_states(Slave *slave, const double *states)
{
    for (int k = 0; k < CONTINUOUS_STATES; ++k) {
        slave->values[continuous_state[k].state] = states[k];
    }
    if (CONTINUOUS_STATES > 0) {
        model_set_states(&slave->model, states);
        slave->outputs_ready = 0;
    }
}

/** indicators[0..EVENT_INDICATORS) of the present states and inputs */
static int slave_event_indicators(Slave *slave, double *indicators, Message *message)
{
    if (EVENT_INDICATORS == 0) {
        return 0;
    }
    if (slave_prepare_model(slave, message) != 0) {
        return 1;
    }
    model_event_indicators(&slave->model, slave->values, indicators);
    return 0;
}

/** leave event mode: the tick that begins here uses the inputs of now */
static void slave_continue(Slave *slave)
{
    if (IS_SAMPLED && slave_position(slave, slave->time) <= (double)slave->tick + TICK_TOLERANCE) {
        slave_latch(slave, 0.0);
    }
    for (int k = 0; k < INPUT_COUNT; ++k) {
        slave->event_input[k] = slave->values[k];
    }
    slave->event_time = slave->time;
    slave->mode = MODE_CONTINUOUS;
}
