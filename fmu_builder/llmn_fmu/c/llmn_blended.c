/* A network whose models at the nodes are sums of its local models: the binary holds these, rows i of A..y0, and the weights
   w_ki; the nodes are made when the instance starts, sum_i w_ki row_i, and live in the model. NODE_A and so on (tables.h) are
   the numbers per node, 0 where a matrix is not needed or the same at all nodes. */

enum {
    NODE_FIRST_B = TABLES_NODES * NODE_A,
    NODE_FIRST_C = NODE_FIRST_B + TABLES_NODES * NODE_B,
    NODE_FIRST_D = NODE_FIRST_C + TABLES_NODES * NODE_C,
    NODE_FIRST_G = NODE_FIRST_D + TABLES_NODES * NODE_D,
    NODE_FIRST_X0 = NODE_FIRST_G + TABLES_NODES * NODE_G,
    NODE_FIRST_U0 = NODE_FIRST_X0 + TABLES_NODES * NODE_X0,
    NODE_FIRST_Y0 = NODE_FIRST_U0 + TABLES_NODES * NODE_U0,
    NODE_NUMBERS = NODE_FIRST_Y0 + TABLES_NODES * NODE_Y0
};

typedef struct {
    double state[TABLES_STATE_SIZE];
    Options options;
    double made; /* 1.0: the nodes are */
    double nodes[NODE_NUMBERS];
} Model;

/** the tables the model computes with, in *own */
static inline const Tables *model_network(const Model *model, Tables *own)
{
    *own = tables;
    own->A = model->nodes;
    own->B = model->nodes + NODE_FIRST_B;
    own->C = NODE_C > 0 ? model->nodes + NODE_FIRST_C : tables.C;
    own->D = model->nodes + NODE_FIRST_D;
    own->g = model->nodes + NODE_FIRST_G;
    own->x0 = model->nodes + NODE_FIRST_X0;
    own->u0 = model->nodes + NODE_FIRST_U0;
    own->y0 = model->nodes + NODE_FIRST_Y0;
    return own;
}

static COLD int model_set_parameters(Model *model, const double *values, Message *message)
{
    (void)message;
    options_set(&model->options, values);
    if (model->made != 0.0) {
        return 0;
    }
    kernel_nodes(&tables, tables.A, NODE_A, model->nodes);
    kernel_nodes(&tables, tables.B, NODE_B, model->nodes + NODE_FIRST_B);
    kernel_nodes(&tables, tables.C, NODE_C, model->nodes + NODE_FIRST_C);
    kernel_nodes(&tables, tables.D, NODE_D, model->nodes + NODE_FIRST_D);
    kernel_nodes(&tables, tables.g, NODE_G, model->nodes + NODE_FIRST_G);
    kernel_nodes(&tables, tables.x0, NODE_X0, model->nodes + NODE_FIRST_X0);
    kernel_nodes(&tables, tables.u0, NODE_U0, model->nodes + NODE_FIRST_U0);
    kernel_nodes(&tables, tables.y0, NODE_Y0, model->nodes + NODE_FIRST_Y0);
    model->made = 1.0;
    return 0;
}
