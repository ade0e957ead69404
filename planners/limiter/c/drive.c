/* The limiter of drive.h. */
#include "drive.h"

#include <math.h>

typedef struct {
    double peak, time_constant, threshold, warning, trip, restart;
} lptn_drive_number;

#include "drive_numbers.h"

static int is_one(int joint) { return joint >= 0 && joint < (int)(sizeof lptn_drive_numbers / sizeof *lptn_drive_numbers); }

void lptn_drive_start(lptn_drive *drive, int joint) {
    drive->joint = joint, drive->tripped = is_one(joint) && lptn_drive_numbers[joint].restart > -HUGE_VAL, drive->warned = 0;
    drive->sum = is_one(joint) ? lptn_drive_numbers[joint].threshold : 0;
}

double lptn_drive_limit(lptn_drive *drive, double wanted, double reading, double period) {
    if (!is_one(drive->joint) || !(period > 0)) return 0;
    const lptn_drive_number *n = &lptn_drive_numbers[drive->joint];
    const double share = -expm1(-period / n->time_constant); /* of what flows that comes into the sum */
    const int sound = reading >= lptn_drive_coldest;
    double square = wanted * wanted, most;
    if (n->trip > -HUGE_VAL) {
        drive->warned = !(sound && reading < n->warning);
        if (!(sound && reading < n->trip)) drive->tripped = 1;
        else if (reading <= n->restart) drive->tripped = 0;
    }
    if (drive->tripped || !(square > 0)) square = 0;
    if (square > n->peak * n->peak) square = n->peak * n->peak;
    most = drive->sum + (n->threshold - drive->sum) / share; /* with which the sum ends at the threshold */
    if (!(square <= most)) square = most > 0 ? most : 0;
    drive->sum += share * (square - drive->sum);
    return wanted < 0 ? -sqrt(square) : sqrt(square);
}
