/* Runs the controller's loop on lines of numbers, a line a tick: what a robot's fast loop does.
 *
 *     cc -std=c99 -O2 -ftree-vectorize -ffp-contract=off loop.c lptn_loop.c lptn_mpc.c -lm -o loop
 *     ./loop 0.001 < ticks.txt
 *
 * The argument is the length of a tick [s]. A line holds LPTN_NU requests, LPTN_NU measured torques or currents, LPTN_NN
 * temperatures [degC] and LPTN_ND conditions; "nan" where a value is missing. The answer is a line of LPTN_NU scales and the
 * status. Where two threads are at hand, lptn_loop_think goes into the slower one, and is called there every few ms. */
#include <stdio.h>
#include <stdlib.h>

#include "lptn_loop.h"
#include "settings.h"

static lptn_loop loop;
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
    static double asked[LPTN_NU], applied[LPTN_NU], temperatures[LPTN_NN], conditions[LPTN_ND + 1], scale[LPTN_NU];
    lptn_loop_begin(&lptn_mpc_default, &loop, count > 1 ? strtod(words[1], NULL) : 0.001);
    while (read_numbers(asked, LPTN_NU) && read_numbers(applied, LPTN_NU) && read_numbers(temperatures, LPTN_NN) &&
           read_numbers(conditions, LPTN_ND)) {
        const int status = lptn_loop_update(&loop, asked, applied, temperatures, conditions, scale);
        for (int j = 0; j < LPTN_NU; j++) printf("%.17g ", scale[j]);
        printf("%d\n", status);
        lptn_loop_think(&lptn_mpc_default, &loop, &state, &work, NULL, NULL, &result);
    }
    return 0;
}
