/* The functions of FMI 2.0 for Model Exchange. */

/** whether an array of what the model has `wanted` of is there and has the right length */
static int instance_has_room(const Instance *instance, const fmi2Real x[], size_t count, size_t wanted,
                             const char *what, Message *message)
{
    if (count != wanted) {
        message_append(message, "there are ");
        message_append_integer(message, (long long)wanted);
        message_append(message, what);
        message_append(message, ", not ");
        message_append_integer(message, (long long)count);
    } else if (count > 0 && x == NULL) {
        message_append(message, "an array is missing (NULL)");
    } else {
        return 1;
    }
    (void)instance_error(instance, message, "");
    return 0;
}

/** whether an array of continuous states is there and has the right length */
static int instance_has_states(const Instance *instance, const fmi2Real x[], size_t count, Message *message)
{
    return instance_has_room(instance, x, count, CONTINUOUS_STATES, " continuous states", message);
}

/* Modes */

FMI2_Export COLD fmi2Status fmi2EnterEventMode(fmi2Component c)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_EnterEventMode, "fmi2EnterEventMode", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (slave_check_stop(&instance->slave, &message) != 0) {
        return instance_error(instance, &message, "");
    }
    instance->slave.mode = MODE_EVENT;
    instance->slave.event_time = instance->slave.time;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo)
{
    Message message;
    int64_t missed;
    Instance *instance = instance_of(c, LEGAL_NewDiscreteStates, "fmi2NewDiscreteStates", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (eventInfo == NULL) {
        return instance_error(instance, &message, "no place for the answer (NULL)");
    }
    if (slave_update(&instance->slave, &missed, &message) != 0) {
        return instance_error(instance, &message, "");
    }
    instance_ticked(instance);
    eventInfo->newDiscreteStatesNeeded = fmi2False;
    eventInfo->terminateSimulation = fmi2False;
    eventInfo->nominalsOfContinuousStatesChanged = fmi2False;
    eventInfo->valuesOfContinuousStatesChanged = fmi2False;
    eventInfo->nextEventTimeDefined = IS_SAMPLED ? fmi2True : fmi2False;
    eventInfo->nextEventTime = IS_SAMPLED ? slave_next_event_time(&instance->slave) : 0.0;
    if (missed == 0 || instance->warned_of_events) {
        return fmi2OK;
    }
    instance->warned_of_events = 1;
    message_append_integer(&message, missed);
    message_append(&message, " time events were left out; their ticks were done now (reported once)");
    return instance_warn(instance, &message);
}

FMI2_Export COLD fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_EnterContinuousTimeMode, "fmi2EnterContinuousTimeMode", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (slave_event_is_due(&instance->slave)) {
        return instance_error(instance, &message, "a tick is due: call fmi2NewDiscreteStates first");
    }
    slave_continue(&instance->slave);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                                   fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    Message message;
    const Instance *instance =
        instance_of(c, LEGAL_CompletedIntegratorStep, "fmi2CompletedIntegratorStep", &message);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (enterEventMode == NULL || terminateSimulation == NULL) {
        return instance_error(instance, &message, "no place for the answers (NULL)");
    }
    if (slave_check_stop(&instance->slave, &message) != 0) {
        return instance_error(instance, &message, "");
    }
    *enterEventMode = slave_event_is_due(&instance->slave) ? fmi2True : fmi2False;
    *terminateSimulation = fmi2False;
    return fmi2OK;
}

/* Time and continuous states */

FMI2_Export fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_SetTime, "fmi2SetTime", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (slave_check_time(&instance->slave, time, &message) != 0) {
        return instance_error(instance, &message, "");
    }
    instance->slave.time = time; /* no variable depends on it */
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_SetContinuousStates, "fmi2SetContinuousStates", &message);
    if (instance == NULL || !instance_has_states(instance, x, nx, &message)) {
        return fmi2Error;
    }
    for (size_t k = 0; k < nx; ++k) {
        if (!is_finite(x[k])) {
            message_append(&message, variable_name(continuous_state[k].state));
            return instance_error(instance, &message, " must be a finite number");
        }
    }
    slave_set_states(&instance->slave, x);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t nx)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_GetContinuousStates, "fmi2GetContinuousStates", &message);
    if (instance == NULL || !instance_has_states(instance, x, nx, &message)) {
        return fmi2Error;
    }
    if (instance->slave.mode == MODE_INITIALISATION && slave_prepare_outputs(&instance->slave, &message) != 0) {
        return instance_error(instance, &message, "");
    }
    for (size_t k = 0; k < nx; ++k) {
        x[k] = instance->slave.values[continuous_state[k].state];
    }
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t nx)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_GetDerivatives, "fmi2GetDerivatives", &message);
    if (instance == NULL || !instance_has_states(instance, derivatives, nx, &message)) {
        return fmi2Error;
    }
    for (size_t k = 0; k < nx; ++k) {
        const fmi2Status status = instance_prepare(instance, &continuous_state[k].derivative, 1, &message);
        if (status != fmi2OK) {
            return status;
        }
    }
    for (size_t k = 0; k < nx; ++k) {
        derivatives[k] = instance->slave.values[continuous_state[k].derivative];
    }
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x_nominal[], size_t nx)
{
    Message message;
    const Instance *instance =
        instance_of(c, LEGAL_GetNominalsOfContinuousStates, "fmi2GetNominalsOfContinuousStates", &message);
    if (instance == NULL || !instance_has_states(instance, x_nominal, nx, &message)) {
        return fmi2Error;
    }
    for (size_t k = 0; k < nx; ++k) {
        x_nominal[k] = continuous_state[k].nominal;
    }
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real eventIndicators[], size_t ni)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_GetEventIndicators, "fmi2GetEventIndicators", &message);
    if (instance == NULL ||
        !instance_has_room(instance, eventIndicators, ni, EVENT_INDICATORS, " event indicators", &message)) {
        return fmi2Error;
    }
    if (slave_event_indicators(&instance->slave, eventIndicators, &message) != 0) {
        return instance_error(instance, &message, "");
    }
    return fmi2OK;
}
