/* A network without parameters that can change while it runs. */

static int model_retune(Model *model, const double *values, Message *message)
{
    return model_set_parameters(model, values, message);
}

/** whether the model computes with other numbers than those that were identified */
static int model_is_changed(const Model *model)
{
    (void)model;
    return 0;
}

static const char *model_remark(const double *values)
{
    (void)values;
    return 0;
}

/** change[] of what rests, along parameters; work[2 TABLES_STATE_SIZE] */
static int model_add_parameter_tangent(const Model *model, const double *inputs, const double *values,
                                       const double *direction, double *change, double *work)
{
    (void)model;
    (void)inputs;
    (void)values;
    (void)direction;
    (void)change;
    (void)work;
    return 0;
}
