/* A thermal network's instance: values, checks, call order, state, reset. Everything here is static: an FMU is one unit. */
#include "core.h"

#define CASADI_SYMBOL_EXPORT static /* nothing but the interface leaves this unit */
#include "model.c"

#define MAGIC 0x6c70746e464d5531ull
#define STATES 1
#define RATES (STATES + NX)
#define INPUTS (RATES + NX)
#define PARAMETERS (INPUTS + NU)
#define OUTPUTS (PARAMETERS + NP)
#define FORECASTS (OUTPUTS + NY)
#define INDICATORS (FORECASTS + NZ)
#define END (INDICATORS + NE)  /* of the real variables */
#define CROSSED END            /* Boolean */
#define CLOCKS (CROSSED + NE)  /* FMI 3 */
#define COLD 150.0 /* K; no robot is so cold: somebody has set degrees Celsius */
#define ULPS 4.0          /* of a time: what the arithmetic of an importer may lose */
#define PART_OF_STEP 1e-6 /* of a communication step: what may lie between its begin and the end of the last one */
#define PAST_STOP 1e-3    /* of a communication step: an importer's sum of 216,000 steps of 1/60 s ends 1e-6 of one beyond */

/* --- what is said ------------------------------------------------------------------------------- */

static const char *const CATEGORIES[] = {"logStatusWarning", "logStatusDiscard", "logStatusError"};

static void core_say(Instance *I, Category category, const char *function, const char *format, va_list list) {
    static const Status statuses[] = {WARNING, DISCARD, ERROR};
    char longer[256], text[512];
    if (!I->log || !(I->logged & BIT(category))) return;
    snprintf(longer, sizeof longer, "%s: %s", function, format);
    vsnprintf(text, sizeof text, longer, list);
    I->log(I, statuses[category], CATEGORIES[category], text);
}

static Status core_fail(Instance *I, const char *function, const char *format, ...) {
    va_list list;
    va_start(list, format);
    core_say(I, ERRORS, function, format, list);
    va_end(list);
    return ERROR;
}

/* A trial that an importer may repeat otherwise: discarded in Model Exchange, where solvers try; an error elsewhere. */
static Status core_discard(Instance *I, int discard, const char *function, const char *format, ...) {
    va_list list;
    va_start(list, format);
    core_say(I, discard ? DISCARDS : ERRORS, function, format, list);
    va_end(list);
    return discard ? DISCARD : ERROR;
}

static void core_warn(Instance *I, const char *function, const char *format, ...) {
    va_list list;
    va_start(list, format);
    core_say(I, WARNINGS, function, format, list);
    va_end(list);
}

static Status core_set_logging(Instance *I, const char *function, int on, size_t n, const char *const *categories) {
    int wanted = n ? 0 : ALL_CATEGORIES, k;
    size_t i;
    if (n && !categories) return core_fail(I, function, "null pointer");
    for (i = 0; i < n; i++) {
        for (k = 0; k < CATEGORY_COUNT; k++)
            if (categories[i] && !strcmp(categories[i], CATEGORIES[k])) break;
        if (k == CATEGORY_COUNT)
            return core_fail(I, function, "no log category \"%s\"", categories[i] ? categories[i] : "");
        wanted |= BIT(k);
    }
    I->logged = on ? wanted : LOG_OFF;
    return OK;
}

static const char *mode_name(int64_t mode) {
    switch (mode) {
        case INSTANTIATED: return "the instantiated state";
        case INITIALIZATION: return "initialization mode";
        case EVENT: return "event mode";
        case CONTINUOUS: return "continuous-time mode";
        case STEP: return "step mode";
        case UPDATE: return "an intermediate update";
        default: return "the terminated state";
    }
}

/* Nonzero, and said, where a function is not allowed in the present mode. */
static int core_refuses(Instance *I, const char *function, int modes) {
    if (!I || I->magic != MAGIC) return 1;
    if (I->data.mode & modes) return 0;
    core_fail(I, function, "not allowed in %s", mode_name(I->data.mode));
    return 1;
}

/* Nonzero, and said, where a function is one of the other interface type. */
static int core_refuses_type(Instance *I, const char *function, int type) {
    if (I->data.type == type) return 0;
    core_fail(I, function, "for %s only", type == MODEL_EXCHANGE ? "Model Exchange" : "Co-Simulation");
    return 1;
}

/* --- life ---------------------------------------------------------------------------------------- */

static void core_forget(Instance *I) {
    I->rates_known = I->outputs_known = I->forecasts_known = 0;
    if (BOUND_MOVES) I->bound_known = 0;
}

static void core_forget_all(Instance *I) {
    core_forget(I);
    I->bound_known = 0;
}

