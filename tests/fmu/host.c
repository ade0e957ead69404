/* A small importer of its own in C: load an FMI 3 library, co-simulate, print all outputs. Built for each platform.
   Usage: host LIBRARY TOKEN STEPS INPUTS(first count) OUTPUTS(first count). With STEPS above 100000 it times the steps. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fmi3FunctionTypes.h"

#ifdef _WIN32
#include <windows.h>
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

#define MOST 1000
#define TIMED 100000

static void hear(fmi3InstanceEnvironment e, fmi3Status s, fmi3String category, fmi3String text) {
    (void)e;
    fprintf(stderr, "%d %s %s\n", (int)s, category, text);
}

static unsigned state = 1;
static double next(void) {
    state = state * 1664525u + 1013904223u;
    return (double)(state >> 8) / (1 << 24);
}

int main(int count, char **words) {
    fmi3ValueReference inputs[MOST], outputs[MOST];
    double u[MOST], y[MOST], reached, spent;
    bool event, end, early;
    long k, n;
    size_t i, nu, ny;
    clock_t begun;
    void *library;
    fmi3Instance c;
    fmi3InstantiateCoSimulationTYPE *make;
    fmi3EnterInitializationModeTYPE *enter;
    fmi3ExitInitializationModeTYPE *leave;
    fmi3SetFloat64TYPE *set;
    fmi3GetFloat64TYPE *get;
    fmi3DoStepTYPE *step;
    fmi3FreeInstanceTYPE *drop;
    if (count != 8) return 2;
    library = OPEN(words[1]);
    if (!library) return 3;
    *(void **)&make = FIND(library, "fmi3InstantiateCoSimulation");
    *(void **)&enter = FIND(library, "fmi3EnterInitializationMode");
    *(void **)&leave = FIND(library, "fmi3ExitInitializationMode");
    *(void **)&set = FIND(library, "fmi3SetFloat64");
    *(void **)&get = FIND(library, "fmi3GetFloat64");
    *(void **)&step = FIND(library, "fmi3DoStep");
    *(void **)&drop = FIND(library, "fmi3FreeInstance");
    if (!make || !enter || !leave || !set || !get || !step || !drop) return 4;
    n = atol(words[3]);
    nu = (size_t)atol(words[5]);
    ny = (size_t)atol(words[7]);
    for (i = 0; i < nu; i++) inputs[i] = (fmi3ValueReference)atol(words[4]) + (fmi3ValueReference)i;
    for (i = 0; i < ny; i++) outputs[i] = (fmi3ValueReference)atol(words[6]) + (fmi3ValueReference)i;
    c = make("host", words[2], "", false, true, false, false, NULL, 0, NULL, hear, NULL);
    if (!c || enter(c, false, 0, 0, false, 0) || leave(c)) return 5;
    if (get(c, inputs, nu, u, nu)) return 6;
    begun = clock();
    for (k = 0; k < n; k++) {
        if (n <= TIMED || k % 1000 == 0)
            for (i = 0; i < nu; i++)
                if (u[i] < 200) u[i] = 6 * next(); /* temperatures stay */
        if (set(c, inputs, nu, u, nu)) return 7;
        if (step(c, 0.1 * (double)k, 0.1, true, &event, &end, &early, &reached)) return 8;
        if (get(c, outputs, ny, y, ny)) return 9;
    }
    spent = (double)(clock() - begun) / CLOCKS_PER_SEC;
    for (i = 0; i < ny; i++) printf("%.17g\n", y[i]);
    if (n > TIMED) printf("microseconds %.4f\n", 1e6 * spent / (double)n);
    drop(c);
    return 0;
}
