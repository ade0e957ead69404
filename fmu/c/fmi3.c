/* FMI 3.0, Model Exchange and Co-Simulation, over the core. */
#include "fmi3Functions.h"

#define STATES_ONE_BY_ONE CONTINUOUS /* fmi3SetFloat64 sets states as fmi3SetContinuousStates does */
#define LOG_OFF 0                    /* no message at all */
#include "core.c"

#include "arrays.c"

#define RUNNING (EVENT | CONTINUOUS | STEP)
#define OUTSIDE (INSTANTIATED | INITIALIZATION | RUNNING | TERMINATED)
#define ANY (OUTSIDE | UPDATE)

/* Refuse a call without a usable instance, or in a mode that does not allow it. */
#define REQUIRE(modes, name)                     \
    Instance *I = instance;                      \
    if (core_refuses(I, name, modes)) return fmi3Error

/* The same for a function of one interface type. */
#define REQUIRE_ONE(type, modes, name) \
    REQUIRE(modes, name);              \
    if (core_refuses_type(I, name, type)) return fmi3Error

typedef struct {
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update;
    bool early;
    double return_at; /* asked for in the step that is under way; infinite where it isn't */
} Callbacks;

static void say(Instance *I, Status status, const char *category, const char *message) {
    const Callbacks *callbacks = I->callbacks;
    if (callbacks && callbacks->log) callbacks->log(I->environment, (fmi3Status)status, category, message);
}

/* --- common ---------------------------------------------------------------------------------------- */

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    REQUIRE(OUTSIDE, "fmi3SetDebugLogging");
    return (fmi3Status)core_set_logging(I, "fmi3SetDebugLogging", on, n, (const char *const *)categories);
}

static Instance *make(const char *function, int type, fmi3String name, fmi3String token, bool logging,
                      fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    Instance *I;
    Callbacks *callbacks;
    if (!token || strcmp(token, TOKEN)) {
        char text[128];
        snprintf(text, sizeof text, "%s: the instantiation token is not this FMU's", function);
        if (log) log(environment, fmi3Error, "logStatusError", text);
        return NULL;
    }
    I = core_new(name, type, say, logging);
    callbacks = calloc(1, sizeof *callbacks);
    if (!I || !callbacks) {
        free(callbacks);
        core_free(I);
        return NULL;
    }
    callbacks->log = log;
    I->callbacks = callbacks;
    I->environment = environment;
    return I;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    (void)resources;
    (void)visible;
    return make("fmi3InstantiateModelExchange", MODEL_EXCHANGE, name, token, logging, environment, log);
}

static int only_inputs(Instance *I, const fmi3ValueReference vr[], size_t n) {
    Scalars scalars;
    size_t i;
    if (!scalars_of(I, "fmi3InstantiateCoSimulation", vr, n, &scalars)) return 0;
    for (i = 0; i < scalars.n; i++)
        if (!(settable(scalars.references[i]) & UPDATE)) break;
    free_scalars(&scalars);
    if (i == scalars.n) return 1;
    core_fail(I, "fmi3InstantiateCoSimulation", "an intermediate variable that is no input");
    return 0;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    Instance *I;
    (void)resources;
    (void)visible;
    if (events && !NE) {
        if (log) log(environment, fmi3Error, "logStatusError", "fmi3InstantiateCoSimulation: there is no event mode");
        return NULL;
    }
    I = make("fmi3InstantiateCoSimulation", CO_SIMULATION, name, token, logging, environment, log);
    if (!I) return NULL;
    I->data.event_mode = events;
    if (!only_inputs(I, required, n)) {
        fmi3FreeInstance(I);
        return NULL;
    }
    ((Callbacks *)I->callbacks)->update = update;
    ((Callbacks *)I->callbacks)->early = early;
    return I;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                               fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                               fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock,
                                               fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)clock;
    (void)lock;
    (void)unlock;
    if (log) log(environment, fmi3Error, "logStatusError", "fmi3InstantiateScheduledExecution: not supported");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance) {
    Instance *I = instance;
    if (!I || I->magic != MAGIC) return;
    free(I->callbacks);
    core_free(I);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop) {
    REQUIRE(INSTANTIATED, "fmi3EnterInitializationMode");
    (void)has_tolerance;
    (void)tolerance;
    if (core_start(I, "fmi3EnterInitializationMode", start, has_stop, stop) != OK) return fmi3Error;
    I->data.mode = INITIALIZATION;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    REQUIRE(INITIALIZATION, "fmi3ExitInitializationMode");
    core_begin(I);
    I->data.mode = I->data.type == MODEL_EXCHANGE || I->data.event_mode ? EVENT : STEP;
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance) {
    REQUIRE(CONTINUOUS | (instance && ((Instance *)instance)->data.event_mode ? STEP : 0), "fmi3EnterEventMode");
    core_enter_event(I);
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance) {
    REQUIRE(RUNNING, "fmi3Terminate");
    I->data.mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance) {
    REQUIRE(OUTSIDE, "fmi3Reset");
    core_reset(I);
    return fmi3OK;
}

