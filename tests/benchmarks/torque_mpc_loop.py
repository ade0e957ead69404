"""The controller in a 1 kHz loop of C: worst time of an update over a million calls, with sensors that fail.

Run it with ``python -m tests.benchmarks.torque_mpc_loop``. The emitted code of the 13-node quadruped runs a million
ticks of 1 ms (17 min of a robot) on random torques and temperatures near the limits. At random moments temperatures,
torques and other inputs are missing, infinite, absurd, or stand for up to a minute, all at once too. Once it is
compiled as for a robot and the same million runs three times: the time of an update is the least of the three, since
what one of them was interrupted by is not its own. Once it is compiled with the sanitizers of addresses and undefined
behaviour, whose first finding ends it. Every scale must be a number from 0 to 1.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from lptn.planners.mpc import TorqueMPC
from tests.planners.truth import conditions, model_of, true_robot

_PROGRAM = """\
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "lptn_loop.h"
#include "settings.h"

static lptn_loop loop;
static lptn_mpc_state state;
static lptn_mpc_work work;
static lptn_mpc_result result;
static unsigned long long seed = 1;

static double uniform(void) {
    seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
    return (double)(seed >> 11) / 9007199254740992.0;
}

static double now(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

#define CHANNELS (2 * LPTN_NU + LPTN_NN + LPTN_ND)
static double values[CHANNELS + 1], held[CHANNELS];
static int fault[CHANNELS], until[CHANNELS];

static int by_size(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static int once(int calls, int pass) {
    static const double around[LPTN_ND + 1] = {AROUND};
    static float taken[10000000], solved[100000];
    double scale[LPTN_NU], wall = 0, warm[LPTN_NN];
    int faults = 0, bad = 0, solves = 0, best = 0, blind = 0;
    seed = 1;
    memset(until, 0, sizeof until), memset(&state, 0, sizeof state);
    for (int i = 0; i < LPTN_NN; i++) warm[i] = 50 + 10 * uniform();
    lptn_loop_begin(&lptn_mpc_default, &loop, 0.001);
    for (int k = 0; k < calls; k++) {
        for (int i = 0; i < LPTN_NN; i++) warm[i] = fmin(fmax(warm[i] + 0.02 * (uniform() - 0.5), 20), 75);
        for (int c = 0; c < CHANNELS; c++) {
            const double sound = c < LPTN_NU       ? 40 * (uniform() - 0.5)
                                 : c < 2 * LPTN_NU ? values[c - LPTN_NU] * 0.9
                                 : c < 2 * LPTN_NU + LPTN_NN ? warm[c - 2 * LPTN_NU] + 0.1 * (uniform() - 0.5)
                                                             : around[c - 2 * LPTN_NU - LPTN_NN];
            if (k >= until[c] && uniform() < 1e-5)
                fault[c] = 1 + (int)(5 * uniform()), until[c] = k + (int)(60000 * uniform()), held[c] = sound, faults++;
            values[c] = k >= until[c]   ? sound
                        : fault[c] == 1 ? NAN
                        : fault[c] == 2 ? (uniform() < 0.5 ? INFINITY : -INFINITY)
                        : fault[c] == 3 ? 1e300 * (uniform() - 0.5)
                        : fault[c] == 4 ? held[c]
                                        : 0;
        }
        const double here = now(CLOCK_MONOTONIC), before = now(CLOCK_THREAD_CPUTIME_ID);
        const int status = lptn_loop_update(&loop, values, values + LPTN_NU, values + 2 * LPTN_NU,
                                            values + 2 * LPTN_NU + LPTN_NN, scale);
        const double after = now(CLOCK_THREAD_CPUTIME_ID), there = now(CLOCK_MONOTONIC);
        taken[k] = pass ? fminf((float)(after - before), taken[k]) : (float)(after - before);
        wall = fmax(wall, there - here);
        for (int j = 0; j < LPTN_NU; j++) bad += !(scale[j] >= 0 && scale[j] <= 1);
        blind += (status & LPTN_LOOP_BLIND) > 0;
        if (status & LPTN_LOOP_WAITING) {
            const double begun = now(CLOCK_THREAD_CPUTIME_ID);
            lptn_loop_think(&lptn_mpc_default, &loop, &state, &work, NULL, NULL, &result);
            solved[solves++] = (float)(now(CLOCK_THREAD_CPUTIME_ID) - begun);
            best += (result.status & LPTN_NOT_BEST) > 0;
        }
    }
    if (pass < PASSES - 1) return bad;
    qsort(taken, (size_t)calls, sizeof taken[0], by_size), qsort(solved, (size_t)solves, sizeof solved[0], by_size);
    printf("%d updates, %d faults begun, blind in %d, scales that are none: %d\\n", calls, faults, blind, bad);
    printf("update, us of processor time: median %.2f, 99.99 %% %.2f, worst %.2f; worst on the wall %.1f\\n",
           taken[calls / 2], taken[(int)(0.9999 * calls)], taken[calls - 1], wall);
    printf("solver: %d solves, median %.0f us, worst %.0f, not converged %d\\n", solves, solved[solves / 2],
           solved[solves - 1], best);
    return bad;
}

int main(int count, char **words) {
    int bad = 0;
    for (int pass = 0; pass < PASSES; pass++) bad += once(count > 1 ? atoi(words[1]) : 1000000, pass);
    return bad > 0;
}
"""
_BUILDS = {
    "as on a robot": ("-DPASSES=3", "-O2", "-ftree-vectorize", "-ffp-contract=off"),
    "sanitizers": ("-DPASSES=1", "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover"),
}


def run(calls: int, build: str, folder: Path) -> str:
    """Compile and run it; what it prints.

    Raises:
        subprocess.CalledProcessError: a warning of the compiler, a finding of the sanitizers, or a scale that is none.
    """
    mpc = TorqueMPC(model_of(true_robot(1), 0.1, 1), {"*_*": 60.0}, request="torque")
    around = conditions(mpc.conditions)
    mpc.emit(folder, np.full(len(mpc.model.nodes), 50.0), np.full((1, len(mpc.joints)), 9.0), around[None])
    program = _PROGRAM.replace("AROUND", ", ".join(f"{value:.17g}" for value in around))
    (folder / "million.c").write_text(program, encoding="utf-8")
    words = ["cc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *_BUILDS[build], "million.c", "lptn_loop.c",
             "lptn_mpc.c", "-lm", "-o", "million"]  # fmt: skip
    subprocess.run(words, cwd=folder, check=True)
    done = subprocess.run([folder / "million", str(calls)], cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", type=int, default=1_000_000)
    arguments = parser.parse_args()
    for build in _BUILDS:
        with tempfile.TemporaryDirectory() as folder:
            print(f"{build}: {run(arguments.calls, build, Path(folder))}", flush=True)


if __name__ == "__main__":
    main()
