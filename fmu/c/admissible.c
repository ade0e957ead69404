/* Stands behind the generated code: admissible torques complete the calculated outputs and their derivatives. */

typedef int (*Generated)(const double **, double **, int *, double *, int);

/* A generated function with the memory that it works in; 0 where there is none left. */
static int limiter_call(Generated function, const double **given, int n_given, double **wanted, int n_wanted) {
    const double *arguments[LIMITER_ARG] = {0};
    double *results[LIMITER_RES] = {0};
    int integers[LIMITER_IW];
    double *doubles = malloc(LIMITER_W * sizeof(double)); /* too much for the stack of some thread */
    if (!doubles) return 0;
    memcpy(arguments, given, n_given * sizeof *given);
    memcpy(results, wanted, n_wanted * sizeof *wanted);
    function(arguments, results, integers, doubles, 0);
    free(doubles);
    return 1;
}

static void limiter_into(Generated function, const double **given, int n_given, double *values) {
    int i;
    if (!limiter_call(function, given, n_given, &values, 1))
        for (i = 0; i < ADMISSIBLE; i++) values[i] = NAN;
}

static void lptn_outputs(const double **given, double **results, int *iw, double *w, int memory) {
    lptn_plain_outputs(given, results, iw, w, memory);
    limiter_into(lptn_admissible, given, 3, results[0] + PLAIN);
}

static void lptn_outputs_forward(const double **given, double **results, int *iw, double *w, int memory) {
    lptn_plain_outputs_forward(given, results, iw, w, memory);
    limiter_into(lptn_admissible_forward, given, 6, results[0] + PLAIN);
}

static void lptn_reverse(const double **given, double **results, int *iw, double *w, int memory) {
    const double *seed = given[4] + PLAIN, *arguments[] = {given[0], given[1], given[2], seed};
    double x[NX], u[SPACE_U], p[NP], *found[] = {x, u, p};
    int i, asked = 0, sound;
    lptn_plain_reverse(given, results, iw, w, memory);
    for (i = 0; i < ADMISSIBLE; i++) asked |= seed[i] != 0;
    if (!asked) return;
    sound = limiter_call(lptn_admissible_reverse, arguments, 4, found, 3);
    for (i = 0; i < NX; i++) results[0][i] += sound ? x[i] : NAN;
    for (i = 0; i < NU; i++) results[1][i] += sound ? u[i] : NAN;
    for (i = 0; i < NP; i++) results[2][i] += sound ? p[i] : NAN;
}
