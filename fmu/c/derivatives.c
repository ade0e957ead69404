/* Directional and adjoint derivatives, exact, from the generated forward and reverse code. */

/* A seed or gradient over states, inputs and parameters. */
typedef struct {
    double x[NX], u[SPACE_U], p[NP];
} Known;

static double *known_place(Known *known, uint32_t r) {
    if (r >= STATES && r < RATES) return &known->x[r - STATES];
    if (r >= INPUTS && r < PARAMETERS) return &known->u[r - INPUTS];
    if (r >= PARAMETERS && r < OUTPUTS) return &known->p[r - PARAMETERS];
    return NULL;
}

static int is_unknown(uint32_t r) { return (r >= STATES && r < INPUTS) || r >= OUTPUTS; }

static Status check_derivative(Instance *I, const char *function, const uint32_t *unknowns, size_t nu,
                               const uint32_t *knowns, size_t nk, const double *seed, const double *result) {
    Known probe;
    size_t i;
    if (core_unknown(I, function, unknowns, nu, result) || core_unknown(I, function, knowns, nk, seed)) return ERROR;
    for (i = 0; i < nu; i++)
        if (!is_unknown(unknowns[i]))
            return core_fail(I, function, "%s (%u) is neither an output, a state nor a rate", NAMES[unknowns[i]], (unsigned)unknowns[i]);
    for (i = 0; i < nk; i++)
        if (knowns[i] && !known_place(&probe, knowns[i]))
            return core_fail(I, function, "%s (%u) is neither a state, an input nor a parameter", NAMES[knowns[i]], (unsigned)knowns[i]);
    return OK;
}

static Status finite_derivatives(Instance *I, const char *function, const uint32_t *references, size_t n, const double *values) {
    size_t i;
    for (i = 0; i < n; i++)
        if (!isfinite(values[i]))
            return core_fail(I, function, "a derivative at %s is not finite (%g) for these states, inputs and parameters",
                             NAMES[references[i]], values[i]);
    return OK;
}

static void forward(Instance *I, const Known *seed, const uint32_t *unknowns, size_t n, double *result) {
    const double *arguments[] = {I->data.x, I->data.u, I->data.p, seed->x, seed->u, seed->p};
    double rates[NX], outputs[SPACE_Y], times[SPACE_Z], moved[SPACE_Z];
    double *of_rates[] = {rates}, *of_outputs[] = {outputs};
    int have_rates = 0, have_outputs = 0, have_times = 0;
    size_t i;
    for (i = 0; i < n; i++) {
        uint32_t r = unknowns[i];
        if (r < RATES) result[i] = seed->x[r - STATES];
        else if (r < INPUTS) {
            if (!have_rates++) lptn_rates_forward(arguments, of_rates, NULL, NULL, 0);
            result[i] = rates[r - RATES];
        } else if (r < FORECASTS) {
            if (!have_outputs++) lptn_outputs_forward(arguments, of_outputs, NULL, NULL, 0);
            result[i] = outputs[r - OUTPUTS];
        } else if (r < INDICATORS) {
            if (!have_times++) forecast(I, times, seed->x, seed->u, seed->p, moved);
            result[i] = moved[r - FORECASTS];
        } else result[i] = seed->p[LIMITS + (r - INDICATORS)] - seed->x[r - INDICATORS];
    }
}

static Status core_forward(Instance *I, const char *function, const uint32_t *unknowns, size_t nu,
                           const uint32_t *knowns, size_t nk, const double *seed, double *result) {
    Known sown;
    size_t i;
    if (check_derivative(I, function, unknowns, nu, knowns, nk, seed, result) != OK) return ERROR;
    memset(&sown, 0, sizeof sown);
    for (i = 0; i < nk; i++)
        if (knowns[i]) *known_place(&sown, knowns[i]) += seed[i];
    forward(I, &sown, unknowns, nu, result);
    return finite_derivatives(I, function, unknowns, nu, result);
}

/* Forecasts have no reverse code: their gradient is found direction by direction. */
static void reverse_forecasts(Instance *I, const double *seed, const uint32_t *knowns, size_t n, double *result) {
    double times[SPACE_Z], moved[SPACE_Z];
    Known unit;
    size_t i;
    int k;
    for (i = 0; i < n; i++) {
        if (!knowns[i]) continue;
        memset(&unit, 0, sizeof unit);
        *known_place(&unit, knowns[i]) = 1;
        forecast(I, times, unit.x, unit.u, unit.p, moved);
        for (k = 0; k < NZ; k++) result[i] += seed[k] * moved[k];
    }
}

static Status core_reverse(Instance *I, const char *function, const uint32_t *unknowns, size_t nu,
                           const uint32_t *knowns, size_t nk, const double *seed, double *result) {
    double rates[NX] = {0}, outputs[SPACE_Y] = {0}, times[SPACE_Z] = {0};
    int forecasts = 0;
    Known found;
    const double *arguments[] = {I->data.x, I->data.u, I->data.p, rates, outputs};
    double *results[] = {found.x, found.u, found.p};
    double direct[NX] = {0}, margins[SPACE_E] = {0};
    size_t i;
    int limit;
    if (check_derivative(I, function, unknowns, nu, knowns, nk, result, seed) != OK) return ERROR;
    for (i = 0; i < nu; i++) {
        uint32_t r = unknowns[i];
        if (r < RATES) direct[r - STATES] += seed[i];
        else if (r < INPUTS) rates[r - RATES] += seed[i];
        else if (r < FORECASTS) outputs[r - OUTPUTS] += seed[i];
        else if (r < INDICATORS) forecasts = 1, times[r - FORECASTS] += seed[i];
        else margins[r - INDICATORS] += seed[i];
    }
    memset(&found, 0, sizeof found);
    lptn_reverse(arguments, results, NULL, NULL, 0);
    for (i = 0; i < NX; i++) found.x[i] += direct[i];
    for (limit = 0; limit < NE; limit++) {
        found.x[limit] -= margins[limit];
        found.p[LIMITS + limit] += margins[limit];
    }
    for (i = 0; i < nk; i++) result[i] = knowns[i] ? *known_place(&found, knowns[i]) : 0;
    if (forecasts) reverse_forecasts(I, times, knowns, nk, result);
    return finite_derivatives(I, function, knowns, nk, result);
}

static Status core_orders(Instance *I, const char *function, const int *orders, size_t n) {
    size_t i;
    if (n && !orders) return core_fail(I, function, "null pointer");
    for (i = 0; i < n; i++)
        if (orders[i] != 1) return core_fail(I, function, "order %d; only order 1 is known", orders[i]);
    return OK;
}

/* Time derivatives of outputs along the present motion: rates of the states, slopes of the inputs. */
static Status core_output_slopes(Instance *I, const char *function, const uint32_t *references, size_t n, double *values) {
    Known seed;
    size_t i;
    if (core_unknown(I, function, references, n, values)) return ERROR;
    for (i = 0; i < n; i++) {
        if (!is_unknown(references[i]))
            return core_fail(I, function, "%s (%u) is no output", NAMES[references[i]], (unsigned)references[i]);
    }
    memset(&seed, 0, sizeof seed);
    know_rates(I);
    memcpy(seed.x, I->rates, sizeof seed.x);
    memcpy(seed.u, I->data.slope, sizeof seed.u);
    forward(I, &seed, references, n, values);
    return finite_derivatives(I, function, references, n, values);
}
