/* Runs a library for 64-bit Windows on 64-bit Linux: maps it, gives it the C functions that it imports, and co-simulates.
   Usage: windows LIBRARY TOKEN STEPS INPUTS(first count) OUTPUTS(first count). Prints the outputs, then what was logged. */
#define _GNU_SOURCE
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#define WIN __attribute__((ms_abi))

static WIN void *w_calloc(size_t n, size_t size) { return calloc(n, size); }
static WIN void *w_malloc(size_t n) { return malloc(n); }
static WIN void w_free(void *p) { free(p); }
static WIN void *w_memcpy(void *a, const void *b, size_t n) { return memcpy(a, b, n); }
static WIN int w_memcmp(const void *a, const void *b, size_t n) { return memcmp(a, b, n); }
static WIN void *w_memset(void *a, int c, size_t n) { return memset(a, c, n); }
static WIN int w_strcmp(const char *a, const char *b) { return strcmp(a, b); }
static WIN char *w_strcpy(char *a, const char *b) { return strcpy(a, b); }
static WIN size_t w_strlen(const char *a) { return strlen(a); }
static WIN double w_ceil(double x) { return ceil(x); }
static WIN double w_floor(double x) { return floor(x); }
static WIN double w_exp(double x) { return exp(x); }
static WIN double w_log(double x) { return log(x); }
static WIN double w_tanh(double x) { return tanh(x); }
static WIN double w_pow(double x, double y) { return pow(x, y); }
static WIN double w_fmin(double x, double y) { return fmin(x, y); }
static WIN double w_fmax(double x, double y) { return fmax(x, y); }

/* The part of printf that the core uses: %s, %u, %d, %g and %.17g; arguments lie in slots of eight bytes. */
static WIN int w_vsprintf(unsigned long long options, char *out, size_t n, const char *format, void *locale, char *list) {
    char text[2048];
    size_t k = 0;
    (void)locale;
    if (options != 2) abort();
    while (*format && k + 400 < sizeof text) {
        char word[16];
        size_t length = 0;
        if (*format != '%') {
            text[k++] = *format++;
            continue;
        }
        do word[length++] = *format;
        while (!strchr("sudgx%", *format++) || length == 1);
        word[length] = 0;
        if (format[-1] == 's') k += (size_t)sprintf(text + k, word, *(char **)list);
        else if (format[-1] == 'g') k += (size_t)sprintf(text + k, word, *(double *)list);
        else k += (size_t)sprintf(text + k, word, *(int *)list);
        list += 8;
    }
    text[k] = 0;
    snprintf(out, n, "%s", text);
    return (int)k;
}

static const struct {
    const char *name;
    void *function;
} KNOWN[] = {
    {"calloc", w_calloc}, {"malloc", w_malloc}, {"free", w_free}, {"memcpy", w_memcpy}, {"memcmp", w_memcmp},
    {"memset", w_memset}, {"strcmp", w_strcmp}, {"strcpy", w_strcpy}, {"strlen", w_strlen}, {"ceil", w_ceil},
    {"floor", w_floor}, {"exp", w_exp}, {"log", w_log}, {"tanh", w_tanh}, {"pow", w_pow}, {"fmin", w_fmin},
    {"fmax", w_fmax}, {"__stdio_common_vsprintf", w_vsprintf}};

static uint8_t *image;
static uint32_t u32(const uint8_t *p) {
    uint32_t v;
    memcpy(&v, p, 4);
    return v;
}
static uint16_t u16(const uint8_t *p) { return (uint16_t)(p[0] | p[1] << 8); }

