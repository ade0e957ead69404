/* Arrays: a value reference behind those of the scalars stands for several of them. Without arrays (NA is 0) all are scalars. */

#define VARIABLES (CLOCKS + (NE ? 2 : 0)) /* scalars: their value references lie below */

/* The scalars that references stand for. */
typedef struct {
    const uint32_t *references;
    uint32_t *many; /* where the few are not enough */
    size_t n;
    uint32_t few[64]; /* no memory is asked for where these are enough */
} Scalars;

static void free_scalars(Scalars *scalars) { free(scalars->many); }

#if NA
static int is_array(uint32_t reference) { return reference >= VARIABLES && reference - VARIABLES < NA; }

/* Zero, and said, where a reference is an array's element or there is no memory; else `free_scalars` when they are done with. */
static int scalars_of(Instance *I, const char *function, const fmi3ValueReference vr[], size_t n, Scalars *scalars) {
    size_t i, k = 0, count = 0;
    uint32_t *found = scalars->few;
    scalars->many = NULL;
    if (n && !vr) return core_fail(I, function, "null pointer"), 0;
    for (i = 0; i < n; i++) {
        if (vr[i] < VARIABLES && IN_ARRAY[vr[i]])
            return core_fail(I, function, "%s (%u) is an array's element", NAMES[vr[i]], (unsigned)vr[i]), 0;
        count += is_array(vr[i]) ? FIRSTS[vr[i] - VARIABLES + 1] - FIRSTS[vr[i] - VARIABLES] : 1;
    }
    if (count > sizeof scalars->few / sizeof *scalars->few) found = scalars->many = malloc(count * sizeof *found);
    if (!found) return core_fail(I, function, "out of memory"), 0;
    for (i = 0; i < n; i++) {
        uint32_t from, end;
        if (!is_array(vr[i])) {
            found[k++] = vr[i];
            continue;
        }
        from = FIRSTS[vr[i] - VARIABLES];
        end = FIRSTS[vr[i] - VARIABLES + 1];
        while (from < end) found[k++] = ELEMENTS[from++];
    }
    scalars->references = found;
    scalars->n = count;
    return 1;
}
#else
static int scalars_of(Instance *I, const char *function, const fmi3ValueReference vr[], size_t n, Scalars *scalars) {
    scalars->many = NULL;
    scalars->references = vr;
    scalars->n = n;
    if (n && !vr) return core_fail(I, function, "null pointer"), 0;
    return 1;
}
#endif

/* Zero, and said, where there are not as many values as scalars. */
static int matches(Instance *I, const char *function, const Scalars *scalars, size_t values) {
    if (scalars->n == values) return 1;
    core_fail(I, function, "%u scalars, %u values", (unsigned)scalars->n, (unsigned)values);
    return 0;
}
