/* Feed a recorded log to the controller and compare the outputs, bit by bit.

   usage: replay [LOG [STEPS]]          replay.bin and 1000000 if omitted
          replay -w INPUTS OUTPUTS

   The log contains doubles: for each tick the inputs, then the outputs, as in interface.json.
   Then STEPS steps are measured, one after the other.
   Prints one line of numbers for programs, too. Status 0: all bits the same; 1: not; 2: no log.

   With -w the log contains only inputs, and the controller's outputs are written.
*/
#define _POSIX_C_SOURCE 199309L

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "controller.h"

#define INPUTS (sizeof(controller_inputs) / sizeof(double))
#define OUTPUTS (sizeof(controller_outputs) / sizeof(double))
#define MEASURED 1000000 /* steps */

typedef struct {
    controller_inputs inputs;
    controller_outputs outputs;
} tick_record;

static double now_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static tick_record *read_log(const char *name, size_t *ticks)
{
    FILE *file = fopen(name, "rb");
    tick_record *records = NULL, *larger;
    size_t room = 0;
    *ticks = 0;
    if (file == NULL) {
        return NULL;
    }
    for (;;) {
        if (*ticks == room) {
            room = room ? 2 * room : 1024;
            larger = realloc(records, room * sizeof *records);
            if (larger == NULL) {
                break;
            }
            records = larger;
        }
        if (fread(&records[*ticks], sizeof *records, 1, file) != 1) {
            break;
        }
        ++*ticks;
    }
    fclose(file);
    return records;
}

/* Return the number of ticks that differ, and the largest difference, infinite with NaN; print
   the first. */
static size_t compare(const tick_record *log, size_t ticks, double *largest)
{
    controller_state state;
    controller_outputs outputs;
    double found[OUTPUTS], expected[OUTPUTS];
    size_t k, i, differing = 0;
    *largest = 0.0;
    controller_initialize(&state, &log[0].inputs);
    for (k = 0; k < ticks; ++k) {
        int same = 1;
        double difference;
        controller_step(&state, &log[k].inputs, &outputs);
        memcpy(found, &outputs, sizeof found);
        memcpy(expected, &log[k].outputs, sizeof expected);
        for (i = 0; i < OUTPUTS; ++i) {
            if (memcmp(&found[i], &expected[i], sizeof(double)) == 0
                || (isnan(found[i]) && isnan(expected[i]))) {
                continue;
            }
            if (differing == 0 && same) {
                printf("first difference: tick %lu, number %lu of the outputs: %.17g, logged %.17g\n",
                       (unsigned long)k, (unsigned long)i, found[i], expected[i]);
            }
            same = 0;
            difference = fabs(found[i] - expected[i]);
            if (!(difference <= *largest)) {
                *largest = isnan(difference) ? INFINITY : difference;
            }
        }
        differing += same ? 0u : 1u;
    }
    return differing;
}

/* Measure single ticks [us], in ascending order. */
static void measure(const tick_record *log, size_t ticks, double *times, size_t count)
{
    controller_state state;
    controller_outputs outputs;
    size_t k;
    for (k = 0; k < count; ++k) {
        double begin;
        if (k % ticks == 0) {
            controller_initialize(&state, &log[0].inputs);
        }
        begin = now_us();
        controller_step(&state, &log[k % ticks].inputs, &outputs);
        times[k] = now_us() - begin;
    }
    qsort(times, count, sizeof *times, ascending);
}

/* Write the controller's outputs for inputs; return the status. */
static int write_outputs(const char *from, const char *to)
{
    FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
    controller_state state;
    controller_inputs inputs;
    controller_outputs outputs;
    size_t ticks = 0;
    int status = in == NULL || out == NULL ? 2 : 0;
    while (status == 0 && fread(&inputs, sizeof inputs, 1, in) == 1) {
        if (ticks++ == 0) {
            controller_initialize(&state, &inputs);
        }
        controller_step(&state, &inputs, &outputs);
        status = fwrite(&outputs, sizeof outputs, 1, out) == 1 ? 0 : 2;
    }
    if (in != NULL) {
        fclose(in);
    }
    if (out != NULL && fclose(out) != 0) {
        status = 2;
    }
    return ticks == 0 ? 2 : status;
}

int main(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "replay.bin";
    const size_t given = argc > 2 ? strtoul(argv[2], NULL, 10) : MEASURED;
    const size_t measured = given > 0 ? given : 1;
    size_t ticks, differing;
    tick_record *log;
    double *times, largest;
    if (argc == 4 && strcmp(argv[1], "-w") == 0) {
        return write_outputs(argv[2], argv[3]);
    }
    log = read_log(name, &ticks);
    times = malloc(measured * sizeof *times);
    if (log == NULL || ticks == 0 || times == NULL) {
        fprintf(stderr, "%s: no log, or an empty one\n", name);
        free(log);
        free(times);
        return 2;
    }
    differing = compare(log, ticks, &largest);
    measure(log, ticks, times, measured);
    printf("ticks %lu differing %lu largest %.3g median_us %.2f p99_us %.2f worst_us %.2f\n",
           (unsigned long)ticks, (unsigned long)differing, largest, times[measured / 2],
           times[measured - 1 - measured / 100], times[measured - 1]);
    free(log);
    free(times);
    return differing == 0 ? 0 : 1;
}
