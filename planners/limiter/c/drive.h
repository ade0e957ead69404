/* The limiter of a drive: i2t and, where a reading protects, a trip with its restart; drive_numbers.h has the numbers.
 *
 *     static lptn_drive drive;
 *     lptn_drive_start(&drive, JOINT);
 *     every period: current = lptn_drive_limit(&drive, wanted, reading, period);
 *
 * No heap, no globals but constants. */
#ifndef LPTN_DRIVE_H
#define LPTN_DRIVE_H
#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    int joint, tripped, warned; /* of the names in drive_numbers.h; whether it rests; whether a trip is near */
    double sum;                 /* A2 */
} lptn_drive;

/* A drive that was just switched on may be as hot as it can be: i2t begins at its threshold, and one with a restart rests until
 * its reading has come down to it. `joint`: its row in drive_numbers.h; of another no current flows. */
void lptn_drive_start(lptn_drive *drive, int joint);

/* The current [A] that may flow for a period [s], more than 0, where `wanted` [A] is wanted, NaN for none. `reading` [degC]: one
 * that is no number, or colder than the coldest air, trips. */
double lptn_drive_limit(lptn_drive *drive, double wanted, double reading, double period);

#ifdef __cplusplus
}
#endif
#endif