/* --- values ---------------------------------------------------------------------------------------- */

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[], size_t nv) {
    Scalars scalars;
    Status status = ERROR;
    REQUIRE(ANY, "fmi3GetFloat64");
    if (!scalars_of(I, "fmi3GetFloat64", vr, n, &scalars)) return fmi3Error;
    if (matches(I, "fmi3GetFloat64", &scalars, nv))
        status = core_get(I, "fmi3GetFloat64", scalars.references, scalars.n, values);
    free_scalars(&scalars);
    return (fmi3Status)status;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                          size_t nv) {
    Scalars scalars;
    Status status = ERROR;
    REQUIRE(INSTANTIATED | INITIALIZATION | RUNNING | UPDATE, "fmi3SetFloat64");
    if (!scalars_of(I, "fmi3SetFloat64", vr, n, &scalars)) return fmi3Error;
    if (matches(I, "fmi3SetFloat64", &scalars, nv))
        status = core_set(I, "fmi3SetFloat64", scalars.references, scalars.n, values);
    free_scalars(&scalars);
    return (fmi3Status)status;
}

static fmi3Status none_of(fmi3Instance instance, const char *function, const fmi3ValueReference vr[], size_t n) {
    REQUIRE(ANY, function);
    if (!n) return fmi3OK;
    return (fmi3Status)core_fail(I, function, "no variable of this type with value reference %u", vr ? (unsigned)vr[0] : 0u);
}

#define NO_VARIABLES(type)                                                                                              \
    fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3##type values[],       \
                             size_t nv) {                                                                               \
        (void)values;                                                                                                   \
        (void)nv;                                                                                                       \
        return none_of(instance, "fmi3Get" #type, vr, n);                                                               \
    }                                                                                                                   \
    fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3##type values[], \
                             size_t nv) {                                                                               \
        (void)values;                                                                                                   \
        (void)nv;                                                                                                       \
        return none_of(instance, "fmi3Set" #type, vr, n);                                                               \
    }

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, size_t sizes[], fmi3Binary values[],
                         size_t nv) {
    (void)sizes;
    (void)values;
    (void)nv;
    return none_of(instance, "fmi3GetBinary", vr, n);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary values[], size_t nv) {
    (void)sizes;
    (void)values;
    (void)nv;
    return none_of(instance, "fmi3SetBinary", vr, n);
}

/* --- whether limits are passed, and the two clocks ----------------------------------------------------- */

enum { LIMIT_CLOCK = CLOCKS, RUN_CLOCK };

/* Nonzero, and said, where a reference is not one of a range. */
static int outside(Instance *I, const char *function, const fmi3ValueReference vr[], size_t n, const void *values,
                   uint32_t first, uint32_t last) {
    size_t i;
    if (n && (!vr || !values)) return core_fail(I, function, "null pointer");
    for (i = 0; i < n; i++)
        if (!NE || vr[i] < first || vr[i] > last)
            return core_fail(I, function, "no variable of this type with value reference %u", (unsigned)vr[i]);
    return 0;
}

