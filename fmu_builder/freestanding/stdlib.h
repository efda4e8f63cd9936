/* The little of <stdlib.h> that FMI 2.0 headers and our C ask for, for builds without a C library. */
#ifndef FREESTANDING_STDLIB_H
#define FREESTANDING_STDLIB_H

#include <stddef.h>

void *calloc(size_t count, size_t size);
void free(void *memory);

#endif