static void core_reset(Instance *I) {
    int64_t type = I->data.type, event_mode = I->data.event_mode;
    memset(&I->data, 0, sizeof I->data);
    memcpy(I->data.x, START, sizeof I->data.x);
    if (NU) memcpy(I->data.u, START + NX, NU * sizeof(double));
    memcpy(I->data.p, START + NX + NU, sizeof I->data.p);
    memcpy(I->data.begun, START, sizeof I->data.begun);
    I->data.stop = INFINITY;
    I->data.type = type;
    I->data.event_mode = event_mode;
    I->data.mode = INSTANTIATED;
    I->warned_cold = I->warned_step = 0;
    I->last_step = OK;
    I->last_time = 0;
    core_forget_all(I);
}

static Instance *core_new(const char *name, int type, Logger log, int logging) {
    Instance *I = calloc(1, sizeof *I);
    if (!I) return NULL;
    I->magic = MAGIC;
    I->log = log;
    I->logged = logging ? ALL_CATEGORIES : LOG_OFF;
    I->data.type = type;
    I->name = calloc(strlen(name && *name ? name : "unnamed") + 1, 1);
    if (I->name) strcpy(I->name, name && *name ? name : "unnamed");
    core_reset(I);
    return I;
}

static void core_free(Instance *I) {
    if (!I || I->magic != MAGIC) return;
    while (I->snapshots) {
        Snapshot *next = I->snapshots->next;
        free(I->snapshots);
        I->snapshots = next;
    }
    I->magic = 0;
    free(I->name);
    free(I);
}

/* What two times that mean the same may differ by [s]: the rounding of either, and a part of the step between them.
   Communication points are absolute: near 1.7e9 s, today as a robot stamps it, they are a quarter of a microsecond apart. */
static double same_time(double one, double other, double part_of_step) {
    return ULPS * DBL_EPSILON * fmax(fabs(one), fabs(other)) + part_of_step;
}

static Status core_start(Instance *I, const char *function, double start, int has_stop, double stop) {
    if (!isfinite(start)) return core_fail(I, function, "start time %g refused", start);
    if (has_stop && !(stop >= start)) return core_fail(I, function, "stop time %g before start time %g", stop, start);
    I->data.start = I->data.time = I->last_time = start;
    I->data.stop = has_stop ? stop : INFINITY;
    return OK;
}

/* Where fmi2SetContinuousStates and fmi3SetContinuousStates are allowed. */
#define SET_STATES (ANY_MODE ? EVENT | CONTINUOUS : CONTINUOUS)

/* --- values --------------------------------------------------------------------------------------- */

static void model_rates(const double *x, const double *u, const double *p, double *rates) {
    const double *arguments[] = {x, u, p};
    double *results[] = {rates};
    lptn_rates(arguments, results, NULL, NULL, 0);
}

static void know_rates(Instance *I) {
    if (!I->rates_known) model_rates(I->data.x, I->data.u, I->data.p, I->rates);
    I->rates_known = 1;
}

static void know_outputs(Instance *I) {
    const double *arguments[] = {I->data.x, I->data.u, I->data.p};
    double *results[] = {I->outputs};
    if (!I->outputs_known && NY) lptn_outputs(arguments, results, NULL, NULL, 0);
    I->outputs_known = 1;
}

#include "events.c"
#include "solve.c"

static int core_unknown(Instance *I, const char *function, const uint32_t *references, size_t n, const void *values) {
    size_t i;
    if (n && (!references || !values)) {
        core_fail(I, function, "null pointer");
        return 1;
    }
    for (i = 0; i < n; i++)
        if (references[i] >= END) {
            core_fail(I, function, "no variable with value reference %u", (unsigned)references[i]);
            return 1;
        }
    return 0;
}

/* Finite inputs can be so large that what follows from them is not. */
static Status core_finite(Instance *I, const char *function, const char *name, double value) {
    if (isfinite(value)) return OK;
    return core_discard(I, I->data.type == MODEL_EXCHANGE, function, "%s is not finite (%g) for these states, inputs and parameters",
                        name, value);
}

static Status core_get(Instance *I, const char *function, const uint32_t *references, size_t n, double *values) {
    size_t i;
    if (core_unknown(I, function, references, n, values)) return ERROR;
    for (i = 0; i < n; i++) {
        uint32_t r = references[i];
        if (r == 0) values[i] = I->data.time;
        else if (r < RATES) values[i] = I->data.x[r - STATES];
        else if (r < INPUTS) know_rates(I), values[i] = I->rates[r - RATES];
        else if (r < PARAMETERS) values[i] = I->data.u[r - INPUTS];
        else if (r < OUTPUTS) values[i] = I->data.p[r - PARAMETERS];
        else if (r < FORECASTS) know_outputs(I), values[i] = I->outputs[r - OUTPUTS];
        else if (r < INDICATORS) know_forecasts(I), values[i] = I->forecasts[r - FORECASTS];
        else values[i] = core_indicator(I, (int)(r - INDICATORS));
    }
    for (i = 0; i < n; i++) {
        Status status = core_finite(I, function, NAMES[references[i]], values[i]);
        if (status != OK) return status;
    }
    return OK;
}

