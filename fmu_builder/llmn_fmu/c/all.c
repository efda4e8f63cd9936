/* The FMU of a local linear model network as one translation unit; tables.h and variables.h are generated. */
#include "elementary.c"
#include "message.c"
#include "kernel.c"
#include "tables.h"
#include "variables.h"
#include "llmn_model.c"
#include "slave.c"
#include "functions.c"
