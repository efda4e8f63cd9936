/* The test FMU with a heap that counts. */
#include "all.c"
#include "counting_heap.c"
