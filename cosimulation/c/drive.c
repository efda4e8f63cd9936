/* Drives a co-simulation FMU through the addresses of its functions: many communication steps in one call. */
#include <stddef.h>

typedef struct {
    void *component;
    int (*set_real)(void *, const unsigned *, size_t, const double *);
    int (*get_real)(void *, const unsigned *, size_t, double *);
    int (*get_boolean)(void *, const unsigned *, size_t, int *);
    int (*do_step)(void *, double, double, int);
    const unsigned *input_references;
    const unsigned *output_references;
    const unsigned *flag_references;
    const double *inputs; /* [rows][input_count] */
    double *outputs;      /* [rows][output_count] */
    int *flags;           /* [rows][flag_count] */
    size_t input_count;
    size_t output_count;
    size_t flag_count;
    long long rows;
    double sample_time; /* s */
} Drive;

enum { WARNING = 1 };

EXPORTED int drive_rows(const Drive *drive, long long first, long long count, long long *reached);

/** one row: inputs set, outputs and flags read, and a step unless it is the last row; the first bad status */
static int drive_row(const Drive *drive, size_t row)
{
    int status = drive->set_real(drive->component, drive->input_references, drive->input_count,
                                 drive->inputs + row * drive->input_count);
    if (status > WARNING) {
        return status;
    }
    status = drive->get_real(drive->component, drive->output_references, drive->output_count,
                             drive->outputs + row * drive->output_count);
    if (status > WARNING) {
        return status;
    }
    if (drive->flag_count > 0) {
        status = drive->get_boolean(drive->component, drive->flag_references, drive->flag_count,
                                    drive->flags + row * drive->flag_count);
        if (status > WARNING) {
            return status;
        }
    }
    if ((long long)row + 1 < drive->rows) {
        status = drive->do_step(drive->component, (double)row * drive->sample_time, drive->sample_time, 1);
    }
    return status;
}

/** rows first .. first + count - 1; `reached` gets the row of a status above warning, which is returned */
int drive_rows(const Drive *drive, long long first, long long count, long long *reached)
{
    for (long long row = first; row < first + count; ++row) {
        const int status = drive_row(drive, (size_t)row);
        if (status > WARNING) {
            *reached = row;
            return status;
        }
    }
    return 0;
}
