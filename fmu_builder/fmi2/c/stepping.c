/* The functions of FMI 2.0 for Co-Simulation: input derivatives, communication steps and their status. */

FMI2_Export SMALL fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                   const fmi2Integer order[], const fmi2Real value[])
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_SetRealInputDerivatives, "fmi2SetRealInputDerivatives", &message);
    if (instance == NULL || !instance_knows(instance, vr, nvr, value, TYPE_REAL, &message)) {
        return fmi2Error;
    }
    if (nvr > 0 && order == NULL) {
        return instance_error(instance, &message, "an array is missing (NULL)");
    }
    for (size_t k = 0; k < nvr; ++k) {
        const char *trouble = variable_causality[vr[k]] != CAUSALITY_INPUT ? " is not an input"
                              : order[k] != 1                              ? ": only the first derivative can be used"
                              : !is_finite(value[k])                       ? ": the derivative must be a finite number"
                                                                           : NULL;
        if (trouble != NULL) {
            message_append(&message, variable_name(vr[k]));
            return instance_error(instance, &message, trouble);
        }
    }
    for (size_t k = 0; k < nvr; ++k) {
        instance->slave.input_derivative[vr[k]] = value[k];
    }
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                    const fmi2Integer order[], fmi2Real value[])
{
    Message message;
    const Instance *instance =
        instance_of(c, LEGAL_GetRealOutputDerivatives, "fmi2GetRealOutputDerivatives", &message);
    (void)vr;
    (void)order;
    (void)value;
    if (instance == NULL) {
        return fmi2Error;
    }
    return nvr == 0 ? fmi2OK : instance_error(instance, &message, "output derivatives are not provided");
}

FMI2_Export fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                                  fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_DoStep, "fmi2DoStep", &message);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (instance == NULL) {
        return fmi2Error;
    }
    instance->last_step = fmi2OK;
    if (slave_check_step(&instance->slave, currentCommunicationPoint, communicationStepSize, &message) != 0 ||
        slave_step(&instance->slave, currentCommunicationPoint, communicationStepSize, &message) != 0) {
        instance->last_step = instance_error(instance, &message, "");
    } else {
        instance_ticked(instance);
    }
    return instance->last_step;
}

FMI2_Export COLD fmi2Status fmi2CancelStep(fmi2Component c)
{
    Message message;
    (void)instance_of(c, LEGAL_CancelStep, "fmi2CancelStep", &message);
    return fmi2Error;
}

/* Steps are never pending, so most of the status is settled. */

/** the instance if its status can be asked for now, else NULL after an error message */
static const Instance *instance_to_ask(fmi2Component c, const void *value, const char *function)
{
    Message message;
    const Instance *instance = instance_of(c, LEGAL_GetStatus, function, &message);
    if (instance != NULL && value == NULL) {
        (void)instance_error(instance, &message, "no place for the answer (NULL)");
        return NULL;
    }
    return instance;
}

FMI2_Export COLD fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    const Instance *instance = instance_to_ask(c, value, "fmi2GetStatus");
    if (instance == NULL) {
        return fmi2Error;
    }
    if (s != fmi2DoStepStatus) {
        return fmi2Discard;
    }
    *value = instance->last_step;
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    const Instance *instance = instance_to_ask(c, value, "fmi2GetRealStatus");
    if (instance == NULL) {
        return fmi2Error;
    }
    if (s != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = instance->slave.time;
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    (void)s;
    return instance_to_ask(c, value, "fmi2GetIntegerStatus") != NULL ? fmi2Discard : fmi2Error;
}

FMI2_Export COLD fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    const Instance *instance = instance_to_ask(c, value, "fmi2GetBooleanStatus");
    if (instance == NULL) {
        return fmi2Error;
    }
    if (s != fmi2Terminated) {
        return fmi2Discard;
    }
    *value = fmi2False; /* the model never asks for the end of the simulation */
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    if (instance_to_ask(c, value, "fmi2GetStringStatus") == NULL) {
        return fmi2Error;
    }
    if (s != fmi2PendingStatus) {
        return fmi2Discard;
    }
    *value = "";
    return fmi2OK;
}