fmi3Status fmi3GetBoolean(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Boolean values[], size_t nv) {
    Scalars scalars;
    fmi3Status status = fmi3Error;
    size_t i;
    REQUIRE(ANY, "fmi3GetBoolean");
    if (!scalars_of(I, "fmi3GetBoolean", vr, n, &scalars)) return fmi3Error;
    if (matches(I, "fmi3GetBoolean", &scalars, nv) &&
        !outside(I, "fmi3GetBoolean", scalars.references, scalars.n, values, CROSSED, CLOCKS - 1)) {
        for (i = 0; i < scalars.n; i++) values[i] = core_crossed(I, (int)(scalars.references[i] - CROSSED));
        status = fmi3OK;
    }
    free_scalars(&scalars);
    return status;
}

fmi3Status fmi3SetBoolean(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Boolean values[], size_t nv) {
    (void)values;
    (void)nv;
    return none_of(instance, "fmi3SetBoolean", vr, n);
}

/* Active from the event's begin to fmi3UpdateDiscreteStates. */
fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, fmi3Clock values[]) {
    size_t i;
    REQUIRE(EVENT, "fmi3GetClock");
    if (outside(I, "fmi3GetClock", vr, n, values, LIMIT_CLOCK, RUN_CLOCK)) return fmi3Error;
    for (i = 0; i < n; i++) values[i] = (vr[i] == LIMIT_CLOCK ? I->data.ticks : I->data.begins) != 0;
    return fmi3OK;
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Clock values[]) {
    size_t i;
    REQUIRE(EVENT, "fmi3SetClock");
    if (outside(I, "fmi3SetClock", vr, n, values, RUN_CLOCK, RUN_CLOCK)) return fmi3Error;
    for (i = 0; i < n; i++) I->data.begins |= values[i];
    return fmi3OK;
}

/* --- not there: said, never a crash ------------------------------------------------------------------ */

static fmi3Status absent(fmi3Instance instance, const char *function, const char *what) {
    REQUIRE(ANY, function);
    return (fmi3Status)core_fail(I, function, "%s", what);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference vr, size_t *n) {
    (void)vr;
    (void)n;
    return absent(instance, "fmi3GetNumberOfVariableDependencies", "see ModelStructure; nothing is said of single elements");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t of[], fmi3DependencyKind kinds[], size_t n) {
    (void)dependent;
    (void)elements;
    (void)independents;
    (void)of;
    (void)kinds;
    (void)n;
    return absent(instance, "fmi3GetVariableDependencies", "see ModelStructure; nothing is said of single elements");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
    return absent(instance, "fmi3EnterConfigurationMode", "there are no structural parameters");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
    return absent(instance, "fmi3ExitConfigurationMode", "there are no structural parameters");
}

