/* Step the controller once a sampling time, with deadlines, and print the durations.

   usage: main_rt [SECONDS [LOG]]     10 s and replay.bin if omitted

   Inputs come from a log here, and outputs are discarded: put your robot's drivers into
   read_inputs and write_outputs. Runs with real-time priority where that is allowed. Status: the
   fault.
*/
#define _POSIX_C_SOURCE 200112L

#include <errno.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "controller.h"

#define PRIORITY 80
#define BINS 20
#define BIN_US 10.0

static FILE *source;

/* Replace: read the measurement of this instant. Returns whether there is one. */
static int read_inputs(controller_inputs *inputs)
{
    if (fread(inputs, sizeof *inputs, 1, source) != 1) {
        return 0;
    }
    return fseek(source, (long)sizeof(controller_outputs), SEEK_CUR) == 0;
}

/* Replace: send the command to the drives. */
static void write_outputs(const controller_outputs *outputs)
{
    (void)outputs;
}

static double since_us(const struct timespec *begin)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * (double)(t.tv_sec - begin->tv_sec) + 1e-3 * (double)(t.tv_nsec - begin->tv_nsec);
}

static void advance(struct timespec *t)
{
    t->tv_nsec += (long)(CONTROLLER_SAMPLING_TIME * 1e9 + 0.5);
    while (t->tv_nsec >= 1000000000L) {
        t->tv_nsec -= 1000000000L;
        ++t->tv_sec;
    }
}

static void print_times(const unsigned long *count, unsigned long late, double worst)
{
    int i;
    for (i = 0; i < BINS; ++i) {
        if (count[i] > 0) {
            printf("%s %4.0f us: %lu\n", i < BINS - 1 ? "below" : "above",
                   BIN_US * (i < BINS - 1 ? i + 1 : i), count[i]);
        }
    }
    printf("worst %.1f us, %lu ticks began after the next was due\n", worst, late);
}

int main(int argc, char **argv)
{
    const double seconds = argc > 1 ? atof(argv[1]) : 10.0;
    const char *name = argc > 2 ? argv[2] : "replay.bin";
    const struct sched_param priority = {.sched_priority = PRIORITY};
    const unsigned long ticks = (unsigned long)(seconds / CONTROLLER_SAMPLING_TIME + 0.5);
    unsigned long k, late = 0, count[BINS] = {0};
    double worst = 0.0;
    int fault = 0;
    controller_state state;
    controller_inputs inputs;
    controller_outputs outputs;
    struct timespec due;

    source = fopen(name, "rb");
    if (source == NULL) {
        fprintf(stderr, "%s: %s\n", name, strerror(errno));
        return 2;
    }
    if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) {
        printf("no real-time priority: %s\n", strerror(errno));
    }
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (k = 0; k < ticks; ++k) {
        struct timespec begin;
        double spent;
        int bin;
        advance(&due);
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR) {
        }
        late += since_us(&due) > 1e6 * CONTROLLER_SAMPLING_TIME ? 1u : 0u;
        if (!read_inputs(&inputs)) {
            printf("no more inputs after %lu ticks\n", k);
            break;
        }
        if (k == 0) {
            controller_initialize(&state, &inputs);
        }
        clock_gettime(CLOCK_MONOTONIC, &begin);
        fault = controller_step(&state, &inputs, &outputs);
        spent = since_us(&begin);
        write_outputs(&outputs);
        worst = spent > worst ? spent : worst;
        bin = spent < BIN_US * BINS ? (int)(spent / BIN_US) : BINS - 1;
        ++count[bin];
    }
    print_times(count, late, worst);
    if (fault != 0) {
        printf("fault %d\n", fault);
    }
    fclose(source);
    return fault;
}