/* Microsoft's PE/COFF specification: sections, base relocations (directory 5), imports (1), exports (0). */
static uint8_t *load(const char *path) {
    FILE *file = fopen(path, "rb");
    static uint8_t raw[1 << 24];
    size_t size = file ? fread(raw, 1, sizeof raw, file) : 0;
    uint8_t *head, *optional, *section;
    int i, k, sections;
    uint64_t base, delta;
    if (size < 1024 || memcmp(raw, "MZ", 2)) return NULL;
    head = raw + u32(raw + 0x3c);
    optional = head + 24;
    if (u16(optional) != 0x20b || u32(optional + 16)) return NULL; /* 64 bits, nothing to do at the entry */
    memcpy(&base, optional + 24, 8);
    image = mmap(NULL, u32(optional + 56), PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    sections = u16(head + 6);
    section = optional + u16(head + 20);
    for (i = 0; i < sections; i++, section += 40) {
        uint32_t there = u32(section + 8), stored = u32(section + 16);
        memcpy(image + u32(section + 12), raw + u32(section + 20), there < stored ? there : stored);
    }
    delta = (uint64_t)(uintptr_t)image - base;
    for (i = 0; i < (int)u32(optional + 112 + 44); i += (int)u32(image + u32(optional + 112 + 40) + i + 4)) {
        uint8_t *block = image + u32(optional + 112 + 40) + i;
        for (k = 8; k < (int)u32(block + 4); k += 2)
            if (u16(block + k) >> 12 == 10) *(uint64_t *)(image + u32(block) + (u16(block + k) & 0xfff)) += delta;
    }
    for (i = 0; u32(image + u32(optional + 120) + i); i += 20) {
        uint8_t *entry = image + u32(optional + 120) + i;
        uint64_t *names = (uint64_t *)(image + u32(entry)), *slots = (uint64_t *)(image + u32(entry + 16));
        for (; *names; names++, slots++) {
            const char *name = (const char *)(image + *names + 2);
            size_t at;
            for (at = 0; at < sizeof KNOWN / sizeof *KNOWN && strcmp(KNOWN[at].name, name); at++) continue;
            if (at == sizeof KNOWN / sizeof *KNOWN) {
                fprintf(stderr, "imports %s\n", name);
                exit(3);
            }
            *slots = (uint64_t)(uintptr_t)KNOWN[at].function;
        }
    }
    return image + u32(optional + 112);
}

static void *find(const uint8_t *exports, const char *name) {
    const uint8_t *table = exports, *names = image + u32(table + 32);
    uint32_t i, n = u32(table + 24);
    for (i = 0; i < n; i++)
        if (!strcmp((char *)image + u32(names + 4 * i), name))
            return image + u32(image + u32(table + 28) + 4 * u16(image + u32(table + 36) + 2 * i));
    fprintf(stderr, "no %s\n", name);
    exit(4);
}

static WIN void hear(void *environment, int status, const char *category, const char *text) {
    (void)environment;
    printf("%d %s %s\n", status, category, text);
}

#define MOST 1000

int main(int count, char **words) {
    uint8_t *exports = count == 8 ? load(words[1]) : NULL;
    WIN void *(*make)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t, void *, void *, void *);
    WIN int (*enter)(void *, bool, double, double, bool, double), (*leave)(void *);
    WIN int (*set)(void *, const uint32_t *, size_t, const double *, size_t), (*get)(void *, const uint32_t *, size_t, double *, size_t);
    WIN int (*step)(void *, double, double, bool, bool *, bool *, bool *, double *);
    uint32_t inputs[MOST], outputs[MOST], i, nu, ny;
    double u[MOST], y[MOST], reached;
    bool event, end, early;
    long k, n;
    void *c;
    if (!exports) return 2;
    make = find(exports, "fmi3InstantiateCoSimulation");
    enter = find(exports, "fmi3EnterInitializationMode");
    leave = find(exports, "fmi3ExitInitializationMode");
    set = find(exports, "fmi3SetFloat64");
    get = find(exports, "fmi3GetFloat64");
    step = find(exports, "fmi3DoStep");
    n = atol(words[3]);
    nu = (uint32_t)atol(words[5]);
    ny = (uint32_t)atol(words[7]);
    for (i = 0; i < nu; i++) inputs[i] = (uint32_t)atol(words[4]) + i;
    for (i = 0; i < ny; i++) outputs[i] = (uint32_t)atol(words[6]) + i;
    c = make("host", words[2], "", false, true, false, false, NULL, 0, NULL, hear, NULL);
    if (!c || enter(c, false, 0, 0, false, 0) || leave(c) || get(c, inputs, nu, u, nu)) return 5;
    for (i = 0; i < nu; i++)
        if (u[i] < 200) u[i] = 1.0 + i % 5;
    if (set(c, inputs, nu, u, nu)) return 7;
    for (k = 0; k < n; k++)
        if (step(c, 0.1 * (double)k, 0.1, true, &event, &end, &early, &reached)) return 8;
    if (get(c, outputs, ny, y, ny)) return 9;
    for (i = 0; i < ny; i++) printf("%.17g\n", y[i]);
    u[0] = NAN;
    return set(c, inputs, 1, u, 1) == 3 ? 0 : 10;
}
