/* The limiter of admissible.h: constants, and the function that CasADi made of the model. */
#define CASADI_SYMBOL_EXPORT static __attribute__((unused))
#include "limiter.inc"
#include "limiter_numbers.h"
#include "admissible.h"

void lptn_admissible(lptn_limiter_memory *memory, const double *x, const double *load, const double *conditions,
                     double *admissible) {
    const double *given[] = {x, load, conditions, parameters, limits, most};
    for (int i = 0; i < 6; i++) memory->arguments[i] = given[i];
    memory->results[0] = admissible;
    lptn_limiter(memory->arguments, memory->results, memory->integers, memory->doubles, 0);
}
