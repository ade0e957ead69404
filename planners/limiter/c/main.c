/* Runs the limiter on lines of numbers.
 *
 *     cc -std=c99 -O2 -ffp-contract=off main.c admissible.c -lm -o limiter
 *     ./limiter < example.txt
 *
 * A line holds the temperatures of the states [degC], the RMS loads of the joints and the model's other inputs, in the order
 * that names.txt tells. The answer is a line of admissible values: for each joint one for each horizon. Processor time of
 * each call on standard error. */
#include <stdio.h>
#include <time.h>

#include "admissible.h"

static lptn_limiter_memory memory;

static int read_numbers(double *to, int count) {
    for (int i = 0; i < count; i++)
        if (scanf("%lf", to + i) != 1) return 0;
    return 1;
}

int main(void) {
    static double x[LPTN_NX], load[LPTN_NU], conditions[LPTN_ND + 1], admissible[LPTN_NU * LPTN_HORIZONS];
    double total = 0;
    long calls = 0;
    while (read_numbers(x, LPTN_NX) && read_numbers(load, LPTN_NU) && read_numbers(conditions, LPTN_ND)) {
        const clock_t before = clock();
        lptn_admissible(&memory, x, load, conditions, admissible);
        total += (double)(clock() - before) / CLOCKS_PER_SEC, calls++;
        for (int i = 0; i < LPTN_NU * LPTN_HORIZONS; i++) printf("%.17g ", admissible[i]);
        printf("\n");
    }
    if (calls) fprintf(stderr, "%ld calls, %.1f us each\n", calls, 1e6 * total / calls);
    return 0;
}
