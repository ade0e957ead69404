/* Whether each temperature sensor is alive, by what the filter expects of its reading: `lptn.online.aliveness` again, with
 * its constants (alive.h). A reading that is bit for bit the last one again has a probability, for the filter knows how far
 * the temperature has moved and how far noise and steps reach; of a sensor that stands it is 1. What these probabilities
 * multiply to is the evidence. A reading that leaps further than noise and model explain is not believed either. */

#include "alive.h"

#define HOTTEST 500.0 /* degC; beyond these no reading is believed */
#define COLDEST -80.0

static int believed(double reading) { return reading > COLDEST && reading < HOTTEST; }

static double normal_share_below(double z) { return 0.5 * erfc(-0.70710678118654752440 * z); }

static void begin_sensors(lptn_mpc_sensors *a) {
    memset(a, 0, sizeof *a);
    for (int i = 0; i < LPTN_NN; i++) a->last[i] = NAN, a->grain[i] = INFINITY;
}

/* Look at the readings of one update. use[i]: 0 for one that is missing or not believed, 1 to take in, 2 to take in in spite
 * of a leap, since nothing says that the sensor leapt and not the filter. white: variance of the readings before rounding
 * [K^2]; step: of the sensors [K]; predicted [degC] and its variance [K^2]: by the filter, which has not taken them in. */
static void judge(lptn_mpc_sensors *a, double white, double step, const double *readings, const double *predicted,
                  const double *variance, int *use) {
    int contradicted = 0, heard = 0;
    for (int i = 0; i < LPTN_NN; i++) {
        const int seen = believed(readings[i]), same = seen && readings[i] == a->last[i];
        const int changed = seen && !same && !isnan(a->last[i]), was_far = a->far[i];
        double inside = 0;
        int far = 0;
        if (seen) {
            const double known = isfinite(a->grain[i]) ? a->grain[i] : step > 0 ? step : ALIVE_COARSEST;
            const double cell = fmax(step, known), away = readings[i] - predicted[i];
            const double spread = fmax(sqrt(fmax(variance[i], 0) + white), 1e-12);
            inside = normal_share_below((away + cell / 2) / spread) - normal_share_below((away - cell / 2) / spread);
            far = fabs(away) > fmax(ALIVE_LEAP * sqrt(spread * spread + cell * cell / 12), ALIVE_LEAST_LEAP);
        }
        if (same) {
            /* A topic repeats its last value until the next one comes: only so large a share of readings is new. */
            const double fresh = fmin((a->moves[i] + 1) / (a->due[i] + 1), 1.0);
            a->evidence[i] -= log(fmax(1 - fresh * (1 - inside), ALIVE_LEAST_CHANCE));
        } else if (changed) {
            a->evidence[i] = 0;
            a->grain[i] = fmin(a->grain[i], fabs(readings[i] - a->last[i]));
        }
        if (seen && !same) a->since[i] = a->clock;
        if (seen && !a->silent[i] && !far) a->moves[i] += changed, a->due[i] += 1 - inside;
        if (seen) {
            const int lasting = a->clock - a->since[i] >= ALIVE_SHORTEST;
            a->last[i] = readings[i];
            a->silent[i] = same && (a->silent[i] || (a->evidence[i] > ALIVE_STANDS && lasting));
            a->far[i] = far;
        }
        if (!far || !was_far) a->far_since[i] = a->clock;
        use[i] = seen + (far ? 2 : 0);
        contradicted += far && !a->silent[i], heard += seen && !a->silent[i];
    }
    for (int i = 0; i < LPTN_NN; i++) {
        const int seen = use[i] > 0, far = use[i] > 1;
        /* A filter that most sensors contradict for long is itself wrong. */
        const int lasting = 2 * contradicted > heard && a->clock - a->far_since[i] >= ALIVE_SHORTEST;
        const int again = far && (a->taken[i] < ALIVE_FEWEST || lasting);
        use[i] = !seen || a->silent[i] ? 0 : !far ? 1 : again ? 2 : 0;
        a->taken[i] += use[i] > 0;
    }
}
