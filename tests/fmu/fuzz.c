/* Random legal and illegal call sequences against an exported FMU's own sources, compiled in; run under valgrind or sanitizers.
   Usage: fuzz SEQUENCES SEED. Fails where a refused call changed anything, or where nothing but refusals happens. */
#if FMI == 2
#include "fmi2.c"
#else
#include "fmi3.c"
#endif

static uint64_t seed_state;
static unsigned long calls, refusals, logged;

static uint32_t any(uint32_t n) {
    seed_state = seed_state * 6364136223846793005ull + 1442695040888963407ull;
    return (uint32_t)(seed_state >> 33) % n;
}

static double any_value(void) {
    static const double strange[] = {NAN, INFINITY, -INFINITY, 0, -1, 1e300, -1e300, 1e-300, 20, 1.7e9};
    if (any(12) == 0) return strange[any(10)];
    return any(2) ? 290.0 + any(1000) / 10.0 : any(1000) / 100.0;
}

static void any_references(uint32_t *references, double *values, size_t n) {
    size_t i;
    for (i = 0; i < n; i++) {
        references[i] = any(25) ? any(3) ? INPUTS + any(NU + NP) : any(END) : any(2) ? END + any(9 + NA) : 0xffffffffu;
        values[i] = any_value();
    }
}

#define MOST_STATES 4
static void *states[MOST_STATES];

#if FMI == 2
static void hear(fmi2ComponentEnvironment e, fmi2String name, fmi2Status s, fmi2String category, fmi2String text, ...) {
    (void)e, (void)name, (void)s, (void)category;
    logged += strlen(text) > 0;
}
static const fmi2CallbackFunctions callbacks = {hear, calloc, free, NULL, NULL};
typedef fmi2Status Result;
#define CALL(name) fmi2##name
#define SIZED(n)
#define GET CALL(GetReal)
#define SET CALL(SetReal)
#define SAVE CALL(GetFMUstate)
#define RESTORE CALL(SetFMUstate)
#define DROP CALL(FreeFMUstate)
#define SIZE CALL(SerializedFMUstateSize)
#define WRITE CALL(SerializeFMUstate)
#define READ CALL(DeSerializeFMUstate)
#define RATES_OF CALL(GetDerivatives)
#define OUTPUT_SLOPES CALL(GetRealOutputDerivatives)
typedef char Byte;
#else
static void hear(fmi3InstanceEnvironment e, fmi3Status s, fmi3String category, fmi3String text) {
    (void)e, (void)s, (void)category;
    logged += strlen(text) > 0;
}
static Instance *updated;
static void update(fmi3InstanceEnvironment e, double time, bool asked, bool shown, bool done, bool may, bool *end, double *at) {
    uint32_t references[3];
    double values[3];
    (void)e, (void)asked, (void)shown, (void)done;
    any_references(references, values, 3);
    fmi3SetFloat64(updated, references, 3, values, 3);
    fmi3GetFloat64(updated, references, 3, values, 3);
    if (!any(4)) fmi3Reset(updated); /* not allowed here */
    if (may && !any(5)) *end = true, *at = time;
}
typedef fmi3Status Result;
#define CALL(name) fmi3##name
#define SIZED(n) , n
#define GET CALL(GetFloat64)
#define SET CALL(SetFloat64)
#define SAVE CALL(GetFMUState)
#define RESTORE CALL(SetFMUState)
#define DROP CALL(FreeFMUState)
#define SIZE CALL(SerializedFMUStateSize)
#define WRITE CALL(SerializeFMUState)
#define READ CALL(DeserializeFMUState)
#define RATES_OF CALL(GetContinuousStateDerivatives)
#define OUTPUT_SLOPES CALL(GetOutputDerivatives)
typedef fmi3Byte Byte;
#endif

static void *fresh(void) {
    const char *token = any(20) ? TOKEN : any(2) ? "wrong" : NULL;
    const char *name = any(30) ? "fuzz" : NULL;
#if FMI == 2
    int type = any(40) ? (int)any(2) : 7;
    return fmi2Instantiate(name, (fmi2Type)type, token, "file:///", any(30) ? &callbacks : NULL, 0, any(2));
#else
    uint32_t required[] = {INPUTS, any(10) ? PARAMETERS : END + any(NA + 9)};
    if (!any(40)) return fmi3InstantiateScheduledExecution(name, token, "", 0, 1, NULL, hear, NULL, NULL, NULL);
    if (any(2)) return fmi3InstantiateModelExchange(name, token, "", 0, any(2), NULL, any(9) ? hear : NULL);
    return fmi3InstantiateCoSimulation(name, token, "", 0, any(2), any(NE ? 2 : 20) == 0, any(2), required, any(3), NULL, hear, any(2) ? update : NULL);
#endif
}

