/* Feed invalid inputs to the controller, and check its reaction.

   usage: replay_random [LOG [STEPS]]     replay.bin and 100000 if omitted

   It repeatedly begins with the first inputs of the log and continues with some of the next ones,
   then with inputs in which some or all numbers are NaN, infinite or random, then a few valid
   ones. At every step the first output, the command of the drives, must be finite; a NaN or
   infinite input must end in a fault; and a fault must hold. Status 0: passed; 1: failed; 2: no
   log.
*/
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "controller.h"

#define INPUTS (sizeof(controller_inputs) / sizeof(double))
#define OUTPUTS (sizeof(controller_outputs) / sizeof(double))
#define MOST_RECORDS 1000
#define WRONG 10 /* steps in a row */
#define GOOD 10

typedef struct {
    double inputs[INPUTS];
    double outputs[OUTPUTS];
} tick_record;

static uint64_t seed = 88172645463325252u;

static uint64_t random_bits(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return seed;
}

/* Return a number from 0 to below 1. */
static double uniform(void)
{
    return (double)(random_bits() >> 11) / 9007199254740992.0;
}

static double wrong_number(double right)
{
    const double sign = uniform() < 0.5 ? -1.0 : 1.0;
    uint64_t bits;
    double any;
    switch (random_bits() % 6) {
    case 0:
        return NAN;
    case 1:
        return sign * INFINITY;
    case 2: /* of any size */
        return sign * pow(10.0, 600.0 * uniform() - 300.0);
    case 3:
        return right + sign * pow(10.0, 12.0 * uniform() - 6.0);
    case 4:
        return 0.0;
    default: /* any double */
        bits = random_bits();
        memcpy(&any, &bits, sizeof any);
        return any;
    }
}

/* Change one number, or each with some probability; return whether one is not finite. */
static int spoil(double *inputs)
{
    const double chance = uniform() < 0.5 ? 0.0 : uniform();
    const size_t one = (size_t)(random_bits() % INPUTS);
    size_t i;
    int none = 0;
    for (i = 0; i < INPUTS; ++i) {
        if (i == one || uniform() < chance) {
            inputs[i] = wrong_number(inputs[i]);
        }
        none |= !isfinite(inputs[i]);
    }
    return none;
}

static int told_is_finite(const controller_outputs *outputs)
{
    double told[CONTROLLER_DRIVES];
    size_t i;
    memcpy(told, outputs, sizeof told);
    for (i = 0; i < CONTROLLER_DRIVES; ++i) {
        if (!isfinite(told[i])) {
            return 0;
        }
    }
    return 1;
}

static int complain(const char *what, unsigned long step)
{
    printf("step %lu: %s\n", step, what);
    return 1;
}

/* Return 1 after a failure. */
static int one_run(const tick_record *log, size_t ticks, unsigned long *step, unsigned long *faults)
{
    const size_t before = (size_t)(random_bits() % (ticks < GOOD ? ticks : GOOD)) + 1;
    controller_state state;
    controller_inputs given;
    controller_outputs outputs;
    double inputs[INPUTS];
    size_t k;
    int fault = 0;
    memcpy(&given, log[0].inputs, sizeof given);
    controller_initialize(&state, &given);
    for (k = 0; k < before + WRONG + GOOD; ++k, ++*step) {
        const int last = fault;
        int none = 0;
        memcpy(inputs, log[k % ticks].inputs, sizeof inputs);
        if (k >= before && k < before + WRONG) {
            none = spoil(inputs);
        }
        memcpy(&given, inputs, sizeof given);
        fault = controller_step(&state, &given, &outputs);
        if (!told_is_finite(&outputs)) {
            return complain("the command of the drives is not finite", *step);
        }
        if (none && fault == 0) {
            return complain("an input that is no number is no fault", *step);
        }
        if (last != 0 && fault == 0) {
            return complain("a fault is gone", *step);
        }
    }
    *faults += fault != 0 ? 1u : 0u;
    return 0;
}

int main(int argc, char **argv)
{
    static tick_record log[MOST_RECORDS];
    const char *name = argc > 1 ? argv[1] : "replay.bin";
    const unsigned long steps = argc > 2 ? strtoul(argv[2], NULL, 10) : 100000u;
    unsigned long step = 0, runs = 0, faults = 0;
    size_t ticks = 0;
    FILE *file = fopen(name, "rb");
    if (file != NULL) {
        ticks = fread(log, sizeof log[0], MOST_RECORDS, file);
        fclose(file);
    }
    if (ticks == 0) {
        fprintf(stderr, "%s: no log, or an empty one\n", name);
        return 2;
    }
    while (step < steps) {
        ++runs;
        if (one_run(log, ticks, &step, &faults) != 0) {
            return 1;
        }
    }
    printf("steps %lu runs %lu faults %lu\n", step, runs, faults);
    return 0;
}
