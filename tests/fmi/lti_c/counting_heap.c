/* A heap that counts, in place of the C library's. */

static double arena[1 << 14];
static size_t used;
static int allocations;

EXPORTED int allocation_count(void);

EXPORTED int allocation_count(void)
{
    return allocations;
}

void *calloc(size_t count, size_t size)
{
    const size_t first = used;
    used += (count * size + sizeof arena[0] - 1) / sizeof arena[0];
    ++allocations;
    return used <= sizeof arena / sizeof arena[0] ? &arena[first] : NULL;
}

void free(void *memory)
{
    (void)memory;
}
