/* A network without parameters: its tables are constants. */

typedef struct {
    double state[TABLES_STATE_SIZE];
} Model;

/** the tables the model computes with; *own is room for them if they are not the constants */
static inline const Tables *model_network(const Model *model, Tables *own)
{
    (void)model;
    (void)own;
    return &tables;
}

static int model_set_parameters(Model *model, const double *values, Message *message)
{
    (void)model;
    (void)values;
    (void)message;
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

/** the value reference of a parameter along which there is no derivative, 0 without one */
static int model_rigid_parameter(const double *direction)
{
    (void)direction;
    return 0;
}
