/* Directional derivatives: of the running model along inputs and continuous states; in initialisation mode, where all
   that is calculated is a steady state, along inputs and Real parameters. */

static int is_continuous_state(fmi2ValueReference vr)
{
    for (int k = 0; k < CONTINUOUS_STATES; ++k) {
        if (continuous_state[k].state == vr) {
            return 1;
        }
    }
    return 0;
}

/** NULL when a derivative can be taken of this variable, else why not */
static const char *trouble_with_unknown(fmi2ValueReference vr)
{
    const int causality = variable_causality[vr];
    return causality == CAUSALITY_OUTPUT || causality == CAUSALITY_LOCAL ? NULL : ", which is not calculated";
}

/** NULL when a derivative can be taken along this variable now, else why not */
static const char *trouble_with_known(const Instance *instance, fmi2ValueReference vr)
{
    if (variable_causality[vr] == CAUSALITY_INPUT) {
        return NULL;
    }
    if (instance->slave.mode == MODE_INITIALISATION) {
        return variable_causality[vr] == CAUSALITY_PARAMETER ? NULL : ", which is neither an input nor a parameter";
    }
    return is_continuous_state(vr) ? NULL : ", which is neither an input nor a continuous state";
}

/** whether vr[0..count) are variables that a derivative can be taken of (is_known: along); else a message was logged */
static int instance_can_differentiate(const Instance *instance, const fmi2ValueReference vr[], size_t count,
                                      int is_known, Message *message)
{
    for (size_t k = 0; k < count; ++k) {
        const char *trouble = is_known ? trouble_with_known(instance, vr[k]) : trouble_with_unknown(vr[k]);
        if (trouble != NULL) {
            message_append(message, is_known ? "no derivative with respect to " : "no derivative of ");
            message_append(message, variable_name(vr[k]));
            (void)instance_error(instance, message, trouble);
            return 0;
        }
    }
    return 1;
}

FMI2_Export COLD fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                                    size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                                    size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    double *direction, *change;
    Message message;
    Instance *instance = instance_of(c, LEGAL_GetDirectionalDerivative, "fmi2GetDirectionalDerivative", &message);
    if (instance == NULL || !instance_knows(instance, vUnknown_ref, nUnknown, dvUnknown, TYPE_REAL, &message) ||
        !instance_knows(instance, vKnown_ref, nKnown, dvKnown, TYPE_REAL, &message) ||
        !instance_can_differentiate(instance, vUnknown_ref, nUnknown, 0, &message) ||
        !instance_can_differentiate(instance, vKnown_ref, nKnown, 1, &message)) {
        return fmi2Error;
    }
    if (slave_prepare_outputs(&instance->slave, &message) != 0) {
        return instance_refuse(instance, &message, "");
    }
    direction = instance->direction;
    change = instance->change;
    for (unsigned k = 0; k < VARIABLE_COUNT; ++k) {
        direction[k] = 0.0;
        change[k] = 0.0;
    }
    for (size_t k = 0; k < nKnown; ++k) {
        direction[vKnown_ref[k]] += dvKnown[k];
    }
    if (instance->slave.mode != MODE_INITIALISATION) {
        model_directional_derivative(&instance->slave.model, instance->slave.values, direction, change);
    } else if (model_start_derivative(&instance->slave.model, instance->slave.values, direction, change, instance->work,
                                      &message)) {
        return instance_error(instance, &message, "");
    }
    for (size_t k = 0; k < nUnknown; ++k) {
        if (!is_finite(change[vUnknown_ref[k]])) {
            message_append(&message, variable_name(vUnknown_ref[k]));
            return instance_refuse(instance, &message, ": the derivative is not a finite number");
        }
    }
    for (size_t k = 0; k < nUnknown; ++k) {
        dvUnknown[k] = change[vUnknown_ref[k]];
    }
    return fmi2OK;
}
