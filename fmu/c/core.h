/* One instance of a thermal network behind either FMI version: its data and what the two wrappers call. */
#ifndef LPTN_CORE_H
#define LPTN_CORE_H

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "config.h"

/* Both FMI versions number their statuses alike. */
typedef enum { OK, WARNING, DISCARD, ERROR } Status;

typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    EVENT = 4,      /* Model Exchange, and Co-Simulation of FMI 3 with event mode */
    CONTINUOUS = 8, /* Model Exchange */
    STEP = 16,      /* Co-Simulation, at a communication point */
    UPDATE = 32,    /* Co-Simulation, inside an intermediate update */
    TERMINATED = 64
} Mode;

enum { MODEL_EXCHANGE, CO_SIMULATION };

/* Log categories; what one says is heard only while its bit is set. */
typedef enum { WARNINGS, DISCARDS, ERRORS, CATEGORY_COUNT } Category;
#define BIT(category) (1 << (category))
#define ALL_CATEGORIES (BIT(CATEGORY_COUNT) - 1)
/* An array of C has at least one element. */
enum { SPACE_U = NU > 0 ? NU : 1, SPACE_Y = NY > 0 ? NY : 1, SPACE_Z = NZ > 0 ? NZ : 1, SPACE_E = NE > 0 ? NE : 1 };

/* All that a call can change, in one piece without padding: this is what the state functions copy and serialise. */
typedef struct {
    double time, start, stop;  /* stop is infinite where none was given */
    double x[NX], u[SPACE_U], slope[SPACE_U], p[NP];
    double begun[NX]; /* the states in which the run began */
    int64_t mode, type, sloped;
    int64_t crossed[SPACE_E]; /* limits that are passed */
    int64_t event_mode;       /* whether the importer of Co-Simulation handles events */
    int64_t waiting;          /* an event that it has not handled yet */
    int64_t ticks, begins;    /* clocks that are active in event mode: a limit crossed, a run begins */
} Data;

typedef struct Snapshot {
    Data data;
    struct Snapshot *next;
} Snapshot;

struct Instance;
typedef void (*Logger)(struct Instance *, Status, const char *category, const char *message);

/* What an importer may do inside a step; the FMI 3 wrapper fills it in. `before` asks for the inputs at the end
   of an inner step, `after` shows its result and returns nonzero to end the step early. Null where there is none. */
typedef struct {
    void (*before)(struct Instance *, double time);
    int (*after)(struct Instance *, double time);
    int early; /* whether a step may end at an event */
} Hooks;

typedef struct Instance {
    uint64_t magic;
    Data data;
    /* Results, calculated when they are asked for. */
    double rates[NX], outputs[SPACE_Y], forecasts[SPACE_Z], bound;
    int rates_known, outputs_known, forecasts_known, bound_known;
    /* Factors of I - gamma h J, kept while h and J stay the same to the last bit. */
    double jacobian[NX * NX], factors[NX * NX], factored_h;
    int pivots[NX], factored;
    Snapshot *snapshots;
    int warned_cold, warned_step;
    Status last_step;
    double last_time;
    char *name;
    Logger log;
    int logged; /* bits of the log categories that are on */
    void *environment; /* the importer's */
    void *callbacks;   /* the wrapper's */
} Instance;

static Instance *core_new(const char *name, int type, Logger log, int logging);
static void core_free(Instance *);
static Status core_fail(Instance *, const char *function, const char *format, ...);
static Status core_set_logging(Instance *, const char *function, int on, size_t, const char *const *categories);
static int core_refuses(Instance *, const char *function, int modes);
static int core_refuses_type(Instance *, const char *function, int type);
static void core_reset(Instance *);
static Status core_start(Instance *, const char *function, double start, int has_stop, double stop);
static Status core_get(Instance *, const char *function, const uint32_t *, size_t, double *);
static Status core_set(Instance *, const char *function, const uint32_t *, size_t, const double *);
static Status core_set_slopes(Instance *, const char *function, const uint32_t *, size_t, const int *, const double *);
static Status core_orders(Instance *, const char *function, const int *, size_t);
static Status core_output_slopes(Instance *, const char *function, const uint32_t *, size_t, double *);
static Status core_set_states(Instance *, const char *function, const double *, size_t);
static Status core_rates(Instance *, const char *function, double *, size_t);
static int core_due(const Instance *, int limit);
static int core_crossed(const Instance *, int limit);
static double core_indicator(const Instance *, int limit);
static void core_enter_event(Instance *);
static int core_update(Instance *);
static Status core_indicators(Instance *, const char *function, double *, size_t);
static Status core_step(Instance *, const char *function, double from, double step, const Hooks *, double *reached);
static Status core_forward(Instance *, const char *function, const uint32_t *, size_t, const uint32_t *, size_t,
                           const double *, double *);
static Status core_reverse(Instance *, const char *function, const uint32_t *, size_t, const uint32_t *, size_t,
                           const double *, double *);
static Status core_save(Instance *, const char *function, void **);
static Status core_restore(Instance *, const char *function, void *);
static Status core_drop(Instance *, const char *function, void **);
static Status core_serialized_size(Instance *, const char *function, void *, size_t *);
static Status core_serialize(Instance *, const char *function, void *, unsigned char *, size_t);
static Status core_deserialize(Instance *, const char *function, const unsigned char *, size_t, void **);

#endif
