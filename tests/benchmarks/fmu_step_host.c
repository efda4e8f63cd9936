/* An importer in C: steps an FMU through the addresses of its functions, and looks at the clock. */
#include <stddef.h>

typedef struct {
    long seconds;
    long nanoseconds;
} ClockTime;

typedef struct {
    void *component;
    int (*set)(void *, const unsigned *, size_t, const double *);
    int (*get)(void *, const unsigned *, size_t, double *);
    int (*step)(void *, double, double, int);
    int (*clock)(int, ClockTime *); /* clock_gettime of the C library */
    const unsigned *input_references;
    const unsigned *output_references;
    const double *rows; /* [row_mask + 1][inputs], used over and over */
    size_t inputs;
    size_t outputs;
    long long row_mask; /* a power of two less one */
    double sample_time; /* s */
    int clock_id;
    int step_only; /* no set and no get */
} Host;

EXPORTED int host_run(const Host *host, long long first, long long count, double *values, size_t stride);
EXPORTED int host_block(const Host *host, long long first, long long count, double *values, long long *duration);
EXPORTED int host_each(const Host *host, long long first, long long count, double *values, int *durations);
EXPORTED long long host_cycles(const Host *host, long long count);

static long long host_now(const Host *host)
{
    ClockTime now = {0, 0};
    (void)host->clock(host->clock_id, &now);
    return now.seconds * 1000000000LL + now.nanoseconds;
}

static inline int host_one(const Host *host, long long k, double *values)
{
    int status = 0;
    if (!host->step_only) {
        status |= host->set(host->component, host->input_references, host->inputs,
                            host->rows + (size_t)(k & host->row_mask) * host->inputs);
    }
    status |= host->step(host->component, (double)k * host->sample_time, host->sample_time, 1);
    if (!host->step_only) {
        status |= host->get(host->component, host->output_references, host->outputs, values);
    }
    return status;
}

/** steps first .. first + count - 1, the outputs of each `stride` behind those of the one before; the worst status */
int host_run(const Host *host, long long first, long long count, double *values, size_t stride)
{
    int status = 0;
    for (long long k = 0; k < count; ++k) {
        status |= host_one(host, first + k, values + (size_t)k * stride);
    }
    return status;
}

/** the same, timed as a whole [ns] */
int host_block(const Host *host, long long first, long long count, double *values, long long *duration)
{
    const long long begin = host_now(host);
    const int status = host_run(host, first, count, values, 0);
    *duration = host_now(host) - begin;
    return status;
}

/** the same, every step timed [ns]: one look at the clock is in each */
int host_each(const Host *host, long long first, long long count, double *values, int *durations)
{
    long long before = host_now(host);
    int status = 0;
    for (long long k = 0; k < count; ++k) {
        status |= host_one(host, first + k, values);
        const long long now = host_now(host);
        durations[k] = (int)(now - before);
        before = now;
    }
    return status;
}

/** how long count additions take that wait for each other [ns]: one cycle each on every processor we know */
long long host_cycles(const Host *host, long long count)
{
    unsigned long long sum = 1;
    unsigned long long term = (unsigned long long)count;
    const long long begin = host_now(host);
    for (long long k = 0; k < count; k += 16) {
#define ADD sum += term; __asm__ volatile("" : "+r"(sum), "+r"(term));
        ADD ADD ADD ADD ADD ADD ADD ADD
        ADD ADD ADD ADD ADD ADD ADD ADD
    }
    return host_now(host) - begin;
}
