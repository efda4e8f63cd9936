/* One small dense system of equations; specification.py solves in the same order. */

/* Before what runs at a start or a change of parameters only, never in a step: small code rather than fast code. */
#if defined(__clang__)
#define RARE __attribute__((minsize)) static inline
#else
#define RARE static inline
#endif

/* x <- M^-1 x by Gaussian elimination with row pivoting, M[column][row]; 1 = M is singular (pivot <= 1e-14 max |M|). */
RARE int linear_solve(double *matrix, int n, double *x) {
    double largest = 0.0;
    int i, j, k;
    for (i = 0; i < n * n; ++i) {
        double size = matrix[i] < 0.0 ? -matrix[i] : matrix[i];
        if (size > largest) largest = size;
    }
    for (k = 0; k < n; ++k) {
        double *column = matrix + k * n;
        int pivot = k;
        double size = 0.0;
        for (i = k; i < n; ++i) {
            double candidate = column[i] < 0.0 ? -column[i] : column[i];
            if (candidate > size) { size = candidate; pivot = i; }
        }
        if (!(size > 1e-14 * largest)) return 1;
        if (pivot != k) {
            double kept = x[k];
            x[k] = x[pivot];
            x[pivot] = kept;
            for (j = k; j < n; ++j) {
                kept = matrix[j * n + k];
                matrix[j * n + k] = matrix[j * n + pivot];
                matrix[j * n + pivot] = kept;
            }
        }
        for (i = k + 1; i < n; ++i) {
            double factor = column[i] / column[k];
            for (j = k + 1; j < n; ++j) matrix[j * n + i] -= factor * matrix[j * n + k];
            x[i] -= factor * x[k];
        }
    }
    for (k = n - 1; k >= 0; --k) {
        for (j = k + 1; j < n; ++j) x[k] -= matrix[j * n + k] * x[j];
        x[k] /= matrix[k * n + k];
    }
    return 0;
}
