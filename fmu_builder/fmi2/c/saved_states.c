/* Saving and restoring instances. An FMU state is a copy of the Slave in memory of its own. */

FMI2_Export COLD fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    Message message;
    const Instance *instance = instance_of(c, LEGAL_State, "fmi2GetFMUstate", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (FMUstate == NULL) {
        return instance_error(instance, &message, "no place for the state (NULL)");
    }
    if (*FMUstate == NULL) {
        *FMUstate = calloc(1, sizeof(Slave));
    }
    if (*FMUstate == NULL) {
        return instance_error(instance, &message, "out of memory");
    }
    *(Slave *)*FMUstate = instance->slave;
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    Message message;
    Instance *instance = instance_of(c, LEGAL_State, "fmi2SetFMUstate", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (FMUstate == NULL) {
        return instance_error(instance, &message, "no state (NULL)");
    }
    if (((const Slave *)FMUstate)->purpose != instance->slave.purpose) {
        message_append(&message, "the state comes from an instance for ");
        return instance_error(instance, &message, purpose_name(((const Slave *)FMUstate)->purpose));
    }
    instance->slave = *(const Slave *)FMUstate;
    instance->last_step = fmi2OK;
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    Message message;
    if (instance_of(c, LEGAL_State, "fmi2FreeFMUstate", &message) == NULL) {
        return fmi2Error;
    }
    if (FMUstate != NULL) {
        free(*FMUstate);
        *FMUstate = NULL;
    }
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    Message message;
    const Instance *instance = instance_of(c, LEGAL_State, "fmi2SerializedFMUstateSize", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (FMUstate == NULL || size == NULL) {
        return instance_error(instance, &message, "no state or no place for its size (NULL)");
    }
    *size = SNAPSHOT_SIZE;
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                             size_t size)
{
    Message message;
    const Instance *instance = instance_of(c, LEGAL_State, "fmi2SerializeFMUstate", &message);
    if (instance == NULL) {
        return fmi2Error;
    }
    if (FMUstate == NULL || serializedState == NULL) {
        return instance_error(instance, &message, "no state or no place for its bytes (NULL)");
    }
    if (size < SNAPSHOT_SIZE) {
        return instance_error(instance, &message, "the place for the bytes is too small");
    }
    snapshot_write((const Slave *)FMUstate, (unsigned char *)serializedState);
    return fmi2OK;
}

FMI2_Export COLD fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                               fmi2FMUstate *FMUstate)
{
    Message message;
    const Instance *instance = instance_of(c, LEGAL_State, "fmi2DeSerializeFMUstate", &message);
    const unsigned char *bytes = (const unsigned char *)serializedState;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (bytes == NULL || FMUstate == NULL) {
        return instance_error(instance, &message, "no bytes or no place for the state (NULL)");
    }
    const char *trouble = snapshot_check(bytes, size);
    if (trouble != NULL) {
        return instance_error(instance, &message, trouble);
    }
    if (*FMUstate == NULL) {
        *FMUstate = calloc(1, sizeof(Slave));
    }
    if (*FMUstate == NULL) {
        return instance_error(instance, &message, "out of memory");
    }
    snapshot_read((Slave *)*FMUstate, bytes);
    return fmi2OK;
}
