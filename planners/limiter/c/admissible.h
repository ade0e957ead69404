/* Admissible torques or currents of each joint now; limiter_sizes.h says which, in what unit and for how long.
 *
 * The largest constant RMS value with which no limited node passes its limit in that time, the other joints going on at
 * their load. No heap, no globals, a fixed number of operations. */
#ifndef ADMISSIBLE_H
#define ADMISSIBLE_H
#include "limiter_sizes.h"
#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    const double *arguments[LPTN_ARGUMENTS];
    double *results[LPTN_RESULTS];
    long long integers[LPTN_INTEGERS];
    double doubles[LPTN_DOUBLES];
} lptn_limiter_memory;

/* x: LPTN_NX temperatures of the states [degC]. load: LPTN_NU. conditions: LPTN_ND. admissible: for each joint its
 * LPTN_HORIZONS values. A value that is no number makes what depends on it 0. */
void lptn_admissible(lptn_limiter_memory *memory, const double *x, const double *load, const double *conditions,
                     double *admissible);
#ifdef __cplusplus
}
#endif
#endif