#define NO_CLOCK_ARRAYS(name, ...)                                                                     \
    fmi3Status name(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, __VA_ARGS__) {     \
        return none_of(instance, #name, vr, n);                                                        \
    }

#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
NO_CLOCK_ARRAYS(fmi3GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NO_CLOCK_ARRAYS(fmi3GetIntervalFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NO_CLOCK_ARRAYS(fmi3GetShiftDecimal, fmi3Float64 shifts[])
NO_CLOCK_ARRAYS(fmi3GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NO_CLOCK_ARRAYS(fmi3SetIntervalDecimal, const fmi3Float64 intervals[])
NO_CLOCK_ARRAYS(fmi3SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NO_CLOCK_ARRAYS(fmi3SetShiftDecimal, const fmi3Float64 shifts[])
NO_CLOCK_ARRAYS(fmi3SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
#if defined(__GNUC__) || defined(__clang__)
#pragma GCC diagnostic pop
#endif

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time) {
    (void)clock;
    (void)time;
    return absent(instance, "fmi3ActivateModelPartition", "there is no scheduled execution");
}

/* --- state of the component ------------------------------------------------------------------------ */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state) {
    REQUIRE(OUTSIDE, "fmi3GetFMUState");
    return (fmi3Status)core_save(I, "fmi3GetFMUState", state);
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
    REQUIRE(OUTSIDE, "fmi3SetFMUState");
    return (fmi3Status)core_restore(I, "fmi3SetFMUState", state);
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state) {
    REQUIRE(OUTSIDE, "fmi3FreeFMUState");
    return (fmi3Status)core_drop(I, "fmi3FreeFMUState", state);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size) {
    REQUIRE(OUTSIDE, "fmi3SerializedFMUStateSize");
    return (fmi3Status)core_serialized_size(I, "fmi3SerializedFMUStateSize", state, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    REQUIRE(OUTSIDE, "fmi3SerializeFMUState");
    return (fmi3Status)core_serialize(I, "fmi3SerializeFMUState", state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    REQUIRE(OUTSIDE, "fmi3DeserializeFMUState");
    return (fmi3Status)core_deserialize(I, "fmi3DeserializeFMUState", bytes, size, state);
}

typedef Status (*Derivative)(Instance *, const char *, const uint32_t *, size_t, const uint32_t *, size_t, const double *, double *);

/* Seeds and results are one for each scalar; `of_unknowns` says whether there is a seed for each of the unknowns. */
static fmi3Status derivative(Instance *I, const char *function, Derivative call, int of_unknowns, const fmi3ValueReference unknowns[],
                             size_t nu, const fmi3ValueReference knowns[], size_t nk, const fmi3Float64 seed[], size_t ns,
                             fmi3Float64 result[], size_t nr) {
    Scalars first, second;
    Status status = ERROR;
    if (!scalars_of(I, function, unknowns, nu, &first)) return fmi3Error;
    if (scalars_of(I, function, knowns, nk, &second)) {
        if (matches(I, function, &first, of_unknowns ? ns : nr) && matches(I, function, &second, of_unknowns ? nr : ns))
            status = call(I, function, first.references, first.n, second.references, second.n, seed, result);
        free_scalars(&second);
    }
    free_scalars(&first);
    return (fmi3Status)status;
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nu,
                                        const fmi3ValueReference knowns[], size_t nk, const fmi3Float64 seed[], size_t ns,
                                        fmi3Float64 result[], size_t nr) {
    REQUIRE(INITIALIZATION | RUNNING | TERMINATED, "fmi3GetDirectionalDerivative");
    return derivative(I, "fmi3GetDirectionalDerivative", core_forward, 0, unknowns, nu, knowns, nk, seed, ns, result, nr);
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nu,
                                    const fmi3ValueReference knowns[], size_t nk, const fmi3Float64 seed[], size_t ns,
                                    fmi3Float64 result[], size_t nr) {
    REQUIRE(INITIALIZATION | RUNNING | TERMINATED, "fmi3GetAdjointDerivative");
    return derivative(I, "fmi3GetAdjointDerivative", core_reverse, 1, unknowns, nu, knowns, nk, seed, ns, result, nr);
}

/* --- Model Exchange -------------------------------------------------------------------------------- */

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) {
    REQUIRE(INITIALIZATION | EVENT, "fmi3EvaluateDiscreteStates");
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *timed, fmi3Float64 *time) {
    int jumps;
    REQUIRE(EVENT, "fmi3UpdateDiscreteStates");
    if (again) *again = fmi3False;
    if (end) *end = fmi3False;
    if (nominals) *nominals = fmi3False;
    jumps = core_update(I);
    if (values) *values = jumps;
    if (timed) *timed = fmi3False;
    if (time) *time = 0;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
    REQUIRE_ONE(MODEL_EXCHANGE, EVENT, "fmi3EnterContinuousTimeMode");
    I->data.mode = CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean no_return, fmi3Boolean *event, fmi3Boolean *end) {
    REQUIRE(CONTINUOUS, "fmi3CompletedIntegratorStep");
    (void)no_return;
    if (event) *event = fmi3False;
    if (end) *end = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) {
    REQUIRE_ONE(MODEL_EXCHANGE, EVENT | CONTINUOUS, "fmi3SetTime");
    if (!isfinite(time)) return (fmi3Status)core_fail(I, "fmi3SetTime", "%g refused", time);
    I->data.time = time;
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 x[], size_t n) {
    REQUIRE_ONE(MODEL_EXCHANGE, SET_STATES, "fmi3SetContinuousStates");
    return (fmi3Status)core_set_states(I, "fmi3SetContinuousStates", x, n);
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 rates[], size_t n) {
    REQUIRE_ONE(MODEL_EXCHANGE, OUTSIDE & ~INSTANTIATED, "fmi3GetContinuousStateDerivatives");
    return (fmi3Status)core_rates(I, "fmi3GetContinuousStateDerivatives", rates, n);
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 indicators[], size_t n) {
    REQUIRE_ONE(MODEL_EXCHANGE, OUTSIDE & ~INSTANTIATED, "fmi3GetEventIndicators");
    return (fmi3Status)core_indicators(I, "fmi3GetEventIndicators", indicators, n);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 x[], size_t n) {
    REQUIRE_ONE(MODEL_EXCHANGE, OUTSIDE & ~INSTANTIATED, "fmi3GetContinuousStates");
    if (n != NX || !x) return (fmi3Status)core_fail(I, "fmi3GetContinuousStates", "there are %d states", NX);
    memcpy(x, I->data.x, NX * sizeof(double));
    return fmi3OK;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t n) {
    size_t i;
    REQUIRE_ONE(MODEL_EXCHANGE, OUTSIDE, "fmi3GetNominalsOfContinuousStates");
    if (n != NX || !nominals) return (fmi3Status)core_fail(I, "fmi3GetNominalsOfContinuousStates", "there are %d states", NX);
    for (i = 0; i < n; i++) nominals[i] = NOMINAL;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n) {
    REQUIRE_ONE(MODEL_EXCHANGE, OUTSIDE, "fmi3GetNumberOfEventIndicators");
    if (!n) return (fmi3Status)core_fail(I, "fmi3GetNumberOfEventIndicators", "null pointer");
    *n = NE;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n) {
    REQUIRE_ONE(MODEL_EXCHANGE, OUTSIDE, "fmi3GetNumberOfContinuousStates");
    if (!n) return (fmi3Status)core_fail(I, "fmi3GetNumberOfContinuousStates", "null pointer");
    *n = NX;
    return fmi3OK;
}

/* --- Co-Simulation --------------------------------------------------------------------------------- */

fmi3Status fmi3EnterStepMode(fmi3Instance instance) {
    REQUIRE_ONE(CO_SIMULATION, EVENT, "fmi3EnterStepMode");
    I->data.mode = STEP;
    return fmi3OK;
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference vr[], size_t n, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nv) {
    Scalars scalars;
    Status status = ERROR;
    REQUIRE_ONE(CO_SIMULATION, STEP | UPDATE | TERMINATED, "fmi3GetOutputDerivatives");
    if (core_orders(I, "fmi3GetOutputDerivatives", orders, n) != OK) return fmi3Error;
    if (!scalars_of(I, "fmi3GetOutputDerivatives", vr, n, &scalars)) return fmi3Error;
    if (matches(I, "fmi3GetOutputDerivatives", &scalars, nv))
        status = core_output_slopes(I, "fmi3GetOutputDerivatives", scalars.references, scalars.n, values);
    free_scalars(&scalars);
    return (fmi3Status)status;
}

/* The importer gives its inputs at the end of an inner step, before it is made: the inputs go there in a straight line. */
static void ask(Instance *I, double time) {
    Callbacks *callbacks = I->callbacks;
    bool end = false;
    double at = time;
    I->data.mode = UPDATE;
    callbacks->update(I->environment, time, true, false, false, false, &end, &at);
    I->data.mode = STEP;
}

static int show(Instance *I, double time) {
    Callbacks *callbacks = I->callbacks;
    bool end = false;
    double at = time;
    I->data.mode = UPDATE;
    callbacks->update(I->environment, time, false, true, true, callbacks->early, &end, &at);
    I->data.mode = STEP;
    if (callbacks->early && end && at < callbacks->return_at) callbacks->return_at = at;
    return time >= callbacks->return_at;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 from, fmi3Float64 step, fmi3Boolean no_return, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    Hooks hooks = {NULL, NULL, 0};
    double time;
    Callbacks *callbacks;
    Status status;
    REQUIRE(STEP, "fmi3DoStep");
    (void)no_return;
    callbacks = I->callbacks;
    hooks.early = callbacks->early;
    if (callbacks->update) hooks.before = ask, hooks.after = show;
    callbacks->return_at = INFINITY;
    time = I->data.time;
    status = core_step(I, "fmi3DoStep", from, step, &hooks, &time);
    if (event) *event = status == OK && I->data.waiting;
    if (terminate) *terminate = fmi3False;
    if (early) *early = status == OK && time < from + step;
    if (reached) *reached = time;
    return (fmi3Status)status;
}
