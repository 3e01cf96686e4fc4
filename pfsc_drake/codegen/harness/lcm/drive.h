/* A controller that is advanced by what a robot tells, and what it allows itself.

   It does at each status what experiments/hardware/drive.py does, number by number: every run is
   repeated there and compared.
*/
#ifndef DRIVE_H
#define DRIVE_H

#include "controller.h"
#include "messages.h"

/* What happened before a status was answered, beside the status. */
enum {
    DRIVE_INTERRUPTED = 1,
    DRIVE_ALONE = 2,
    DRIVE_UNRECORDED = 4,
    DRIVE_ASKED = 8,
    DRIVE_FOREIGN = 16
};

/* Why it ended. */
typedef enum {
    DRIVE_GOES_ON,
    DRIVE_RESTED,     /* after a fault or a request, or has not come to rest in time */
    DRIVE_LEFT_MODE,  /* the robot does not move any more */
    DRIVE_NOT_FINITE, /* what the law wants is no number */
    DRIVE_CLOCK,      /* the robot's clock jumped */
    DRIVE_FASTER      /* the stop made the robot faster */
} drive_end;

/* What the controller is told. A further input has its place here and in drive_fill. */
typedef struct {
    double joint_state[4 * DRIVE_JOINTS], joint_torque[DRIVE_JOINTS], wrench[6];
    double stop_request;
    double override; /* share of its planned pace at which the reference is to move */
} drive_told;

/* Give the controller what it is told; written beside the setup. */
void drive_fill(controller_inputs *inputs, const drive_told *told);

typedef struct {
    controller_state controller;
    drive_told told;
    double last_state[4 * DRIVE_JOINTS], last_torque[DRIVE_JOINTS];
    double q[DRIVE_JOINTS];    /* the last that were finite */
    double sent[DRIVE_JOINTS]; /* what the robot was told last */
    int lost[DRIVE_JOINTS];    /* whose positions are not believed */
    int has_sent, is_stopping;
    int64_t first, tick; /* clock of the first status, us; number of the next tick */
    double motion_time; /* in the time of the motion as planned, s */
    double stop_time, stop_speed;
    int64_t resting; /* ticks */
    drive_end end;
} drive_state;

/* What a status was answered with, and what is noted of it. */
typedef struct {
    double sent[DRIVE_JOINTS];
    int32_t missed, clipped, fault;
} drive_command;

/* Return whether a robot moves where it is told to, and rests at the scenario's start. */
int drive_accepts(const drive_status *status);

/* Begin where the first status says, at a pace. */
void drive_begin(
    drive_state *drive, const drive_status *status, const double wrench[6], double override);

/* Let the controller bring the robot to rest. */
void drive_stop(drive_state *drive);

/* Go on by the ticks that a status tells of; return whether there is a command to be sent. */
int drive_answer(
    drive_state *drive, const drive_status *status, const double wrench[6],
    drive_command *command);

/* Return whether a status is of a tick that was answered. */
int drive_is_old(const drive_state *drive, const drive_status *status);

/* Time since the first status, as the robot counts it [s]. */
double drive_time(const drive_state *drive);

/* Return why nothing more is to be sent. */
drive_end drive_ends(const drive_state *drive);

#endif