static int wild; /* values that are none came with status OK */

static Result finite(Result result, const double *values, size_t n) {
    while (n--) wild |= result <= 1 && !isfinite(values[n]);
    return result;
}

static Result log_call(void *c) {
    const char *categories[] = {"logStatusWarning", "logStatusDiscard", "logStatusError", "logEvents", NULL};
    const char *chosen[3];
    size_t i, n = any(4);
    for (i = 0; i < n; i++) chosen[i] = categories[any(any(9) ? 3 : 5)];
    return CALL(SetDebugLogging)(c, any(2), n, any(30) ? chosen : NULL);
}

static Result values_call(void *c, uint32_t *r, double *v, size_t n) {
    int orders[8] = {1, 1, 1, 1, 1, 1, 1, 1};
    double result[8];
    uint32_t other[8];
    any_references(other, result, 8);
    if (!any(9)) orders[any(8)] = (int)any(4);
    switch (any(8)) {
        case 0: case 1: return SET(c, r, n, v SIZED(any(30) ? n : n + 1));
        case 2: case 3: return finite(GET(c, r, n, v SIZED(any(30) ? n : n + 1)), v, n);
        case 4: return SET(c, any(2) ? NULL : r, n, any(2) ? NULL : v SIZED(n));
        case 5: return OUTPUT_SLOPES(c, r, n, orders, v SIZED(n));
        case 6:
#if FMI == 2
            return fmi2SetRealInputDerivatives(c, r, n, orders, v);
#else
            return fmi3GetAdjointDerivative(c, r, n, other, 8, v, n, result, any(9) ? 8 : 7);
#endif
        default:
#if FMI == 2
            return fmi2GetDirectionalDerivative(c, other, 8, r, n, v, result);
#else
            return fmi3GetDirectionalDerivative(c, other, 8, r, n, v, n, result, any(9) ? 8 : 7);
#endif
    }
}

static Result state_call(void *c) {
    static Byte bytes[sizeof(Header) + sizeof(Data)];
    void **slot = &states[any(MOST_STATES)];
    static int nothing;
    size_t size = 0;
    switch (any(8)) {
        case 0: case 1: return SAVE(c, slot);
        case 2: return RESTORE(c, any(6) ? *slot : any(2) ? NULL : &nothing);
        case 3: return DROP(c, any(9) ? slot : NULL);
        case 4: return SIZE(c, *slot, any(9) ? &size : NULL);
        case 5: return WRITE(c, *slot, bytes, any(4) ? sizeof bytes : any(sizeof bytes));
        case 6:
            if (!any(3)) bytes[any(sizeof bytes)] ^= 1;
            return READ(c, bytes, any(5) ? sizeof bytes : any(sizeof bytes), slot);
        default: return READ(c, NULL, 0, slot);
    }
}

