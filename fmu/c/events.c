/* Events: a temperature passes its limit or comes back, a run begins. Without limits to watch (NE is 0) there are none. */

/* K. A limit that is passed counts so until the temperature is this much below it: no sensor resolves it, and a temperature
   that rests at its limit makes no events without end. Half of it is left to importers to miss the instant by. */
#define HYSTERESIS 1e-3

/* Changes sign where an event is due: what is left to the limit [K], or to the end of the hysteresis behind it. */
static double core_indicator(const Instance *I, int limit) {
    return I->data.p[LIMITS + limit] - I->data.x[limit] - (I->data.crossed[limit] ? HYSTERESIS : 0);
}

/* Whether an event of a limit is due: it is passed and does not count so yet, or the other way round. */
static int core_due(const Instance *I, int limit) {
    double left = core_indicator(I, limit);
    return I->data.crossed[limit] ? left >= 0 : left <= 0;
}

static int core_any_due(const Instance *I) {
    int i;
    for (i = 0; i < NE; i++)
        if (core_due(I, i)) return 1;
    return 0;
}

/* Whether a limit counts as passed; before the start it is what the start values say. */
static int core_crossed(const Instance *I, int limit) {
    if (I->data.mode & (INSTANTIATED | INITIALIZATION)) return I->data.x[limit] >= I->data.p[LIMITS + limit];
    return I->data.crossed[limit] != 0;
}

static void core_begin(Instance *I) {
    int i;
    memcpy(I->data.begun, I->data.x, sizeof I->data.begun);
    for (i = 0; i < NE; i++) I->data.crossed[i] = I->data.x[i] >= I->data.p[LIMITS + i];
}

/* All limits anew, decided in the middle of the hysteresis: an importer finds the instant to its own tolerance, on either
   side. Nonzero where one changed. */
static int core_decide(Instance *I) {
    int i, changed = 0;
    for (i = 0; i < NE; i++) {
        int64_t crossed = I->data.x[i] >= I->data.p[LIMITS + i] - HYSTERESIS / 2;
        changed |= crossed != I->data.crossed[i];
        I->data.crossed[i] = crossed;
    }
    return changed;
}

static void core_enter_event(Instance *I) {
    I->data.mode = EVENT;
    I->data.waiting = 0;
    I->data.ticks = core_decide(I);
}

/* The end of an event's iteration. Nonzero where the states jump: a run begins, as warm as the first one. */
static int core_update(Instance *I) {
    int begins = I->data.begins != 0;
    if (begins) memcpy(I->data.x, I->data.begun, sizeof I->data.x);
    if (begins) core_forget(I);
    core_decide(I);
    I->data.ticks = I->data.begins = 0;
    return begins;
}

static Status core_indicators(Instance *I, const char *function, double *values, size_t n) {
    int i;
    if (n != NE || (n && !values)) return core_fail(I, function, "there are %d event indicators", NE);
    for (i = 0; i < NE; i++) values[i] = core_indicator(I, i);
    return OK;
}
