/* The elementary functions over whole arrays, for the comparison with mpmath. */
#include "elementary.c"

EXPORTED void evaluate(int function, long long count, const double *x, double *y);

void evaluate(int function, long long count, const double *x, double *y)
{
    for (long long k = 0; k < count; ++k) {
        switch (function) {
        case 0: y[k] = elementary_exp(x[k]); break;
        case 1: y[k] = elementary_sin(x[k]); break;
        case 2: y[k] = elementary_cos(x[k]); break;
        case 3: y[k] = elementary_log(x[k]); break;
        case 4: y[k] = elementary_tanh(x[k]); break;
        default: y[k] = elementary_sqrt(x[k]); break;
        }
    }
}