static Result life_call(void *c) {
#if FMI == 2
    fmi2EventInfo info;
    fmi2Boolean event, end, crossed[2];
    fmi2ValueReference limits[2] = {CROSSED + any(NE + 2), CROSSED};
    fmi2Integer integer = 0;
    fmi2String text;
    switch (any(14)) {
        case 0: return fmi2SetupExperiment(c, 0, 0, any(9) ? 0 : any_value(), !any(4), any_value());
        case 1: case 2: return fmi2EnterInitializationMode(c);
        case 3: case 4: return fmi2ExitInitializationMode(c);
        case 5: return fmi2EnterEventMode(c);
        case 6: case 7: return fmi2EnterContinuousTimeMode(c);
        case 8: return fmi2NewDiscreteStates(c, &info);
        case 9: return fmi2CompletedIntegratorStep(c, 0, &event, &end);
        case 10: return any(4) ? fmi2OK : fmi2Terminate(c);
        case 11: return any(4) ? fmi2OK : fmi2Reset(c);
        case 12: return log_call(c);
        default:
            fmi2GetInteger(c, NULL, 0, &integer);
            fmi2CancelStep(c);
            fmi2GetBoolean(c, limits, any(3), any(9) ? crossed : NULL);
            fmi2GetStringStatus(c, fmi2PendingStatus, &text);
            return fmi2SetInteger(c, NULL, 1, &integer);
    }
#else
    bool flags[5], many[2 * SPACE_E];
    double time;
    size_t n;
    uint32_t limits[2] = {CROSSED + any(NE + 4 + NA), CROSSED}, clock = CLOCKS + any(3);
    flags[0] = any(2);
    switch (any(20)) {
        case 0: case 1: case 2: return fmi3EnterInitializationMode(c, 0, 0, any(9) ? 0 : any_value(), !any(4), any_value());
        case 3: case 4: return fmi3ExitInitializationMode(c);
        case 5: return fmi3EnterEventMode(c);
        case 6: case 7: return fmi3EnterContinuousTimeMode(c);
        case 8: return fmi3UpdateDiscreteStates(c, flags, flags + 1, flags + 2, flags + 3, flags + 4, &time);
        case 9: return fmi3CompletedIntegratorStep(c, 0, flags, flags + 1);
        case 10: return any(4) ? fmi3OK : fmi3Terminate(c);
        case 11: return any(4) ? fmi3OK : fmi3Reset(c);
        case 12: return log_call(c);
        case 13: return fmi3GetNumberOfContinuousStates(c, any(3) ? &n : NULL);
        case 14: return fmi3EnterConfigurationMode(c);
        case 15: case 16: return fmi3EnterStepMode(c);
        case 17: return fmi3SetClock(c, any(9) ? &clock : NULL, 1, flags);
        case 18: return fmi3GetClock(c, &clock, any(2), flags);
        default:
            fmi3GetInt32(c, NULL, 0, NULL, 0);
            fmi3GetClock(c, NULL, 1, NULL);
            n = any(3);
            fmi3GetBoolean(c, limits, n, any(9) ? many : NULL, any(2) ? n : n * SPACE_E);
            fmi3SetBoolean(c, limits, n, many, n);
            fmi3EvaluateDiscreteStates(c);
            fmi3GetShiftDecimal(c, NULL, 1, NULL);
            return fmi3ActivateModelPartition(c, 0, 0);
    }
#endif
}

static Result motion_call(void *c) {
    double x[NX + 1], from = c && any(6) ? ((Instance *)c)->data.time : any_value(), step = any(6) ? 0.01 * (1 + any(300)) : any_value();
    int i;
#if FMI == 3
    bool event, terminate, early;
    double reached;
#endif
    for (i = 0; i <= NX; i++) x[i] = any(40) ? 300.0 + any(50) : any_value();
    switch (any(6)) {
        case 0: return CALL(SetContinuousStates)(c, any(20) ? x : NULL, NX + (any(20) == 0));
        case 1: return CALL(GetContinuousStates)(c, x, NX + (any(20) == 0));
        case 2: return RATES_OF(c, x, NX + (any(20) == 0));
        case 3: return CALL(SetTime)(c, any_value());
        default:
            if (c && !any(6)) from += any(2) ? step : 1e-9 * step; /* a gap, or a rounding */
            if (step > 1e3) step = 1e3; /* a legal step of 1e300 s is refused; one of 1e7 s takes long under valgrind */
#if FMI == 2
            return fmi2DoStep(c, from, step, 1);
#else
            updated = c;
            return fmi3DoStep(c, from, step, 1, &event, &terminate, &early, &reached);
#endif
    }
}

static Result any_call(void *c) {
    uint32_t references[8];
    double values[8];
    size_t n = any(9);
    any_references(references, values, n);
    switch (any(5)) {
        case 0: return values_call(c, references, values, n);
        case 1: return state_call(c);
        case 2: return motion_call(c);
        default: return life_call(c);
    }
}

static int sequence(void) {
    Instance *I = fresh();
    Data before;
    unsigned n = 5 + any(60);
    memset(states, 0, sizeof states);
    if (!I) { /* without an instance no call does anything, and none crashes */
        while (n--) any_call(NULL);
        return 0;
    }
    while (n--) {
        Result result;
        before = I->data;
        result = any_call(I);
        calls++;
        refusals += result > 1;
        if (wild) return 2;
        if (result > 1 && memcmp(&before, &I->data, sizeof before)) return 1;
    }
    /* Some states are left to the instance, which must free them. */
    if (any(2)) DROP(I, &states[0]);
    CALL(FreeInstance)(I);
    return 0;
}

int main(int count, char **words) {
    long i, n = count > 1 ? atol(words[1]) : 100;
    seed_state = count > 2 ? (uint64_t)atol(words[2]) : 1;
    for (i = 0; i < n; i++)
        switch (sequence()) {
            case 1: printf("sequence %ld: a refused call changed the instance\n", i); return 1;
            case 2: printf("sequence %ld: a value that is not finite came with status OK\n", i); return 1;
            default: break;
        }
    printf("%ld sequences, %lu calls, %lu refused, %lu messages\n", n, calls, refusals, logged);
    return !(refusals && refusals < calls);
}
