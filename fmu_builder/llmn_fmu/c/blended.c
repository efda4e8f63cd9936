/* The FMU of a network whose models at the nodes are made of its local models; tables.h and variables.h are generated. */
#define FIXED(any, field) ((void)(any), tables.field)
#include "elementary.c"
#include "message.c"
#include "kernel.h"
#include "tables.h"
#include "kernel.c"
#include "steady_tangent.c"
#include "variables.h"
#include "llmn_blended.c"
#include "llmn_no_parameters.c"
#include "llmn_model.c"
#include "slave.c"
#include "functions.c"
