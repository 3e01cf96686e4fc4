/* A controller that is advanced by a robot's statuses, with the limits of its commands.

   At each status it computes the same numbers as experiments/hardware/drive.py, which repeats
   every run for comparison.
*/
#ifndef DRIVE_H
#define DRIVE_H

#include "controller.h"
#include "messages.h"

/* Event before the answer to a status. */
enum {
    DRIVE_INTERRUPTED = 1,
    DRIVE_ALONE = 2,
    DRIVE_UNRECORDED = 4,
    DRIVE_ASKED = 8,
    DRIVE_FOREIGN = 16
};

/* Reason of the end. */
typedef enum {
    DRIVE_GOES_ON,
    DRIVE_RESTED,     /* after a fault or a request, or has not come to rest in time */
    DRIVE_LEFT_MODE,  /* the robot has left its mode */
    DRIVE_NOT_FINITE, /* the law's command is not finite */
    DRIVE_CLOCK,      /* the robot's clock jumped */
    DRIVE_FASTER      /* the stop accelerated the robot */
} drive_end;

/* Inputs of the controller. Add further inputs here and in drive_fill. */
typedef struct {
    double joint_state[4 * DRIVE_JOINTS], joint_torque[DRIVE_JOINTS], wrench[6];
    double stop_request;
    double override; /* requested speed of the reference as a share of the planned one */
} drive_told;

/* Fill the controller's inputs; generated beside the setup. */
void drive_fill(controller_inputs *inputs, const drive_told *told);

typedef struct {
    controller_state controller;
    drive_told told;
    double last_state[4 * DRIVE_JOINTS], last_torque[DRIVE_JOINTS];
    double q[DRIVE_JOINTS];    /* last finite positions */
    double sent[DRIVE_JOINTS]; /* last command */
    int lost[DRIVE_JOINTS];    /* joints with rejected positions */
    int has_sent, is_stopping;
    int64_t first, tick; /* clock of the first status, us; number of the next tick */
    double motion_time; /* in the planned motion's time, s */
    double stop_time, stop_speed;
    int64_t resting; /* ticks */
    drive_end end;
} drive_state;

/* Answer to a status, with its record. */
typedef struct {
    double sent[DRIVE_JOINTS];
    int32_t missed, clipped, fault;
} drive_command;

/* Return whether a robot is in the required mode, and rests at the scenario's start. */
int drive_accepts(const drive_status *status);

/* Begin at the first status, with a speed override. */
void drive_begin(
    drive_state *drive, const drive_status *status, const double wrench[6], double override);

/* Request a stop from the controller. */
void drive_stop(drive_state *drive);

/* Advance by the ticks of a status; return whether there is a command to be sent. */
int drive_answer(
    drive_state *drive, const drive_status *status, const double wrench[6],
    drive_command *command);

/* Return whether a status belongs to an answered tick. */
int drive_is_old(const drive_state *drive, const drive_status *status);

/* Time since the first status, by the robot's clock [s]. */
double drive_time(const drive_state *drive);

/* Return the reason to stop sending. */
drive_end drive_ends(const drive_state *drive);

#endif
