/* Directional derivatives. */

static int is_continuous_state(fmi2ValueReference vr)
{
    for (int k = 0; k < CONTINUOUS_STATES; ++k) {
        if (continuous_state[k].state == vr) {
            return 1;
        }
    }
    return 0;
}

/** whether vr[0..count) are variables that a derivative can be taken of (is_known: along); else a message was logged */
static int instance_can_differentiate(const Instance *instance, const fmi2ValueReference vr[], size_t count,
                                      int is_known, Message *message)
{
    for (size_t k = 0; k < count; ++k) {
        const int causality = variable_causality[vr[k]];
        const int calculated = causality == CAUSALITY_OUTPUT || causality == CAUSALITY_LOCAL;
        if (is_known ? causality != CAUSALITY_INPUT && !is_continuous_state(vr[k]) : !calculated) {
            message_append(message, is_known ? "no derivative with respect to " : "no derivative of ");
            message_append(message, variable_name[vr[k]]);
            message_append(message, is_known ? ", which is neither an input nor a continuous state"
                                             : ", which is not calculated");
            (void)instance_error(instance, message, "");
            return 0;
        }
    }
    return 1;
}

FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                                    size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                                    size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    double direction[VARIABLE_COUNT], change[VARIABLE_COUNT];
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
    for (unsigned k = 0; k < VARIABLE_COUNT; ++k) {
        direction[k] = 0.0;
        change[k] = 0.0;
    }
    for (size_t k = 0; k < nKnown; ++k) {
        direction[vKnown_ref[k]] += dvKnown[k];
    }
    model_directional_derivative(&instance->slave.model, instance->slave.values, direction, change);
    for (size_t k = 0; k < nUnknown; ++k) {
        if (!is_finite(change[vUnknown_ref[k]])) {
            message_append(&message, variable_name[vUnknown_ref[k]]);
            return instance_refuse(instance, &message, ": the derivative is not a finite number");
        }
    }
    for (size_t k = 0; k < nUnknown; ++k) {
        dvUnknown[k] = change[vUnknown_ref[k]];
    }
    return fmi2OK;
}
