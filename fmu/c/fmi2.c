/* FMI 2.0, Model Exchange and Co-Simulation, over the core. */
#include "fmi2Functions.h"

#define STATES_ONE_BY_ONE 0 /* fmi2SetReal sets no states in continuous-time mode */
#define LOG_OFF BIT(ERRORS) /* an error is no debug message */
#include "core.c"

#define RUNNING (EVENT | CONTINUOUS | STEP)
#define ANY (INSTANTIATED | INITIALIZATION | RUNNING | TERMINATED)

/* Refuse a call without a usable instance, or in a mode that does not allow it. */
#define REQUIRE(modes, name)                       \
    Instance *I = c;                               \
    if (core_refuses(I, name, modes)) return fmi2Error

/* The same for a function of one interface type. */
#define REQUIRE_ONE(type, modes, name) \
    REQUIRE(modes, name);              \
    if (core_refuses_type(I, name, type)) return fmi2Error

static void say(Instance *I, Status status, const char *category, const char *message) {
    const fmi2CallbackFunctions *callbacks = I->callbacks;
    char format[1024];
    size_t i = 0;
    if (!callbacks || !callbacks->logger) return;
    /* The text goes as the format: importers in Python can't read what stands behind it. */
    for (; *message && i + 3 < sizeof format; message++) {
        if (*message == '%') format[i++] = '%';
        format[i++] = *message;
    }
    format[i] = 0;
    callbacks->logger(I->environment, I->name, (fmi2Status)status, category, format);
}

/* --- common ---------------------------------------------------------------------------------------- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    REQUIRE(ANY, "fmi2SetDebugLogging");
    return (fmi2Status)core_set_logging(I, "fmi2SetDebugLogging", on, n, (const char *const *)categories);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    const char *wrong = NULL;
    Instance *I;
    (void)resources;
    (void)visible;
    if (!callbacks) return NULL;
    if (!name || !*name) wrong = "fmi2Instantiate: the instance has no name";
    else if (!guid || strcmp(guid, TOKEN)) wrong = "fmi2Instantiate: the GUID is not this FMU's";
    else if (type != fmi2ModelExchange && type != fmi2CoSimulation) wrong = "fmi2Instantiate: unknown type";
    if (wrong) {
        if (callbacks->logger)
            callbacks->logger(callbacks->componentEnvironment, name ? name : "", fmi2Error, "logStatusError", wrong);
        return NULL;
    }
    I = core_new(name, type == fmi2ModelExchange ? MODEL_EXCHANGE : CO_SIMULATION, say, logging);
    if (!I) return NULL;
    I->callbacks = malloc(sizeof *callbacks);
    if (!I->callbacks) return core_free(I), NULL;
    memcpy(I->callbacks, callbacks, sizeof *callbacks); /* the importer's own may be gone after this call */
    I->environment = callbacks->componentEnvironment;
    return I;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *I = c;
    if (!I || I->magic != MAGIC) return;
    free(I->callbacks);
    core_free(I);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
    REQUIRE(INSTANTIATED, "fmi2SetupExperiment");
    (void)has_tolerance;
    (void)tolerance;
    return (fmi2Status)core_start(I, "fmi2SetupExperiment", start, has_stop, stop);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    REQUIRE(INSTANTIATED, "fmi2EnterInitializationMode");
    I->data.mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    REQUIRE(INITIALIZATION, "fmi2ExitInitializationMode");
    core_begin(I);
    I->data.mode = I->data.type == MODEL_EXCHANGE ? EVENT : STEP;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    REQUIRE(RUNNING, "fmi2Terminate");
    I->data.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    REQUIRE(ANY, "fmi2Reset");
    core_reset(I);
    return fmi2OK;
}

