/* A network without parameters. */

static int model_retune(Model *model, const double *values, Message *message)
{
    return model_set_parameters(model, values, message);
}

static const char *model_remark(const double *values)
{
    (void)values;
    return 0;
}

/** the value reference of a parameter along which there is no derivative, 0 without one */
static int model_rigid_parameter(const double *direction)
{
    (void)direction;
    return 0;
}