/* The modes in which a variable may be set (FMI 2.0.4, 3.2.3 and 4.2.4; FMI 3.0.1, 2.3, 3.2 and 4.2). An FMU for
   CasADi takes states and parameters in any mode: CasADi sets them so when it differentiates. */
static int settable(uint32_t r) {
    enum { BEFORE = INSTANTIATED | INITIALIZATION, MORE = ANY_MODE ? EVENT | CONTINUOUS : 0 };
    if (r == 0 || r >= OUTPUTS) return 0;
    if (r < RATES) return BEFORE | STATES_ONE_BY_ONE | MORE;
    if (r < INPUTS) return 0;
    if (r < PARAMETERS) return BEFORE | EVENT | CONTINUOUS | STEP | UPDATE;
    return BEFORE | EVENT | STEP | MORE;
}

static Status check_value(Instance *I, const char *function, uint32_t r, double value) {
    unsigned shown = (unsigned)r;
    if (!settable(r)) return core_fail(I, function, "%s (%u) is calculated and can't be set", NAMES[r], shown);
    if (!(settable(r) & I->data.mode))
        return core_fail(I, function, "%s (%u) can't be set in %s", NAMES[r], shown, mode_name(I->data.mode));
    if (!(value >= LEAST[r] && value <= MOST[r]) || !isfinite(value))
        return core_discard(I, I->data.mode == CONTINUOUS, function, "%s (%u): %g refused, it must lie from %g to %g",
                            NAMES[r], shown, value, LEAST[r], MOST[r]);
    if (CELSIUS[r] && value < COLD && !I->warned_cold) {
        I->warned_cold = 1;
        core_warn(I, function, "%s (%u) is set to %g: that is kelvin, not degrees Celsius", NAMES[r], shown, value);
    }
    return OK;
}

/* All values or none: a refused call leaves the instance as it was. */
static Status core_set(Instance *I, const char *function, const uint32_t *references, size_t n, const double *values) {
    size_t i;
    if (core_unknown(I, function, references, n, values)) return ERROR;
    for (i = 0; i < n; i++) {
        Status status = check_value(I, function, references[i], values[i]);
        if (status != OK) return status;
    }
    for (i = 0; i < n; i++) {
        uint32_t r = references[i];
        if (r < RATES) I->data.x[r - STATES] = values[i];
        else if (r < PARAMETERS) I->data.u[r - INPUTS] = values[i];
        else I->data.p[r - PARAMETERS] = values[i], I->bound_known = 0;
    }
    if (n) core_forget(I);
    return OK;
}

static Status core_set_slopes(Instance *I, const char *function, const uint32_t *references, size_t n,
                              const int *orders, const double *values) {
    size_t i;
    if (core_unknown(I, function, references, n, values)) return ERROR;
    if (n && !orders) return core_fail(I, function, "null pointer");
    for (i = 0; i < n; i++) {
        uint32_t r = references[i];
        if (r < INPUTS || r >= PARAMETERS) return core_fail(I, function, "%s (%u) is no input", NAMES[r], (unsigned)r);
        if (orders[i] != 1) return core_fail(I, function, "order %d; inputs go in straight lines, order 1", orders[i]);
        if (!isfinite(values[i])) return core_fail(I, function, "%s (%u): %g refused", NAMES[r], (unsigned)r, values[i]);
    }
    for (i = 0; i < n; i++) I->data.slope[references[i] - INPUTS] = values[i];
    I->data.sloped |= n > 0;
    return OK;
}

static Status core_set_states(Instance *I, const char *function, const double *states, size_t n) {
    size_t i;
    if (n != NX || !states) return core_fail(I, function, "%u states given, the model has %d", (unsigned)n, NX);
    for (i = 0; i < n; i++)
        if (!isfinite(states[i]) || states[i] < LEAST[STATES + i])
            return core_discard(I, 1, function, "%s: %g refused", NAMES[STATES + i], states[i]);
    memcpy(I->data.x, states, NX * sizeof(double));
    core_forget(I);
    return OK;
}

static Status core_rates(Instance *I, const char *function, double *rates, size_t n) {
    if (n != NX || !rates) return core_fail(I, function, "%u rates asked for, the model has %d", (unsigned)n, NX);
    know_rates(I);
    memcpy(rates, I->rates, NX * sizeof(double));
    for (n = 0; n < NX; n++) {
        Status status = core_finite(I, function, NAMES[RATES + n], rates[n]);
        if (status != OK) return status;
    }
    return OK;
}

#include "derivatives.c"
#include "snapshots.c"