/* --- values ---------------------------------------------------------------------------------------- */

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    REQUIRE(ANY & ~INSTANTIATED, "fmi2GetReal");
    return (fmi2Status)core_get(I, "fmi2GetReal", vr, n, values);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    REQUIRE(INSTANTIATED | INITIALIZATION | RUNNING, "fmi2SetReal");
    return (fmi2Status)core_set(I, "fmi2SetReal", vr, n, values);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean values[]) {
    size_t i;
    REQUIRE(ANY & ~INSTANTIATED, "fmi2GetBoolean");
    if (n && (!vr || !values)) return (fmi2Status)core_fail(I, "fmi2GetBoolean", "null pointer");
    for (i = 0; i < n; i++)
        if (vr[i] < CROSSED || vr[i] >= CLOCKS)
            return (fmi2Status)core_fail(I, "fmi2GetBoolean", "no Boolean variable with value reference %u", vr[i]);
    for (i = 0; i < n; i++) values[i] = core_crossed(I, (int)(vr[i] - CROSSED)) ? fmi2True : fmi2False;
    return fmi2OK;
}

/* All others are Real. */
#define NO_VARIABLES(name, type, what)                                                                        \
    fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t n, type values[]) {                \
        REQUIRE(ANY, #name);                                                                                  \
        (void)values;                                                                                         \
        if (!n) return fmi2OK;                                                                                \
        return (fmi2Status)core_fail(I, #name, "no " what " variable with value reference %u", vr ? vr[0] : 0); \
    }

NO_VARIABLES(fmi2GetInteger, fmi2Integer, "Integer")
NO_VARIABLES(fmi2GetString, fmi2String, "String")
NO_VARIABLES(fmi2SetInteger, const fmi2Integer, "Integer")
NO_VARIABLES(fmi2SetBoolean, const fmi2Boolean, "settable Boolean")
NO_VARIABLES(fmi2SetString, const fmi2String, "String")

/* --- state of the component ------------------------------------------------------------------------ */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    REQUIRE(ANY, "fmi2GetFMUstate");
    return (fmi2Status)core_save(I, "fmi2GetFMUstate", state);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    REQUIRE(ANY, "fmi2SetFMUstate");
    return (fmi2Status)core_restore(I, "fmi2SetFMUstate", state);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    REQUIRE(ANY, "fmi2FreeFMUstate");
    return (fmi2Status)core_drop(I, "fmi2FreeFMUstate", state);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    REQUIRE(ANY, "fmi2SerializedFMUstateSize");
    return (fmi2Status)core_serialized_size(I, "fmi2SerializedFMUstateSize", state, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    REQUIRE(ANY, "fmi2SerializeFMUstate");
    return (fmi2Status)core_serialize(I, "fmi2SerializeFMUstate", state, (unsigned char *)bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    REQUIRE(ANY, "fmi2DeSerializeFMUstate");
    return (fmi2Status)core_deserialize(I, "fmi2DeSerializeFMUstate", (const unsigned char *)bytes, size, state);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t nu,
                                        const fmi2ValueReference knowns[], size_t nk, const fmi2Real seed[],
                                        fmi2Real result[]) {
    REQUIRE(INITIALIZATION | RUNNING | TERMINATED, "fmi2GetDirectionalDerivative");
    return (fmi2Status)core_forward(I, "fmi2GetDirectionalDerivative", unknowns, nu, knowns, nk, seed, result);
}

/* --- Model Exchange -------------------------------------------------------------------------------- */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    REQUIRE(EVENT | CONTINUOUS, "fmi2EnterEventMode");
    core_enter_event(I);
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    REQUIRE(EVENT, "fmi2NewDiscreteStates");
    if (!info) return (fmi2Status)core_fail(I, "fmi2NewDiscreteStates", "null pointer");
    memset(info, 0, sizeof *info);
    core_update(I);
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    REQUIRE(EVENT, "fmi2EnterContinuousTimeMode");
    I->data.mode = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_return, fmi2Boolean *event, fmi2Boolean *end) {
    REQUIRE(CONTINUOUS, "fmi2CompletedIntegratorStep");
    (void)no_return;
    if (event) *event = fmi2False;
    if (end) *end = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    REQUIRE(EVENT | CONTINUOUS, "fmi2SetTime");
    if (!isfinite(time)) return (fmi2Status)core_fail(I, "fmi2SetTime", "%g refused", time);
    I->data.time = time;
    return fmi2OK;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    REQUIRE(SET_STATES, "fmi2SetContinuousStates");
    return (fmi2Status)core_set_states(I, "fmi2SetContinuousStates", x, n);
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real rates[], size_t n) {
    REQUIRE_ONE(MODEL_EXCHANGE, ANY & ~INSTANTIATED, "fmi2GetDerivatives");
    return (fmi2Status)core_rates(I, "fmi2GetDerivatives", rates, n);
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t n) {
    REQUIRE_ONE(MODEL_EXCHANGE, ANY & ~INSTANTIATED, "fmi2GetEventIndicators");
    return (fmi2Status)core_indicators(I, "fmi2GetEventIndicators", indicators, n);
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    REQUIRE_ONE(MODEL_EXCHANGE, ANY & ~INSTANTIATED, "fmi2GetContinuousStates");
    if (n != NX || !x) return (fmi2Status)core_fail(I, "fmi2GetContinuousStates", "there are %d states", NX);
    memcpy(x, I->data.x, NX * sizeof(double));
    return fmi2OK;
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t n) {
    size_t i;
    REQUIRE_ONE(MODEL_EXCHANGE, ANY, "fmi2GetNominalsOfContinuousStates");
    if (n != NX || !nominals) return (fmi2Status)core_fail(I, "fmi2GetNominalsOfContinuousStates", "there are %d states", NX);
    for (i = 0; i < n; i++) nominals[i] = NOMINAL;
    return fmi2OK;
}

/* --- Co-Simulation --------------------------------------------------------------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer orders[],
                                       const fmi2Real values[]) {
    REQUIRE_ONE(CO_SIMULATION, INSTANTIATED | INITIALIZATION | STEP, "fmi2SetRealInputDerivatives");
    return (fmi2Status)core_set_slopes(I, "fmi2SetRealInputDerivatives", vr, n, orders, values);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer orders[],
                                        fmi2Real values[]) {
    REQUIRE_ONE(CO_SIMULATION, STEP | TERMINATED, "fmi2GetRealOutputDerivatives");
    if (core_orders(I, "fmi2GetRealOutputDerivatives", orders, n) != OK) return fmi2Error;
    return (fmi2Status)core_output_slopes(I, "fmi2GetRealOutputDerivatives", vr, n, values);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real from, fmi2Real step, fmi2Boolean no_return) {
    REQUIRE(STEP, "fmi2DoStep");
    (void)no_return;
    I->last_step = core_step(I, "fmi2DoStep", from, step, NULL, &I->last_time);
    return (fmi2Status)I->last_step;
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    REQUIRE_ONE(CO_SIMULATION, ANY, "fmi2CancelStep");
    return (fmi2Status)core_fail(I, "fmi2CancelStep", "no step is under way: steps end before fmi2DoStep returns");
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    REQUIRE_ONE(CO_SIMULATION, STEP | TERMINATED, "fmi2GetStatus");
    if (!value || kind != fmi2DoStepStatus) return fmi2Discard;
    *value = (fmi2Status)I->last_step;
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    REQUIRE_ONE(CO_SIMULATION, STEP | TERMINATED, "fmi2GetRealStatus");
    if (!value || kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = I->last_time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    REQUIRE_ONE(CO_SIMULATION, STEP | TERMINATED, "fmi2GetIntegerStatus");
    (void)kind;
    (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    REQUIRE_ONE(CO_SIMULATION, STEP | TERMINATED, "fmi2GetBooleanStatus");
    if (!value || kind != fmi2Terminated) return fmi2Discard;
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    REQUIRE_ONE(CO_SIMULATION, STEP | TERMINATED, "fmi2GetStringStatus");
    (void)kind;
    (void)value;
    return fmi2Discard;
}
