/* Runs the controller on lines of numbers: what a robot's program does every control period.
 *
 *     cc -std=c99 -O2 -ftree-vectorize -ffp-contract=off main.c lptn_mpc.c -lm -o controller
 *     ./controller < example.txt
 *
 * -DLPTN_WIDE lets gcc use wide vectors where a PC has them: the same digits, nearly twice as fast.
 *
 * A line holds LPTN_NN temperatures [degC], LPTN_NU requests (RMS over the horizon) and LPTN_ND conditions, in the order
 * that names.txt tells; "nan" where a value is missing. With the argument "preview" requests and conditions are told
 * for each of the LPTN_N stages: temperatures, then LPTN_N times the requests, then LPTN_N times the conditions. The
 * answer is a line of LPTN_NU admitted values, the status and the cost. Times on standard error: processor time of each
 * call. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "lptn_mpc.h"
#include "settings.h"

static lptn_mpc_state state;
static lptn_mpc_work work;
static lptn_mpc_result result;

static int read_numbers(double *to, int count) {
    char word[64], *end;
    for (int i = 0; i < count; i++) {
        if (scanf("%63s", word) != 1) return 0;
        to[i] = strtod(word, &end);
        if (end == word) return 0;
    }
    return 1;
}

int main(int count, char **words) {
    static double measured[LPTN_NN], request[LPTN_N * LPTN_NU], conditions[LPTN_N * LPTN_ND + 1];
    const int told = count > 1 && !strcmp(words[1], "preview") ? LPTN_N : 1;
    double total = 0, worst = 0;
    long steps = 0;
    while (read_numbers(measured, LPTN_NN) && read_numbers(request, told * LPTN_NU) &&
           read_numbers(conditions, told * LPTN_ND)) {
        for (int k = told; k < LPTN_N; k++) {
            memcpy(request + k * LPTN_NU, request, LPTN_NU * sizeof *request);
            memcpy(conditions + k * LPTN_ND, conditions, LPTN_ND * sizeof *conditions);
        }
        const clock_t before = clock();
        lptn_mpc_step(&lptn_mpc_default, &state, &work, measured, request, conditions, NULL, &result);
        const double taken = (double)(clock() - before) / CLOCKS_PER_SEC;
        for (int j = 0; j < LPTN_NU; j++) printf("%.17g ", result.admitted[j]);
        printf("%d %.17g\n", result.status, result.cost);
        total += taken, worst = taken > worst ? taken : worst, steps++;
    }
    if (steps) fprintf(stderr, "%ld steps, %.1f us each, worst %.1f us\n", steps, 1e6 * total / steps, 1e6 * worst);
    return 0;
}
